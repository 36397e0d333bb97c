"""First variation backwards in time: derivatives of a scalar with respect to all that came before.

A row p holds the derivatives of a scalar of a motion's end with respect to the state: its value for
a tangent Q there is p·Q. Along a step Q' = J Q + f_q dq, so that the row before is that behind
times the step's matrix, and parameters gain what the row makes of their forcing, whose sum is
differentiated at once, however many there are. A motion that is displaced meets a switch g = 0 by
τ = −dg/ġ later, and is behind it, where the state may be reset to R and the field is f₊,
R' (Q + f₋ τ) − f₊ τ: the row before is that of saltation transposed. An integral along the way is a
coordinate on which nothing depends, with the row 1 at the end.

The steps are those of the motion alone, whatever it is differentiated with respect to.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.caching._caches import PROGRAMS, bounded_cache
from jaxbiped.compiler import AbstractEngine, Program, Recorded, Request
from jaxbiped.variational._adjoint_solve import (
    FirstVariation,
    FirstVariationInputs,
    FlowKind,
    Step,
    carry_tangents,
    field_order,
)
from jaxbiped.variational._collocated_step import RADAU, Rows, Stages
from jaxbiped.variational._flow import Flow, earlier_at, tangent_on_section
from jaxbiped.variational._solve_to_section import Nodes


class Row(NamedTuple):
    """Derivatives of a scalar with respect to the c components of a state and to p parameters.

    Attributes:
        state: with respect to the state at a fixed time, shape (c,).
        parameters: with respect to the active parameters, shape (p,).
    """

    state: Scalar
    parameters: Scalar


class Arriving(NamedTuple):
    """A scalar of a motion that ends on a section.

    Attributes:
        row: its derivatives behind the arrival's reset, for states on the section.
        by_time: its derivative with respect to the time of arrival [1/s].
    """

    row: Row
    by_time: Scalar


class _Given(NamedTuple):
    """Inputs: parameters, time and state at the end, `carry_tangents`' outputs, the row there."""

    args: PyTree
    arrival: Scalar
    first: FirstVariation
    behind: Row | Arriving


class _Now(NamedTuple):
    """What is carried: time, state and row where a step starts, and steps so far.

    `forced` are derivatives of the row times the rates there with respect to the parameters.
    """

    t: Scalar
    state: Scalar
    row: Row
    forced: Scalar
    steps: Scalar


def pull_back_row(
    engine: AbstractEngine, flow: Flow, nodes: Nodes, behind: Row | Arriving
) -> tuple[Row, Recorded]:
    """Derivatives of a scalar at the start of a motion, from those at its end.

    Motions that follow each other, such as footsteps, are taken one by one, the last one first.

    Args:
        engine: what computes.
        flow: what moves, and with respect to which parameters it is differentiated.
        nodes: of the motion.
        behind: the scalar, of the state at a fixed time or of an arrival on the section.

    Returns:
        The row where the motion starts; and records of the starts of its steps, the last step
        first: time [s], state and row, and derivatives with respect to the parameters of the row
        times the rates, 1 + 2 c + p numbers.
    """
    none = jnp.zeros((0, flow.structure.num_leaves))
    first, steps = carry_tangents(engine, flow, nodes, none)
    given = _Given(flow.args.args, nodes.arrival, first, behind)
    program = _program(FlowKind.of(flow))
    request = Request(program, given, room=nodes.ends.room, stream=steps, quick=True)
    found = engine.run(request)
    assert found.records is not None
    return found.outputs, found.records


@bounded_cache(PROGRAMS)  # the same object each time, so that nothing is compiled again
def _program(kind: FlowKind) -> Program:
    return _Solve(kind.flow, Step.zero(kind.state.num_leaves, 0)).program()


class _Solve:
    """The functions of the program: its input stream's rows are steps, read backwards."""

    def __init__(self, flow: Callable[[_Given | FirstVariationInputs], Flow], step: Step) -> None:
        self.flow = flow
        row, self.read = ravel_pytree(step)
        self.size = len(row)

    def __fingerprint__(self) -> object:
        """See `jaxbiped.caching._fingerprint`: a row is read as one of a step of this size."""
        return self.flow, self.size

    def program(self) -> Program:
        parts = self.start, self.attempt, self.finish, self.record
        return Program(*parts, stream=self.size, backwards=True)

    def start(self, given: _Given) -> _Now:
        flow, row = self.flow(given), given.behind
        if isinstance(row, Arriving):
            row = _before_arrival(flow, given.arrival, row)
        none = jnp.zeros_like(row.parameters)
        return _Now(given.arrival[0], given.first.state, row, none, jnp.zeros(()))

    def attempt(self, given: _Given, now: _Now, row: Scalar) -> tuple[_Now, Scalar]:
        flow, step = self.flow(given), self.read(row)
        order, parameters = field_order(flow)
        rows = Rows(flow.rates, order, list(parameters), flow.margin)
        behind = jax.lax.cond(
            step.which > 0.0,
            lambda: _before_switch(flow, step, now.state, parameters, now.row),
            lambda: now.row,
        )
        stages = Stages.of(order, step.share, jax.lax.map(rows.by_state, step.points))
        nowhere = jnp.zeros(len(order.every))
        state, forcing = stages.pulled(jnp.stack([nowhere, nowhere, order.sorted(behind.state)]))
        points = jnp.concatenate([step.points, step.before[None]])
        weights = jnp.concatenate([forcing, state[None, order.direct :]])
        *forced, at_start = jax.lax.map(lambda each: rows.forced(*each), (points, weights))
        before = Row(order.restored(state), sum(forced, behind.parameters))
        steps, time = now.steps + 1.0, now.t - RADAU[2] @ step.share
        after = _Now(time, step.before, before, at_start, steps)
        return after, steps >= given.first.steps

    def finish(self, given: _Given, now: _Now) -> Row:
        return now.row

    def record(self, given: _Given, now: _Now, time: Scalar) -> tuple[Scalar, list[Scalar]]:
        """Time, state and row where a step starts, and what the row makes of the parameters."""
        return jnp.asarray(True), [now.t, now.state, now.row.state, now.forced]


def _before_arrival(flow: Flow, arrival: Scalar, behind: Arriving) -> Row:
    """The row at a fixed time before an arrival's reset."""
    _, parameters = field_order(flow)
    z = jnp.concatenate([flow.earlier(arrival, parameters)[1:], parameters])
    velocity = flow.velocity(z)
    c = len(velocity)

    def change(tangent: Scalar) -> Scalar:
        on_section = tangent_on_section(flow, z, tangent)
        later = (on_section - tangent)[:c] @ velocity / (velocity @ velocity)
        after = jax.jvp(flow.reset, (z,), (on_section,))[1]
        by_parameter = behind.row.parameters @ tangent[c:]
        return behind.row.state @ after + by_parameter + behind.by_time * later

    row = jax.grad(change)(jnp.zeros_like(z))
    return Row(row[:c], row[c:])


def _before_switch(flow: Flow, step: Step, begun: Scalar, parameters: Scalar, behind: Row) -> Row:
    """The row before the switch on which a step ends, and behind which the motion has `begun`."""
    landed, c = step.points[2], len(begun)
    z, after = (jnp.concatenate([y, parameters]) for y in (landed, begun))
    before = flow.velocity(z)
    onwards = begun + flow.margin * flow.velocity(after)
    rates = flow.velocity(jnp.concatenate([onwards, parameters]))
    resets = [surface.resets for surface in flow.surfaces(z)]
    row = jnp.concatenate([behind.state, jnp.zeros_like(parameters)])
    if any(resets):
        _, pull = jax.vjp(lambda z: flow.switched(z, step.which), z)
        is_reset = sum((step.which == 1.0 + k) * 1.0 for k, each in enumerate(resets) if each)
        row = jnp.where(is_reset > 0.0, pull(behind.state)[0], row)
    early = earlier_at(flow, landed, step.which, parameters)
    row = row - early * (row[:c] @ before - behind.state @ rates)
    return Row(row[:c], behind.parameters + row[c:])
