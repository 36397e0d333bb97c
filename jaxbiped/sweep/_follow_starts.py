"""Following of starts until the label of each is certain: how far and accurately, by any engine.

All engines run these same functions, so that labels do not depend on the engine. Starts that lie
beyond a stop are recognised here, too.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import equinox.internal as eqxi
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
import numpy.typing as npt
from jaxtyping import PyTree

from jaxbiped._types import Parameter, Scalar, as_float, select
from jaxbiped.basins._labels import Label, label_names
from jaxbiped.caching._caches import PROGRAMS, bounded_cache
from jaxbiped.compiler import BY_NAME, DEVICES, Program, Request
from jaxbiped.dynamics._contacts import contact_places, slip_distances
from jaxbiped.dynamics._equivalent_states import images
from jaxbiped.dynamics._footfalls import any_of
from jaxbiped.dynamics._mode_changes import SLACK
from jaxbiped.dynamics._state import recurring_leaves
from jaxbiped.dynamics._surfaces import MidStance, straight_legs
from jaxbiped.scene._modes import limit_motions, rigid_modes
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.scene._state_types import State
from jaxbiped.solve._accuracy import units_of
from jaxbiped.solve._adaptive_program import AdaptiveSolve, Solve
from jaxbiped.solve._failure_events import WATCHES
from jaxbiped.solve._rigid_steps import (
    RigidProgress,
    RigidWalk,
    attempt_step,
    initial_progress,
    state_with_hip,
)
from jaxbiped.solve._saved_outputs import Saved, arrival_time
from jaxbiped.solve.controllers._wrapped_control import just_before_end
from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock
from jaxbiped.sweep._convergence_test import (
    UNDECIDED,
    ArrivalHistory,
    Goals,
    after_arrival,
    empty_history,
)
from jaxbiped.variational._grazing import grazes

_GAP = 1e-4
"""Gap between states that repeat each other, at least; see `after_arrival`."""
_LONGEST = 1e6
"""Simulated time [s] that no start takes: its footsteps or its patience end it before."""
_PATIENCE = 50.0
"""Longest time between two footsteps, in units of √(l/g)."""
_WHOLE: dict[str, type] = dict(
    label=np.int8,
    gait=np.int16,
    cycle_footsteps=np.int16,
    footsteps=np.int32,
    attempted=np.int32,
    grazes=np.int32,
)
"""Types of the fields of `Labelled` that hold whole numbers."""


class Start(NamedTuple):
    """One start's inputs; every leaf a 64-bit floating-point number, or an array of them.

    Attributes:
        solve: what to simulate: a `Solve` or a `RigidWalk`.
        goals: the gaits that it may converge to.
        gap: see `after_arrival`; 0 where recurrences are not looked for.
        patience: longest time between two footsteps [s].
    """

    solve: PyTree
    goals: Goals
    gap: Parameter
    patience: Parameter


class Labelled(NamedTuple):
    """Labels of n starts, with what led to them: NumPy arrays of shape (n,).

    Attributes:
        label: code of a `Label`.
        gait: position in `Family.cycles` of the gait that it converges to; −1 for none.
        cycle_footsteps: number of footsteps of that gait's cycle. If the label is "unresolved",
            that of a cycle that the last footsteps repeated, of a gait that is not among the
            attractors.
        footsteps: number of heel strikes until the label was certain.
        time: simulated time until then [s].
        distance: distance walked along the slope until then [m].
        rate: factor by which the distance from the gait changes per footstep, over the last cycle;
            NaN without a cycle, or if the distance is only rounding.
        closest: smallest distance from any of the gaits, in its metric; infinite without an
            arrival.
        attempted: number of steps that the solver attempted, in all solves of the start.
        final: last states on the section without `ROOT_x`, shape (n, m); infinite without an
            arrival.
        doubt, disagreed, changed: if the accuracy was a number, codes of `Doubt`, sums of codes of
            `Witness`, and whether finer tolerances changed the label; otherwise None.
        grazes: number of steps in which a foot touches the ground or misses it by less than the
            tolerance resolves, if the accuracy was a number and the walker is compliant.
    """

    label: np.ndarray
    gait: np.ndarray
    cycle_footsteps: np.ndarray
    footsteps: np.ndarray
    time: np.ndarray
    distance: np.ndarray
    rate: np.ndarray
    closest: np.ndarray
    attempted: np.ndarray
    final: np.ndarray
    doubt: np.ndarray | None = None
    disagreed: np.ndarray | None = None
    changed: np.ndarray | None = None
    grazes: np.ndarray | None = None

    @property
    def names(self) -> np.ndarray:
        """The labels in words, "walking period-1" and so on, shape (n,)."""
        return label_names(self.label, self.cycle_footsteps)


class Progress(NamedTuple):
    """What is carried from attempt to attempt.

    Attributes:
        solve: the solver's own.
        trace: see there.
        strike: time of the last footstep [s].
        landed: where each foot came down; see `slip_distances`. None for a rigid walker.
        grazes: steps that grazed so far; None where they are not counted.
    """

    solve: PyTree
    trace: ArrivalHistory
    strike: Scalar
    landed: tuple[Scalar, ...] | None
    grazes: Scalar | None = None


class CompliantLabelling:
    """Of the compliant walker, which arrives at mid-stance, on whichever leg.

    A walk begins, attempts steps until its label is certain, and finishes.

    Attributes:
        cycles: arrivals in a cycle of each known gait.
        steps: the solver's steps and endings.
        grazes: whether steps that graze are counted.
    """

    def __init__(
        self,
        solver: AbstractRosenbrock,
        cycles: tuple[int, ...],
        *,
        fenced: bool,
        grazes: bool = False,
    ) -> None:
        """`fenced`: whether XLA is to compile it."""
        self.cycles, self.grazes = cycles, grazes
        saved = Saved(times=True)  # the last step's continuous solution
        self.steps = AdaptiveSolve(solver, WATCHES, counting=True, saved=saved, fenced=fenced)

    def begin(self, start: Start) -> Progress:
        solve: Solve = start.solve
        zero = jnp.zeros_like(solve.duration)
        trace = empty_history(zero, len(solve.state) - 1, self.cycles)
        landed = contact_places(solve.scene, solve.state)
        count = jnp.zeros((), dtype=jnp.int64) if self.grazes else None
        return Progress(self.steps.start(solve), trace, zero, landed, count)

    def attempt(self, start: Start, now: Progress) -> tuple[Progress, Scalar]:
        """One attempted step further, and whether the label is certain (boolean)."""
        solve: Solve = start.solve
        after, over = self.steps.attempt(solve, now.solve)
        _, _, before_count = now.solve.control
        _, _, count = after.control
        strike = jnp.where(count > before_count, after.t, now.strike)
        trace = self._traced(start, now, after)
        assert now.landed is not None
        landed, slid = slip_distances(solve.scene, after.state, now.landed)
        late = after.t - strike > start.patience
        verdict = jnp.where(late, int(Label.TIMED_OUT), trace.verdict)
        verdict = jnp.where(slid > solve.scene.mechanism.height, int(Label.SLID), verdict)
        trace = trace._replace(verdict=verdict)
        count = now.grazes
        if count is not None:
            span = after.t - now.solve.t
            grazed = grazes(solve.scene, span, now.solve.state, after.state, solve.rtol)
            count = count + jnp.where(grazed, 1, 0)
        return Progress(after, trace, strike, landed, count), over | (verdict != UNDECIDED)

    def finish(self, start: Start, now: Progress) -> Labelled:
        solved = self.steps.finish(start.solve, now.solve)
        _, _, count = now.solve.control
        return _outcome(
            now.trace,
            code=solved.ending,
            footsteps=count,
            time=solved.t,
            distance=solved.state[0] - start.solve.state[0],
            attempted=solved.accepted + solved.rejected,
            grazes=now.grazes,
        )

    def _traced(self, start: Start, now: Progress, after: PyTree) -> ArrivalHistory:
        """After the last step, within which it may have arrived at mid-stance."""
        scene, last, section = start.solve.scene, after.last, MidStance()

        came = []
        for (_, old), (_, new) in zip(
            images(scene, last.state), images(scene, after.state), strict=True
        ):
            crosses = (section.value(scene, old) < 0.0) & (section.value(scene, new) >= 0.0)
            came.append(crosses & section.counts(scene, new))
        arrives = last.noted & any_of(came)
        dense = last.course(self.steps.solver, after.t, after.state)

        def at(time: Scalar) -> State:
            *others, (_, state) = images(scene, dense.evaluate(time))
            for here, (_, image) in zip(came, others, strict=False):
                pairs = zip(image, state, strict=True)
                state = type(state)(*[jnp.where(here, a, b) for a, b in pairs])
            return state

        def on_section() -> State:
            return at(arrival_time(lambda time: section.value(scene, at(time)), last.t, after.t))

        return _after_arrival(start, now, arrives, on_section, self.cycles)


class RigidLabelling:
    """Of the rigid walker, which arrives just after its impacts; as `CompliantLabelling`.

    Attributes:
        cycles: arrivals in a cycle of each known gait.
        embedded: see `rolling_step`.
        grazes: whether heel strikes that graze are told.
    """

    def __init__(self, cycles: tuple[int, ...], *, embedded: bool, grazes: bool = False) -> None:
        self.cycles, self.embedded, self.grazes = cycles, embedded, grazes

    def begin(self, start: Start) -> Progress:
        walk: RigidWalk = start.solve
        zero = jnp.zeros_like(walk.duration)
        trace = empty_history(zero, len(walk.state) - 1, self.cycles)
        return Progress(initial_progress(walk), trace, zero, None)

    def attempt(self, start: Start, now: Progress) -> tuple[Progress, Scalar]:
        # A step behind a fall tells its side, unless legs that bend may change it.
        bends = straight_legs(start.solve.scene.mechanism) is None
        after, over = attempt_step(
            start.solve, now.solve, embedded=self.embedded, lands_on_falls=bends
        )
        trace = _after_arrival(start, now, after.struck, lambda: after.state, self.cycles)
        strike = jnp.where(after.struck, after.t, now.strike)
        late = after.t - strike > start.patience
        verdict = jnp.where(late, int(Label.TIMED_OUT), trace.verdict)
        trace = trace._replace(verdict=verdict)
        return Progress(after, trace, strike, None), over | (verdict != UNDECIDED)

    def finish(self, start: Start, now: Progress) -> Labelled:
        walked: RigidProgress = now.solve
        return _outcome(
            now.trace,
            code=walked.code,
            footsteps=walked.footsteps,
            time=walked.t,
            distance=state_with_hip(start.solve, walked)[0] - start.solve.state[0],
            attempted=walked.accepted + walked.rejected,
            grazes=walked.grazes if self.grazes else None,
        )


def _outcome(trace: ArrivalHistory, *, code: Scalar, **walked: Any) -> Labelled:
    """A failure is certain; all footsteps walked without a verdict are not."""
    kind = trace.verdict.dtype
    spent = (code == int(Label.WALKING)) | (code == int(Label.OUT_OF_STEPS))
    plain = jnp.where(code == int(Label.WALKING), int(Label.UNRESOLVED), code).astype(kind)
    label = jnp.where(spent & (trace.verdict != UNDECIDED), trace.verdict, plain)
    walks = label == int(Label.WALKING)
    converges = walks | (label == int(Label.UNRESOLVED))
    certain: dict[str, Any] = dict(
        label=label,
        gait=jnp.where(walks, trace.goal, -1),
        cycle_footsteps=jnp.where(converges, trace.cycle_footsteps, 0),
        rate=trace.rate,
        closest=trace.closest,
        final=trace.recent[0],
    )
    return Labelled(**certain, **walked)


def _after_arrival(
    start: Start,
    now: Progress,
    arrives: Scalar,
    state: Callable[[], PyTree],
    cycles: tuple[int, ...],
) -> ArrivalHistory:
    """The trace after an arrival, if there is one; made only if any start of the batch has one."""
    old = now.trace

    def made() -> ArrivalHistory:
        recurring = tuple(recurring_leaves(state()))
        new = after_arrival(old, recurring, start.goals, cycles, start.gap, start.solve.rtol)
        return select(arrives, new, old)

    trace: ArrivalHistory = jax.lax.cond(eqxi.unvmap_any(arrives), made, lambda: old)
    return trace


class Effort(NamedTuple):
    """How starts are followed. All hashable.

    Attributes:
        rtol: relative tolerance; the absolute one is a hundredth of it in the scene's units.
        footsteps: after which a start that is not certain is given up.
        max_attempts: cap on the solver's attempted steps.
        gap_share: the gap in units of the tolerance; 0 where recurrences are not looked for.
        solver: of the compliant walker.
        engine: "lanes", "cuda" or "xla".
        may_move: whether large batches go from lanes to a CUDA device where there is one.
        wanted: share of the labels that may be wrong; None where the tolerance decides.
        embedded: whether the rigid walker steps by the embedded method; see `rolling_step`.
    """

    rtol: float
    footsteps: int
    max_attempts: int
    gap_share: float
    solver: AbstractRosenbrock
    engine: str
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
    scene: Scene | RigidScene,
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
    waits = _PATIENCE * np.sqrt(np.asarray(scene.mechanism.height) / np.asarray(scene.ground.g))
    arrivals = tuple(max(length // each, 1) for length in cycles)
    # Labels by a number may doubt what grazes.
    counted = effort.wanted is not None
    if not count:
        none = np.zeros(0)
        final: Any = (none,) * (len(states) - 1)
        plain = Labelled(*[*[none] * 9, final])
        return _as_arrays(plain._replace(grazes=none if counted else None))

    def same(value: npt.ArrayLike) -> np.ndarray:
        return np.broadcast_to(np.asarray(value, dtype=np.float64), (count,))

    common = dict(
        scene=jtu.tree_map(same, scene),
        state=states,
        duration=same(_LONGEST),
        footsteps=same(effort.footsteps),
        rtol=same(effort.rtol),
        max_attempts=same(effort.max_attempts),
    )
    solve: Solve | RigidWalk | None = None
    if not scene.compliant:
        solve = RigidWalk(**common)
    else:
        last = same(just_before_end(as_float(_LONGEST)))
        atol = same(1e-2 * effort.rtol)
        units = jtu.tree_map(same, units_of(scene, states))
        solve = Solve(**common, almost=last, atol=atol, units=units, patience=same(np.inf))
    starts = Start(solve, goals, same(effort.gap), same(waits))
    embedded = effort.embedded and not scene.compliant
    fenced = effort.engine == "xla"
    program = _program(scene.compliant, effort.solver, arrivals, fenced, embedded, counted)
    engine = BY_NAME[effort.engine_of(count)]
    given = jtu.tree_map(np.asarray, starts)
    found = _as_arrays(engine.run(Request(program, given, batch=True)).outputs)
    if each == 1:
        return found
    footsteps = (each * found.cycle_footsteps).astype(found.cycle_footsteps.dtype)
    return found._replace(cycle_footsteps=footsteps, rate=found.rate ** (1.0 / each))


@bounded_cache(PROGRAMS)  # the same object each time, so that nothing is compiled again
def _program(
    compliant: bool,
    solver: AbstractRosenbrock,
    cycles: tuple[int, ...],
    fenced: bool,
    embedded: bool,
    grazes: bool,
) -> Program:
    loop: CompliantLabelling | RigidLabelling
    if compliant:
        loop = CompliantLabelling(solver, cycles, fenced=fenced, grazes=grazes)
    else:
        loop = RigidLabelling(cycles, embedded=embedded, grazes=grazes)
    return Program(loop.begin, loop.attempt, loop.finish)


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


def passes_a_stop(scene: Any, values: Mapping[str, Any], *, by: float = SLACK) -> np.ndarray:
    """Whether states by name, arrays of shape (n,), lie beyond a stop by so much [rad]."""
    angle = scene.mechanism.structure.coordinates[2]
    passed = np.zeros(np.shape(values[angle]), dtype=bool)
    if not scene.compliant:
        mechanism, slope = scene.mechanism, scene.ground.slope
        for gap, _ in limit_motions(mechanism, rigid_modes(mechanism), slope, values):
            passed = passed | (np.asarray(gap) < -by)
    return passed
