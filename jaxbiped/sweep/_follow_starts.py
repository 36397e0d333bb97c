"""Following of starts until the label of each is certain: how far and accurately, by any engine.

All engines run these same functions, so that labels do not depend on the engine.
"""

from typing import Any, NamedTuple

import jax.tree_util as jtu
import numpy as np
import numpy.typing as npt
from jaxtyping import PyTree

from jaxbiped.compiler import BY_NAME, DEVICES, Request
from jaxbiped.dynamics._state import recurring_names
from jaxbiped.hybrid._landing_system import AbstractLandingSystem
from jaxbiped.hybrid._sections import AbstractSection
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.scene._scene import AbstractScene
from jaxbiped.solve._adaptive_program import AdaptiveSolve
from jaxbiped.solve._explicit_methods import ExplicitMethod
from jaxbiped.solve._landing_program import LandingSolve
from jaxbiped.solve._landing_steps import EndingWatch
from jaxbiped.solve._recorders import program_of
from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock
from jaxbiped.sweep._convergence_test import Goals
from jaxbiped.sweep._label_recorders import (
    ArrivalLabelRecorder,
    Labelled,
    LabelRecorder,
    Pursuit,
    StrikeLabelRecorder,
)

_GAP = 1e-4
"""Gap between states that repeat each other, at least; see `after_arrival`."""
_LONGEST = 1e6
"""Simulated time that no start takes, in units of its patience: that or its footsteps end it
before."""
_WHOLE: dict[str, type] = dict(
    label=np.int8,
    gait=np.int16,
    cycle_footsteps=np.int16,
    footsteps=np.int32,
    attempted=np.int32,
    grazes=np.int32,
)
"""Types of the fields of `Labelled` that hold whole numbers."""


class Effort(NamedTuple):
    """How starts are followed. All hashable.

    Attributes:
        rtol: relative tolerance; the absolute one is a hundredth of it in the scene's units.
        footsteps: after which a start that is not certain is given up; arrivals of a hybrid system.
        max_attempts: cap on the solver's attempted steps.
        gap_share: the gap in units of the tolerance; 0 where recurrences are not looked for.
        solver: where rates may be stiff.
        engine: "lanes", "cuda" or "xla".
        section: where they arrive.
        may_move: whether large batches go from lanes to a CUDA device where there is one.
        wanted: share of the labels that may be wrong; None where the tolerance decides.
        embedded: whether steps are those of the embedded method where rates are smooth.
    """

    rtol: float
    footsteps: int
    max_attempts: int
    gap_share: float
    solver: AbstractRosenbrock
    engine: str
    section: AbstractSection
    wanted: float | None = None
    embedded: bool = False
    may_move: bool = False

    @property
    def gap(self) -> float:
        """Between states that repeat each other; see `after_arrival`."""
        return max(_GAP, self.gap_share * self.rtol) if self.gap_share else 0.0

    @property
    def may_use_device(self) -> bool:
        """Whether a CUDA device may follow them."""
        moves = self.may_move and self.engine == "lanes" and DEVICES.hindrance() is None
        return moves or self.engine == "cuda"

    def engine_of(self, count: int) -> str:
        """The engine that follows `count` starts: large batches go where a device is kept busy."""
        return "cuda" if self.may_use_device and DEVICES.fills(count) else self.engine


def follow_starts(
    scene: AbstractScene,
    states: PyTree,
    goals: Goals,
    cycles: tuple[int, ...],
    effort: Effort,
) -> Labelled:
    """Follows n starts; leaves of states and goals are NumPy's arrays (n, …), of the scene too, or
    numbers of all starts.

    `cycles` are footsteps in the cycles of the goals.
    """
    count, each = len(states[0]), scene.arrival_footsteps
    arrivals = tuple(max(length // each, 1) for length in cycles)
    if not count:
        none = np.zeros(0)
        final: Any = (none,) * len(recurring_names(states))
        plain = Labelled(*[*[none] * 9, final])
        return _as_arrays(plain._replace(grazes=None if effort.wanted is None else none))

    def same(value: npt.ArrayLike) -> np.ndarray:
        return np.broadcast_to(np.asarray(value, dtype=np.float64), (count,))

    waits = np.asarray(system_of(scene).longest_wait(scene))
    steps = _steps(scene, effort, arrivals)
    start = steps.inputs(
        scene,
        states,
        duration=_LONGEST * waits,
        footsteps=effort.footsteps,
        rtol=effort.rtol,
        max_attempts=effort.max_attempts,
    )
    pursuit = Pursuit(goals, same(effort.gap), same(waits))
    given = jtu.tree_map(same, start)._replace(recording=pursuit)
    program = program_of(steps)
    engine = BY_NAME[effort.engine_of(count)]
    found = _as_arrays(engine.run(Request(program, given, batch=True)).outputs)
    if each == 1:
        return found
    footsteps = (each * found.cycle_footsteps).astype(found.cycle_footsteps.dtype)
    return found._replace(cycle_footsteps=footsteps, rate=found.rate ** (1.0 / each))


def _steps(
    scene: AbstractScene, effort: Effort, cycles: tuple[int, ...]
) -> LandingSolve | AdaptiveSolve:
    """The functions of the program that labels starts. Labels by a number may doubt what grazes."""
    system, section, grazes = system_of(scene), effort.section, effort.wanted is not None
    if isinstance(system, AbstractLandingSystem):
        return LandingSolve(
            system=system,
            recorder=StrikeLabelRecorder(section, cycles, grazes),
            method=ExplicitMethod(embedded=effort.embedded),
            endings=EndingWatch.INTERPOLATED,
            counts_pulls=False,
        )
    counting = section.names_legs
    recorder = LabelRecorder if counting else ArrivalLabelRecorder
    return AdaptiveSolve(
        system=system,
        stepper=effort.solver,
        watch=system.watches,
        counting=counting,
        recorder=recorder(section, cycles, grazes),
        located=system.lands,
        fenced=effort.engine == "xla",
    )


def _as_arrays(found: Labelled) -> Labelled:
    """Of an engine's outputs, columns of the right types."""
    columns = found._replace(final=np.stack(list(found.final), axis=1))._asdict()
    arrays: dict[str, Any] = {
        name: None if column is None else column.astype(_WHOLE.get(name, float), copy=False)
        for name, column in columns.items()
    }
    return Labelled(**arrays)


def broadcast_leaves(tree: PyTree, count: int) -> PyTree:
    """The tree with every leaf repeated along a new first axis, without copies of it."""

    def repeat(leaf: npt.ArrayLike) -> np.ndarray:
        array = np.asarray(leaf, dtype=np.float64)
        return np.broadcast_to(array, (count, *array.shape))

    return jtu.tree_map(repeat, tree)
