"""Adjoint solve of the second variation along a known motion, backwards in time.

For two tangents V and Q of a motion its mixed second tangent C follows C' = J C + f''[V, Q]. Across
a switch g = 0, crossed at the rate ġ, the Jacobian J jumps, so its derivative holds a pulse that no
derivative taken through solver steps can see: C jumps by (J₊ − J₋) V (dg·Q)/ġ. A weighted sum of C
at the end of a step is a sum of what was before it: C there, and linearly the family's tangent Q
and the parameters, which enter the source and the jump. So the weights go backwards, two rows for C
and one for Q, however many families there are. All components are in order.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import PyTree, PyTreeDef

from jaxbiped._types import Scalar
from jaxbiped.caching._caches import PROGRAMS, bounded_cache
from jaxbiped.compiler import AbstractEngine, Program, Recorded, Recording, Request, jacobian
from jaxbiped.variational._collocated_step import Linear, Rows, linearise_about
from jaxbiped.variational._first_variation import (
    FirstVariation,
    FirstVariationInputs,
    FirstVariationSolve,
    Step,
    field_order,
    without_flow,
)
from jaxbiped.variational._flow import (
    Arrival,
    Flow,
    after_reset,
    earlier_at,
    on_section,
    sides_of,
)
from jaxbiped.variational._hybrid_system import AbstractSystem
from jaxbiped.variational._solve_to_section import Nodes
from jaxbiped.variational._tangents import Seeded

COUNT = 2
"""Leading tangents: a multiplier's eigenvector has a real and an imaginary part."""


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
        _program(_Kind.of(flow), False),
        FirstVariationInputs(flow.args.args, nodes.start, nodes.arrival, leading, count),
        room=nodes.ends.room,
        stream=nodes.ends,
        quick=True,
        keeps_records=True,
        reads_once=True,
    )
    found = engine.run(request)
    assert found.recording is not None
    return found.outputs, found.recording


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
    program = _program(_Kind.of(flow), True)
    adjoints: Adjoints = engine.run(Request(program, given, stream=steps, quick=True)).outputs
    return adjoints


class _Kind(NamedTuple):
    """What programs are compiled for."""

    system: AbstractSystem
    arrival: Arrival
    active: tuple[int, ...]
    state: PyTreeDef

    @staticmethod
    def of(flow: Flow) -> "_Kind":
        return _Kind(flow.system, flow.arrival, flow.args.active, flow.structure)


@bounded_cache(PROGRAMS)  # the same object each time, so that nothing is compiled again
def _program(kind: _Kind, backwards: bool) -> Program:
    """The program that carries leading tangents, or that of adjoints."""
    # Compiled by itself, the field is traced once, not at each of its many uses.
    field = jax.jit(kind.system.vector_field)

    def flow(given: FirstVariationInputs | _Given) -> Flow:
        no_columns = jnp.zeros((0, 0))
        seeded = Seeded(given.args, no_columns, no_columns, kind.active)
        return Flow(kind.system, kind.arrival, field, seeded, kind.state)

    c = kind.state.num_leaves
    if not backwards:
        return FirstVariationSolve(flow, 1 + c).program()
    return _AdjointSolve(flow, Step.zero(c, COUNT)).program()


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
        rows = Rows(flow.rates, order, list(parameters))
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
