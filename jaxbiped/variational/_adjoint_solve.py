"""Second variation along a known motion: leading tangents forwards in time, adjoints backwards.

For two tangents V and Q of a motion its mixed second tangent C follows C' = J C + f''[V, Q]. Across
a switch g = 0, crossed at the rate ġ, the Jacobian J jumps, so its derivative holds a pulse that no
derivative taken through solver steps can see: C jumps by (J₊ − J₋) V (dg·Q)/ġ. A weighted sum of C
at the end of a step is a sum of what was before it: C there, and linearly the family's tangent Q
and the parameters, which enter the source and the jump. So the weights go backwards, two rows for C
and one for Q, however many families there are. All components are in order. The steps that they
read backwards are those of the first variation in two directions V, recorded forwards.

A tangent may hold much of the flow itself: where a parameter makes the motion later, it does. Of
that part the second tangents are known exactly, and yet it is the largest and changes fastest. So
at every step's start what a tangent has of the flow is taken out, which is only to read the motion
at other times.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import PyTree, PyTreeDef

from jaxbiped._types import Scalar, select
from jaxbiped.caching._caches import PROGRAMS, bounded_cache
from jaxbiped.compiler import AbstractEngine, Program, Recorded, Recording, Request, jacobian
from jaxbiped.hybrid._system import AbstractSystem
from jaxbiped.variational._collocated_step import (
    KnownStep,
    Linear,
    Order,
    Rows,
    Stages,
    collocate_step,
    linearise_about,
    order_of,
)
from jaxbiped.variational._flow import (
    Arrival,
    Flow,
    after_reset,
    crossing_of,
    earlier_at,
    on_section,
    sides_of,
)
from jaxbiped.variational._solve_to_section import Nodes
from jaxbiped.variational._tangents import Seeded, active_leaves

COUNT = 2
"""Leading tangents: a multiplier's eigenvector has a real and an imaginary part."""
_LONG_AGO = 1.0
"""Time [s] since the last switch, where none is known."""
_SETTLED = 1e-9
"""How long after a switch the first step ends at the earliest [s], however short the solve's own
are: penetrations that are mostly rounding make the singular second derivatives there noise."""


class Step(NamedTuple):
    """A step by collocation of the motion and its v tangents in the leading eigendirections.

    Attributes:
        before: state where it starts, (c,).
        points, share: as from `collocate_step`.
        fresh: 1 where it starts on a switch, else 0.
        which: the number of the switch that it ends on, as in `Crossing`.
        leading: these tangents where it starts, in order, with the flow still in them, (v, c).
    """

    before: Scalar
    points: Scalar
    share: Scalar
    fresh: Scalar
    which: Scalar
    leading: Scalar

    def row(self) -> Scalar:
        """One number after the other."""
        return ravel_pytree(self)[0]

    @staticmethod
    def zero(components: int, count: int) -> "Step":
        """A step of so many components and tangents."""
        c = components
        return Step(
            before=jnp.zeros(c),
            points=jnp.zeros((3, c)),
            share=jnp.zeros(3),
            fresh=jnp.zeros(()),
            which=jnp.zeros(()),
            leading=jnp.zeros((count, c)),
        )


class FirstVariationInputs(NamedTuple):
    """Inputs.

    Attributes:
        args: parameters.
        start, arrival: time and state where the motion starts and where it arrives, (1 + c,).
        leading: tangents in the leading eigendirections at the start, (v, c).
        steps: how many the motion has.
    """

    args: PyTree
    start: Scalar
    arrival: Scalar
    leading: Scalar
    steps: Scalar


class FirstVariation(NamedTuple):
    """Outputs: tangents before the arrival (v, c), the state there, and the number of steps."""

    leading: Scalar
    state: Scalar
    steps: Scalar


class _Carried(NamedTuple):
    """What is carried.

    Attributes:
        node: state at the end of the last step, past a switch or not.
        t, state: time and state, on the switch where there was one: `fresh`.
        switched: time of the last switch.
        leading: the tangents, in order.
        read: nodes read; `taken` of them ended a step.
        step: the last one, if the last node `ends` one.
    """

    node: Scalar
    t: Scalar
    state: Scalar
    fresh: Scalar
    switched: Scalar
    leading: Scalar
    read: Scalar
    taken: Scalar
    step: Step
    ends: Scalar


class FirstVariationSolve:
    """The functions of the program, whose input stream is time and state at the ends of steps.

    The motion ends at the arrival, not at the last node, and begins and ends before its section:
    that may be a switch, as touchdown is. Where a step starts on a switch, the part of the flow
    stays in the tangents.
    """

    def __init__(self, flow: Callable[[FirstVariationInputs], Flow], row: int) -> None:
        self.flow, self.row = flow, row

    def program(self) -> Program:
        return Program(self.start, self.attempt, self.finish, record=self.record, stream=self.row)

    def start(self, given: FirstVariationInputs) -> _Carried:
        flow = self.flow(given)
        order, parameters = field_order(flow)
        node_row = flow.earlier(given.start, parameters)
        t, state = node_row[0], node_row[1:]
        none, zero = jnp.asarray(False), jnp.zeros(())
        return _Carried(
            node=state,
            t=t,
            state=state,
            fresh=none,
            switched=t - _LONG_AGO,
            leading=order.sorted(given.leading),
            read=zero,
            taken=zero,
            step=Step.zero(len(state), given.leading.shape[0]),
            ends=none,
        )

    def attempt(
        self, given: FirstVariationInputs, now: _Carried, row: Scalar
    ) -> tuple[_Carried, Scalar]:
        flow = self.flow(given)
        order, parameters = field_order(flow)
        read = now.read + 1.0
        over = read >= given.steps
        node_row = jnp.where(over, flow.earlier(given.arrival, parameters), row)
        t, node = node_row[0], node_row[1:]
        crossing = crossing_of(flow, now.node, node, parameters)
        end = t - crossing.past
        known = KnownStep(
            before=now.state,
            after=crossing.landed,
            start=now.t,
            span=jnp.maximum(end - now.t, 0.0),
            switched=now.switched,
            fresh=now.fresh,
            crossed=crossing.crossed,
        )
        rows = Rows(flow.rates, order, list(parameters), flow.margin)
        points, share, velocity = collocate_step(rows, known)
        stages = Stages.of(order, share, jax.lax.map(rows.by_state, points))
        begun, _ = without_flow(now.leading, order.sorted(velocity), now.fresh)
        after = _Carried(
            node=node,
            t=end,
            state=crossing.begun,
            fresh=crossing.crossed,
            switched=jnp.where(crossing.crossed, end, now.switched),
            leading=stages.carried(begun)[:, 2],
            read=read,
            taken=now.taken + 1.0,
            step=Step(
                before=now.state,
                points=points,
                share=share,
                fresh=now.fresh.astype(float),
                which=crossing.which.astype(float),
                leading=now.leading,
            ),
            ends=jnp.asarray(True),
        )
        soon = (end - now.switched < _SETTLED) & ~crossing.crossed & ~over
        waiting = now._replace(node=node, read=read, ends=jnp.asarray(False))
        return select(soon, waiting, after), over

    def record(
        self, given: FirstVariationInputs, now: _Carried, time: Scalar
    ) -> tuple[Scalar, list[Scalar]]:
        """The steps."""
        return now.ends, [now.step.row()]

    def finish(self, given: FirstVariationInputs, now: _Carried) -> FirstVariation:
        order, _ = field_order(self.flow(given))
        return FirstVariation(order.restored(now.leading), now.state, now.taken)


def without_flow(leading: Scalar, velocity: Scalar, fresh: Scalar) -> tuple[Scalar, Scalar]:
    """Tangents (v, c) without what they have of the flow, and what that is, (v,).

    Where a step starts on a switch (`fresh`), nothing is taken out.
    """
    lost = jnp.where(fresh, 0.0, (leading @ velocity) / (velocity @ velocity))
    return leading - lost[:, None] * velocity, lost


def field_order(flow: Flow) -> tuple[Order, Scalar]:
    """The order of components, and the active parameters."""
    parameters = [jnp.asarray(leaf) for leaf in active_leaves(flow.args)]
    state = [jnp.ones(())] * flow.structure.num_leaves
    vector = jnp.stack(parameters) if parameters else jnp.zeros(0)
    return order_of(flow.rates, state, parameters), vector


class Adjoints(NamedTuple):
    """Derivatives of a sum with respect to second tangents (v, c), a family's tangent (c,) and
    parameters (p,).
    """

    second: Scalar
    family: Scalar
    parameters: Scalar


def adjoint_step(
    rows: Rows, linear: Linear, step: Step, early: Scalar, after: Adjoints
) -> Adjoints:
    """Adjoints before a step, from those behind it; `early` as from `earlier_at`."""
    order, stages = rows.order, linear.stages
    c, d, count = len(order.every), order.direct, len(step.leading)
    nowhere = jnp.zeros(c)
    begun, lost = without_flow(step.leading, linear.velocity, step.fresh > 0.0)
    at_stages = stages.carried(begun)
    ends = [stages.pulled(jnp.stack([nowhere, nowhere, each])) for each in after.second]
    second = jnp.stack([start for start, _ in ends])
    weights = jnp.concatenate([forcing for _, forcing in ends])
    points, tangents = jnp.concatenate([linear.points] * count), order.restored(at_stages)
    each = points, tangents.reshape(-1, c), weights  # of every tangent at every point
    curved = jax.lax.map(lambda one: rows.curved(*one), each).reshape(count, 3, -1).sum(axis=0)
    # By how much earlier the switch is crossed, which times the jump.
    jumps = [(linear.jump @ at_stages[v, 2]) @ after.second[v, d:] for v in range(count)]
    soon = sum(jumps[1:], jumps[0])
    by_end = after.family + soon * order.sorted(early[:c])
    family, forcing = stages.pulled(curved[:, :c] + jnp.stack([nowhere, nowhere, by_end]))
    by_parameter = jnp.einsum("jk,jkp->p", forcing, linear.by_parameter)
    own = jnp.sum(curved[:, c:], axis=0) + soon * early[c:]
    without = Adjoints(second, family, after.parameters + by_parameter + own)
    return _with_flow(linear, step, lost, without)


def _with_flow(linear: Linear, step: Step, lost: Scalar, after: Adjoints) -> Adjoints:
    """Adjoints before parts of the flow are taken out of V and Q, and C changes with them.

    Where V loses σ f and Q loses τ f, C gains σ τ f' − σ Q' − τ V'. Of V that is `lost`.
    """
    order, velocity, gradient = linear.stages.order, linear.velocity, linear.at_start
    c, d = len(order.every), order.direct

    def rate_of(tangent: Scalar) -> Scalar:
        kept = gradient[:, :c] @ tangent
        return jnp.concatenate([tangent[d : 2 * d], kept]) if d else kept

    flow, rate, shift = rate_of(velocity), jnp.zeros(c), -(after.family @ velocity)
    for v in range(len(lost)):
        shift = shift + after.second[v] @ (lost[v] * flow - rate_of(step.leading[v]))
        rate = rate - lost[v] * after.second[v]
    pulled = rate[d:] @ gradient
    family = after.family + pulled[:c]
    if d:
        follows = [jnp.zeros(d), rate[:d], jnp.zeros(c - 2 * d)]
        family = family + jnp.concatenate(follows)
    part = jnp.where(step.fresh > 0.0, 0.0, shift / (velocity @ velocity))
    return Adjoints(after.second, family + part * velocity, after.parameters + pulled[c:])


class _Given(NamedTuple):
    """Inputs.

    Attributes:
        args: parameters.
        arrival: time and state where the motion arrives.
        leading: what `carry_tangents` gave.
        after: adjoints behind the arrival, of components in their own order.
    """

    args: PyTree
    arrival: Scalar
    leading: FirstVariation
    after: Adjoints


class _Now(NamedTuple):
    """What is carried: adjoints, in order, and the state where a step starts; steps read so far."""

    adjoints: Adjoints
    state: Scalar
    count: Scalar  # type: ignore[assignment]


def carry_tangents(
    engine: AbstractEngine, flow: Flow, nodes: Nodes, leading: Scalar
) -> tuple[FirstVariation, Recording | Recorded]:
    """Leading tangents (v, c) carried along a motion to its arrival; and the steps of that."""
    count = nodes.steps.astype(leading.dtype)
    request = Request(
        _program(FlowKind.of(flow), False),
        FirstVariationInputs(flow.args.args, nodes.start, nodes.arrival, leading, count),
        room=nodes.ends.room,
        stream=nodes.ends,
        quick=True,
        keeps_records=isinstance(nodes.ends, Recording),
        reads_once=True,
    )
    found = engine.run(request)
    steps = found.records if found.recording is None else found.recording
    assert steps is not None
    return found.outputs, steps


def pull_back(
    engine: AbstractEngine,
    flow: Flow,
    nodes: Nodes,
    leading: FirstVariation,
    steps: Recording | Recorded,
    after: Adjoints,
) -> Adjoints:
    """Adjoints where a motion starts, from those behind its arrival.

    Args:
        engine: what computes.
        flow: what moves.
        nodes: of the motion.
        leading, steps: from `carry_tangents` along it.
        after: adjoints behind the arrival, of tangents on the section.
    """
    given = _Given(flow.args.args, nodes.arrival, leading, after)
    program = _program(FlowKind.of(flow), True)
    return engine.run(Request(program, given, stream=steps, quick=True)).outputs


class FlowKind(NamedTuple):
    """What programs are compiled for."""

    system: AbstractSystem
    arrival: Arrival
    active: tuple[int, ...]
    state: PyTreeDef

    @staticmethod
    def of(flow: Flow) -> "FlowKind":
        return FlowKind(flow.system, flow.arrival, flow.args.active, flow.structure)

    @property
    def flow(self) -> Callable[[Any], Flow]:
        """What moves, of the inputs of a program."""
        # Compiled by itself, the field is traced once, not at each of its many uses.
        field = jax.jit(self.system.vector_field)

        def flow(given: Any) -> Flow:
            no_columns = jnp.zeros((0, 0))
            seeded = Seeded(given.args, no_columns, no_columns, self.active)
            return Flow(self.system, self.arrival, field, seeded, self.state)

        return flow


@bounded_cache(PROGRAMS)  # the same object each time, so that nothing is compiled again
def _program(kind: FlowKind, backwards: bool) -> Program:
    """The program that carries leading tangents, or that of adjoints."""
    c = kind.state.num_leaves
    if not backwards:
        return FirstVariationSolve(kind.flow, 1 + c).program()
    return _AdjointSolve(kind.flow, Step.zero(c, COUNT)).program()


class _AdjointSolve:
    """The functions of the program: its input stream's rows are steps, read backwards."""

    def __init__(self, flow: Callable[[_Given], Flow], step: Step) -> None:
        self.flow = flow
        row, self.read = ravel_pytree(step)
        self.size = len(row)

    def __fingerprint__(self) -> object:
        """See `jaxbiped.caching._fingerprint`: a row is read as one of a step of this size."""
        return self.flow, self.size

    def program(self) -> Program:
        return Program(self.start, self.attempt, self.finish, stream=self.size, backwards=True)

    def start(self, given: _Given) -> _Now:
        """Adjoints before the arrival: all of it is linear in what is there."""
        flow = self.flow(given)
        order, parameters = field_order(flow)
        z = jnp.concatenate([flow.earlier(given.arrival, parameters)[1:], parameters])
        after, c = given.after, len(given.after.family)
        by_state = jacobian(lambda z: flow.rates(z[:c], z[c:]), list(z))

        def behind(before: Adjoints) -> tuple[Scalar, Scalar]:
            family, every = jnp.concatenate([before.family, before.parameters]), []
            for leading, second in zip(given.leading.leading, before.second, strict=True):
                v, q = jnp.concatenate([leading, jnp.zeros_like(parameters)]), family
                v, q, second = on_section(flow, by_state, z, v, q, second)
                reached, second = after_reset(flow, z, v, q, second)
                every.append(second)
            return reached, jnp.stack(every)

        _, pull = jax.vjp(behind, jax.tree.map(jnp.zeros_like, after))
        (before,) = pull((after.family, after.second))
        adjoints = Adjoints(
            order.sorted(before.second),
            order.sorted(before.family),
            before.parameters + after.parameters,
        )
        return _Now(adjoints, given.leading.state, jnp.zeros(()))

    def attempt(self, given: _Given, now: _Now, row: Scalar) -> tuple[_Now, Scalar]:
        flow, step = self.flow(given), self.read(row)
        order, parameters = field_order(flow)
        rows = Rows(flow.rates, order, list(parameters), flow.margin)
        crossed, ends = step.which > 0.0, (step.before, now.state)
        sides = sides_of(flow, now.state, step.which, parameters)
        linear = linearise_about(rows, *ends, step.points, step.share, crossed, sides)
        early = jax.lax.cond(
            crossed,
            lambda: earlier_at(flow, now.state, step.which, parameters),
            lambda: jnp.zeros(len(now.state) + len(parameters)),
        )
        before, count = adjoint_step(rows, linear, step, early, now.adjoints), now.count + 1.0
        return _Now(before, step.before, count), count >= given.leading.steps

    def finish(self, given: _Given, now: _Now) -> Adjoints:
        order, _ = field_order(self.flow(given))
        second, family, parameters = now.adjoints
        return Adjoints(order.restored(second), order.restored(family), parameters)
