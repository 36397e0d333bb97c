"""Saved outputs of a solve by lanes, and how they are found within a step."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar, select
from jaxbiped.dynamics._section import AbstractSection
from jaxbiped.dynamics._state import State, exchange_legs
from jaxbiped.scene._scene import Scene
from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock, RosenbrockInterpolation

_BISECTIONS = 50


class LastStep(NamedTuple):
    """The last attempt: when it began, its dense output, and whether it is of note.

    It is where it was accepted, or where there is a section, where it ended past an arrival there.
    `changed` is whether the legs' names are exchanged for the next arrival.
    """

    noted: Scalar
    changed: Scalar
    t: Scalar
    state: State
    coefficients: tuple[State, ...]


class Saved(NamedTuple):
    """What a program saves of a simulation, besides its end. All hashable.

    Attributes:
        steps: whether it records the end and the dense output of every accepted step.
        times: whether it records the state at the times of a schedule.
        section: where it does; None: nowhere.
        extremes: a function of (scene, state) whose extremes over the steps' ends are wanted, or
            None.
    """

    steps: bool = False
    times: bool = False
    section: AbstractSection | None = None
    extremes: Callable[[Scene, State], PyTree] | None = None

    @property
    def within(self) -> bool:
        """Whether anything is saved from within the steps."""
        return self.steps or self.times or self.section is not None

    def first(self, state: State, solver: AbstractRosenbrock) -> LastStep:
        """What is known before the first attempt."""
        zero, none = jnp.zeros_like(state[0]), jnp.asarray(False)
        nothing = jtu.tree_map(jnp.zeros_like, state)
        rows = len(solver.tableau.dense)
        return LastStep(none, jnp.asarray(True), zero, nothing, tuple([nothing] * rows))

    def following(
        self,
        scene: Scene,
        last: LastStep,
        *,
        began: tuple[Scalar, State],
        ended: State,
        keep: Scalar,
        moving: Scalar,
        dense: tuple[State, ...],
    ) -> LastStep:
        """What is known after an attempt.

        `keep` is whether it was accepted, and `moving` whether any was before.
        """
        t, start = began
        changed, noted = last.changed, keep
        if self.section is not None:
            before, after = (_with_leg_names(changed, y) for y in (start, ended))
            rises = self.section.value(scene, before) < 0.0
            rises = rises & (self.section.value(scene, after) >= 0.0)
            # The first step of a solve never counts, so it may start on its section.
            noted = keep & moving & rises & self.section.counts(scene, after)
            changed = changed ^ noted
        return LastStep(noted, changed, t, start, dense)

    def record(
        self,
        scene: Scene,
        last: LastStep,
        *,
        now: tuple[Scalar, State],
        due: Scalar,
        solver: AbstractRosenbrock,
    ) -> tuple[Scalar, list[Scalar]]:
        """The step itself, the state at a time due within it, or at its arrival at the section."""
        t, state = now
        if self.steps:
            rows = [value for row in last.coefficients for value in row]
            return last.noted, [t, *state, *rows]
        dense = solver.interpolation_cls(
            t0=last.t, t1=t, y0=last.state, y1=state, coefficients=last.coefficients
        )
        if self.section is None:
            return last.noted & (due <= t), [due, *dense.evaluate(due)]
        nothing = [jnp.zeros_like(t)] * (1 + len(state))
        return last.noted, jax.lax.cond(
            last.noted, lambda: self._arrival(scene, last, dense), lambda: nothing
        )

    def _arrival(
        self, scene: Scene, last: LastStep, dense: RosenbrockInterpolation
    ) -> list[Scalar]:
        section = self.section
        assert section is not None

        # The names that the arrival went by: they have been exchanged since.
        def value(state: State) -> Scalar:
            return section.value(scene, _with_leg_names(~last.changed, state))

        def halve(_: Scalar, ends: tuple[Scalar, Scalar]) -> tuple[Scalar, Scalar]:
            middle = 0.5 * (ends[0] + ends[1])
            before = value(dense.evaluate(middle)) < 0.0
            return jnp.where(before, middle, ends[0]), jnp.where(before, ends[1], middle)

        time = jax.lax.fori_loop(0, _BISECTIONS, halve, (dense.t0, dense.t1))[1]
        return [time, *dense.evaluate(time)]


def _with_leg_names(changed: Scalar, state: State) -> State:
    """The state with its legs' names exchanged, where they are."""
    return select(changed, exchange_legs(state), state)
