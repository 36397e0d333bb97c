"""First variation along a known motion in two directions, and the steps that it takes.

The adjoint solve reads these steps backwards, with all that it needs of the motion in them.

A tangent may hold much of the flow itself: where a parameter makes the motion later, it does. Of
that part the second tangents are known exactly, and yet it is the largest and changes fastest. So
at every step's start what a tangent has of the flow is taken out, which is only to read the motion
at other times.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import PyTree

from jaxbiped._types import Scalar, select
from jaxbiped.compiler import Program
from jaxbiped.variational._collocated_step import (
    KnownStep,
    Order,
    Rows,
    Stages,
    collocate_step,
    order_of,
)
from jaxbiped.variational._flow import Flow, crossing_of
from jaxbiped.variational._tangents import active_leaves

LONG_AGO = 1.0
"""Time [s] since the last switch, where none is known."""
SETTLED = 1e-9
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


class _Now(NamedTuple):
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

    def start(self, given: FirstVariationInputs) -> _Now:
        flow = self.flow(given)
        order, parameters = field_order(flow)
        node_row = flow.earlier(given.start, parameters)
        t, state = node_row[0], node_row[1:]
        none, zero = jnp.asarray(False), jnp.zeros(())
        return _Now(
            node=state,
            t=t,
            state=state,
            fresh=none,
            switched=t - LONG_AGO,
            leading=order.sorted(given.leading),
            read=zero,
            taken=zero,
            step=Step.zero(len(state), given.leading.shape[0]),
            ends=none,
        )

    def attempt(self, given: FirstVariationInputs, now: _Now, row: Scalar) -> tuple[_Now, Scalar]:
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
        rows = Rows(flow.rates, order, list(parameters))
        points, share, velocity = collocate_step(rows, known)
        stages = Stages.of(order, share, jax.lax.map(rows.by_state, points))
        begun, _ = without_flow(now.leading, order.sorted(velocity), now.fresh)
        after = _Now(
            node=node,
            t=end,
            state=crossing.landed,
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
        soon = (end - now.switched < SETTLED) & ~crossing.crossed & ~over
        waiting = now._replace(node=node, read=read, ends=jnp.asarray(False))
        return select(soon, waiting, after), over

    def record(
        self, given: FirstVariationInputs, now: _Now, time: Scalar
    ) -> tuple[Scalar, list[Scalar]]:
        """The steps."""
        return now.ends, [now.step.row()]

    def finish(self, given: FirstVariationInputs, now: _Now) -> FirstVariation:
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
    return order_of(flow.rates, state, parameters), jnp.stack(parameters)
