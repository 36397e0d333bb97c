"""Adjoint solve of the second variation along a known motion, by lanes."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree, PyTreeDef

from jaxbiped._caches import PROGRAMS, bounded_cache
from jaxbiped._types import Scalar
from jaxbiped.compiler import LANES, Program, Recording, Request
from jaxbiped.variational._adjoint_step import Adjoints, adjoint_step
from jaxbiped.variational._collocated_step import Rows, linearise_about
from jaxbiped.variational._first_variation import (
    FirstVariation,
    FirstVariationInputs,
    FirstVariationSolve,
    Step,
    field_order,
)
from jaxbiped.variational._flow import Arrival, Flow
from jaxbiped.variational._hybrid_system import AbstractSystem
from jaxbiped.variational._jets import Jet, reset_jet
from jaxbiped.variational._solve_to_section import Nodes
from jaxbiped.variational._switch_crossings import earlier_at
from jaxbiped.variational._tangents import Seeded

COUNT = 2
"""Leading tangents: a multiplier's eigenvector has a real and an imaginary part."""


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


def carry_tangents(flow: Flow, nodes: Nodes, leading: Scalar) -> tuple[FirstVariation, Recording]:
    """Leading tangents (v, c) carried along a motion to its arrival; and the steps of that."""
    given = FirstVariationInputs(flow.args.args, nodes.start, nodes.arrival, leading, nodes.steps)
    request = Request(
        _program(_kind(flow), None),
        given,
        room=nodes.ends.recorder.room,
        stream=nodes.ends,
        quick=True,
        keeps_records=True,
        reads_once=True,
    )
    found = LANES.run(request)
    assert found.recording is not None
    return found.outputs, found.recording


def pull_back(
    flow: Flow,
    nodes: Nodes,
    leading: FirstVariation,
    steps: Recording,
    after: Adjoints,
    *,
    final: bool,
) -> Adjoints:
    """Adjoints where a motion starts, from those behind its arrival.

    Args:
        flow: what moves.
        nodes: of the motion.
        leading, steps: from `carry_tangents` along it.
        after: adjoints behind the arrival.
        final: whether the cycle ends there: of that arrival tangents on the section are told.
    """
    given = _Given(flow.args.args, nodes.arrival, leading, after)
    request = Request(_program(_kind(flow), final), given, stream=steps, quick=True)
    adjoints: Adjoints = LANES.run(request).outputs
    return adjoints


class _Kind(NamedTuple):
    """What programs are compiled for."""

    system: AbstractSystem
    arrival: Arrival
    active: tuple[int, ...]
    state: PyTreeDef


def _kind(flow: Flow) -> _Kind:
    return _Kind(flow.system, flow.arrival, flow.args.active, flow.structure)


@bounded_cache(PROGRAMS)  # the same object each time, so that nothing is compiled again
def _program(kind: _Kind, final: bool | None) -> Program:
    """The program that carries leading tangents, or where `final` is given, that of adjoints."""
    # Compiled by itself, the field is traced once, not at each of its many uses.
    field = jax.jit(kind.system.vector_field)

    def flow(given: FirstVariationInputs | _Given) -> Flow:
        no_columns = jnp.zeros((0, 0))
        seeded = Seeded(given.args, no_columns, no_columns, kind.active)
        return Flow(kind.system, kind.arrival, field, seeded, kind.state)

    c = kind.state.num_leaves
    if final is None:
        return FirstVariationSolve(flow, 1 + c).program()
    return _AdjointSolve(flow, Step.shape(c, COUNT), final).program()


class _AdjointSolve:
    """The functions of the program: its input stream's rows are steps, read backwards."""

    def __init__(self, flow: Callable[[_Given], Flow], step: Step, final: bool) -> None:
        self.flow, self.step, self.final = flow, step, final

    def program(self) -> Program:
        """The program."""
        size = sum(leaf.size for leaf in jtu.tree_leaves(self.step))
        return Program(self.start, self.attempt, self.finish, stream=size, backwards=True)

    def start(self, given: _Given) -> _Now:
        """Adjoints before the arrival: all of it is linear in what is there."""
        flow = self.flow(given)
        order, parameters = field_order(flow)
        state = flow.earlier(given.arrival, parameters)[1:]
        z = jnp.concatenate([state, parameters])
        after = given.after

        def behind(before: Adjoints) -> tuple[Scalar, Scalar]:
            first = jnp.concatenate([given.leading.leading, before.family[None]]).T
            idle = jnp.zeros((COUNT, len(parameters)))
            seeds = jnp.concatenate([idle, before.parameters[None]]).T
            jet = Jet(first, before.second.T[:, None, :])
            found = reset_jet(flow, z, jet, seeds, COUNT, final=self.final)
            return found.first[:, COUNT], found.second[:, 0].T

        _, pull = jax.vjp(behind, jax.tree.map(jnp.zeros_like, after))
        (before,) = pull((after.family, after.second))
        adjoints = Adjoints(
            order.sorted(before.second),
            order.sorted(before.family),
            before.parameters + after.parameters,
        )
        return _Now(adjoints, given.leading.state, jnp.zeros(()))

    def attempt(self, given: _Given, now: _Now, row: Scalar) -> tuple[_Now, Scalar]:
        flow = self.flow(given)
        order, parameters = field_order(flow)
        step = Step.read(row, self.step)
        rows = Rows(flow.apart, order, list(parameters))
        crossed, ends = step.which > 0.0, (step.before, now.state)
        linear = linearise_about(rows, *ends, step.points, step.share, crossed)
        early = jax.lax.cond(
            crossed,
            lambda: earlier_at(flow, flow.surfaces, now.state, step.which, parameters),
            lambda: jnp.zeros(len(now.state) + len(parameters)),
        )
        before, count = adjoint_step(rows, linear, step, early, now.adjoints), now.count + 1.0
        return _Now(before, step.before, count), count >= given.leading.steps

    def finish(self, given: _Given, now: _Now) -> Adjoints:
        order, _ = field_order(self.flow(given))
        second, family, parameters = now.adjoints
        return Adjoints(order.restored(second), order.restored(family), parameters)
