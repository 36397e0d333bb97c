"""Walk of the rigid walker: a checked request, which either engine runs."""

import dataclasses
import functools
from collections.abc import Callable
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import (
    ArgumentError,
    check_choice,
    check_positive,
    check_room,
    check_unbatched,
    traced_rules,
)
from jaxbiped._types import Scalar, as_float, by_numpy, is_traced
from jaxbiped.compiler import BY_NAME, Request
from jaxbiped.dynamics._state import check_state, without_whole_turns
from jaxbiped.hybrid._mode_history import history_of
from jaxbiped.hybrid._rolling_system import Rolling
from jaxbiped.hybrid._sections import AbstractSection, HeelStrike, check_section_body
from jaxbiped.scene._ground import check_pulls
from jaxbiped.scene._modes import check_mode, rigid_modes
from jaxbiped.scene._scene import RigidScene
from jaxbiped.scene._scene_checks import check_scene, where_allowed
from jaxbiped.simulate._backends import recorder_for
from jaxbiped.simulate._derivatives import Slopes, rigid_slopes_of, with_derivatives
from jaxbiped.simulate._start import (
    Options,
    check_limits,
    check_single_scene,
    check_steps,
    check_times,
    in_one_precision,
    in_own_precision,
    watched_by,
)
from jaxbiped.simulate._trajectory import Trajectory, arrivals_among, scene_key, single_time
from jaxbiped.solve._accuracy import ACCURACIES
from jaxbiped.solve._engine_names import engine_for
from jaxbiped.solve._explicit_methods import EXPLICIT_METHODS, ExplicitMethod
from jaxbiped.solve._landing_program import LandingSolve
from jaxbiped.solve._landing_steps import EndingWatch, Landing
from jaxbiped.solve._recorders import (
    AbstractRecorder,
    ArrivalRecorder,
    StrikeRecorder,
    program_of,
)
from jaxbiped.solve._solved import Solved
from jaxbiped.solve._step_records import landing_record

_ROOM = 256
"""Heel strikes that there is room for where it is not known how many come."""
_ROWS = 64
"""Changes of mode that there is room for beside heel strikes."""
_STEPS = 1 << 14
"""Steps that there is room for at first; a walk of more runs again, with room for as many."""
_FIRST = 1e-1
"""First tolerance as a share of the relative error wanted."""
_EMBEDDED = 0.3
"""Tolerance of the embedded method's witness over the walk's: its errors are those that the
tolerance bounds, which the walk's are 10 to 30 times below."""
_LOOSEST = 1e-3
"""Loosest tolerance to begin with."""
_PATIENCE = 50.0
"""Time allowed for each footstep, in units of √(l/g)."""


class RigidSimulation(eqx.Module):
    """A prepared rigid walk. Call it for its trajectory.

    Attributes:
        walk: the program's inputs.
        waits: whether the duration only bounds the wait for footsteps.
        method: its steps.
        watch: as in `simulate`.
        times: times at which to save [s], shape (n,), or None.
        save_steps: whether every step is saved.
        section: where arrivals are saved, or None.
        room: how many of these, or of the steps, to keep.
        extremes: as in `simulate`.
        engine: "lanes", "cuda" or "xla".
        finest_tolerance: finest relative tolerance to which its error is refined: rolling is smooth
            and never stiff.
    """

    finest_tolerance: ClassVar[float] = 1e-13
    walk: Landing
    waits: bool = eqx.field(static=True)
    method: ExplicitMethod = eqx.field(static=True)
    watch: tuple[str, ...] = eqx.field(static=True)
    times: np.ndarray | None
    save_steps: bool = eqx.field(static=True)
    section: AbstractSection | None = eqx.field(static=True)
    extremes: Callable[..., PyTree] | None = eqx.field(static=True)
    room: int = eqx.field(static=True)
    engine: str = eqx.field(static=True)

    @staticmethod
    def of(scene: RigidScene, state: Any, asked: Options) -> "RigidSimulation":
        """Checks what is asked, and forms it."""
        asked.refuse(scene, "atol", "adjoint")
        method = _method_of(asked)
        section, duration, footsteps = asked.section, asked.duration, asked.footsteps
        if isinstance(asked.save, str):
            check_choice("save", asked.save, ("steps", "end"))
        check_limits(duration, footsteps, asked.max_solver_steps)
        with traced_rules() as rules:
            scene = check_scene(scene, RigidScene)
            state = check_state(in_own_precision(state), scene.state_type)
            state = in_one_precision(without_whole_turns(scene, state))
            check_single_scene(scene)
            check_section_body(scene, section)
            check_unbatched("state", state, "one start")
            if (modes := rigid_modes(scene.mechanism)).any:
                check_mode(scene.mechanism, modes, scene.ground.slope, state)
            longest: Any = duration
            if duration is None:
                check_pulls(scene.ground)
                longest = by_numpy(
                    lambda numpy, l, g: footsteps * (_PATIENCE * numpy.sqrt(l / g)),
                    scene.mechanism.height,
                    scene.ground.g,
                )
            else:
                check_positive("duration", duration, "s")
            usual = ACCURACIES[asked.accuracy].rigid_walk
            tolerance = usual if asked.rtol is None else asked.rtol
            check_positive("rtol", tolerance)
            check_steps(None, asked.dt, most_steps=asked.max_solver_steps, duration=longest)
        # Of a lane that is not allowed nothing is known from the start.
        state, longest = where_allowed(rules, state), where_allowed(rules, longest, 1.0)
        watched_by(scene, asked.watch)
        check_room("max_arrivals", asked.max_arrivals)
        dtype = state[0].dtype
        narrow = "it computes in 64 bits" if dtype != jnp.float64 else None
        if asked.times is not None:
            check_times(asked.times, longest)

        def cast(leaf: Any) -> Scalar:
            return as_float(leaf).astype(dtype)

        # In the precision of the start, as a compliant walk has it. A scene that is formed anew
        # makes its mechanism anew.
        scene = scene if narrow is None else jtu.tree_map(cast, scene)
        engine = _engine_for(asked, narrow)
        return RigidSimulation(
            Landing(
                scene=scene,
                state=state,
                duration=cast(longest),
                footsteps=cast(footsteps or 0),
                rtol=cast(tolerance),
                max_attempts=cast(asked.max_solver_steps),
                dt=None if asked.dt is None else cast(asked.dt),
            ),
            waits=duration is None,
            method=method,
            watch=tuple(asked.watch),
            times=None if asked.times is None else np.asarray(asked.times, dtype=float),
            save_steps=asked.save_steps,
            section=section,
            extremes=asked.extremes,
            room=asked.room,
            engine=engine,
        )

    @property
    def scene(self) -> RigidScene:
        """What walks."""
        return self.walk.scene

    @property
    def rtol(self) -> Scalar:
        """Relative tolerance."""
        return self.walk.rtol

    @property
    def duration(self) -> Scalar:
        """Longest simulated time [s]."""
        return self.walk.duration

    @property
    def dt(self) -> Scalar | None:
        """Size of all steps [s], or None."""
        return self.walk.dt

    @property
    def max_solver_steps(self) -> int:
        """As in `simulate`, where it is known."""
        return int(self.walk.max_attempts)

    def with_steps(self, dt: Scalar) -> "RigidSimulation":
        """The same with steps of another fixed size [s]."""
        return dataclasses.replace(self, walk=self.walk._replace(dt=dt))

    def at_tolerance(self, rtol: float) -> "RigidSimulation":
        """The same at another relative tolerance."""
        changed = as_float(rtol).astype(self.rtol.dtype)
        return dataclasses.replace(self, walk=self.walk._replace(rtol=changed))

    def saving_strikes(self, room: int) -> "RigidSimulation":
        """The same, of which so many heel strikes are saved and nothing else."""
        section = HeelStrike() if room else None
        return dataclasses.replace(
            self,
            times=None,
            save_steps=False,
            section=section,
            extremes=None,
            room=room,
        )

    def by_other_method(self) -> tuple["RigidSimulation", float, float]:
        """The same by another method; its tolerance in units of the walk's, and its weight."""
        if self.method == ExplicitMethod():
            return dataclasses.replace(self, method=ExplicitMethod(embedded=True)), _EMBEDDED, 1.0
        return dataclasses.replace(self, method=ExplicitMethod()), 1.0, 1.0

    def first_tolerance(self, wanted: float) -> float:
        """The relative tolerance to begin with where this relative error is wanted."""
        return min(_FIRST * wanted, _LOOSEST)

    def __call__(self) -> Trajectory[Any]:
        """Solves it, differentiably."""
        walk = with_derivatives(self, RigidSimulation.solved, moving=_moving, slopes=_slopes)
        return dataclasses.replace(walk, scene_key=scene_key(self.walk.scene))

    def solved(self) -> Trajectory[Any]:
        """Solves it."""
        scene, state = self.scene, self.walk.state
        moded = rigid_modes(scene.mechanism).any
        recorder = self._recorder(moded)
        strikes = isinstance(recorder, StrikeRecorder)
        solved, rows, total = self._run(
            recorder, _ROWS + 8 * self.room if moded and strikes else self.room
        )
        (t, told), dense = single_time(solved.t, solved.state), None
        arrivals, changes = arrivals_among(self._no_rows, solved.footsteps, state), (rows, total)
        if self.save_steps:
            record = landing_record(Rolling(), scene, state, rows, total)
            t, told, dense, changes = record.t, record.state, record.dense, record.resets
            arrivals = arrivals_among(record.strikes, solved.footsteps, state)
        elif self.times is not None:
            _, t, told = arrivals_among(rows, total, state)
        elif isinstance(recorder, ArrivalRecorder):
            arrivals = arrivals_among(rows, total, state)
        elif self.room:
            if moded:
                rows = by_numpy(functools.partial(_first_strikes, count=self.room), rows)
            arrivals = arrivals_among(rows, solved.footsteps, state)
        history = None
        if moded:
            if not strikes and not self.save_steps:  # such rows tell no modes
                changes = self._run(StrikeRecorder(strikes=False), _ROWS)[1:]
            assert solved.begin is not None
            history = history_of(scene, solved.begin, *changes)
        return Trajectory(
            t=t,
            state=told,
            dense=dense,
            arrivals=arrivals,
            mode_history=history,
            engine=self.engine,
            **solved.outcome,
        )

    @property
    def _no_rows(self) -> np.ndarray:
        return np.zeros((0, 1 + len(self.walk.state)), self.rtol.dtype)

    def _recorder(self, moded: bool) -> AbstractRecorder | None:
        at_strikes = isinstance(self.section, HeelStrike)
        recorder = None if at_strikes else recorder_for(self)
        if recorder is None and (moded or at_strikes):
            return StrikeRecorder(strikes=self.room > 0)
        return recorder

    def _run(self, recorder: AbstractRecorder | None, room: int) -> tuple[Solved, Any, Any]:
        """What is solved, the rows that are recorded, and how many there were."""
        endings = EndingWatch.LOCATED if "fall" in self.watch else EndingWatch.IGNORED
        steps = LandingSolve(
            system=Rolling(),
            recorder=recorder,
            extremes=self.extremes,
            waits=self.waits,
            method=self.method,
            endings=endings,
        )
        scheduled = recorder is not None and recorder.scheduled
        request = Request(
            program_of(steps),
            self.walk,
            room=0 if scheduled else room,
            times=self.times if scheduled else None,
            quick=True,
        )
        if self.save_steps and not is_traced(self.walk):
            request = request._replace(room=min(room, _STEPS))
        solved, recorded, _ = BY_NAME[self.engine].run(request)
        if recorded is None:
            return solved, self._no_rows, 0
        total = recorded.counts
        if self.save_steps and not is_traced(total):
            if int(total) > request.room:
                # Memory is asked for by what a solve takes, not by what it might.
                _, recorded, _ = BY_NAME[self.engine].run(request._replace(room=int(total)))
                assert recorded is not None
            return solved, recorded.values[: int(total)], total
        return solved, recorded.values, total


def _method_of(asked: Options) -> ExplicitMethod:
    """The explicit method that is asked for; by default the one of order eight.

    Raises:
        ArgumentError: another solver, or steps under error control by a method without an estimate.
    """
    solver = asked.solver
    if isinstance(solver, str) and solver == Options._field_defaults["solver"]:
        return ExplicitMethod()
    names = {kind: name for name, kind in EXPLICIT_METHODS.items()}
    name = solver if isinstance(solver, str) else names.get(type(solver))
    if name not in EXPLICIT_METHODS:
        raise ArgumentError(
            f"solver = {solver!r} is not allowed for a RigidScene, whose motion between impacts is "
            f"smooth and never stiff: choose one of {', '.join(EXPLICIT_METHODS)}."
        )
    method = ExplicitMethod(name)
    if asked.dt is None and not method.estimates:
        raise ArgumentError(
            f"dt = None is not allowed for solver = {name}, whose steps have a fixed size: "
            "give it in seconds."
        )
    return method


def _engine_for(asked: Options, narrow: str | None) -> str:
    """The engine, which must be able to save what is asked.

    Raises:
        ArgumentError: times that are not known beforehand, or a section that holds numbers.
    """
    engine = engine_for(asked.engine, obstacle=narrow, by_device=True, by_any=True)
    obstacle = None
    if asked.section is not None and jtu.tree_leaves(asked.section):
        obstacle = f"the section {type(asked.section).__name__} holds numbers of its own"
    if asked.times is not None and is_traced(asked.times):
        obstacle = "the times to save at must be known beforehand"
    if obstacle is not None:
        raise ArgumentError(f"save = {asked.save!r} is not allowed here: {obstacle}.")
    return engine


def _first_strikes(numpy: Any, rows: Any, count: int) -> Any:
    """So many rows, those of heel strikes first, in their order and without the flag."""
    order = numpy.argsort(rows[:, 1] == 0.0, stable=True)[:count]
    return numpy.concatenate([rows[:, :1], rows[:, 2:]], axis=1)[order]


def _moving(run: RigidSimulation) -> tuple[PyTree, PyTree, PyTree]:
    return run.walk.state, run.walk.scene, run.walk.duration


def _slopes(
    run: RigidSimulation,
    found: Trajectory[Any],
    places: tuple[int, ...],
    active: tuple[int, ...],
) -> Slopes:
    assert found.arrivals is not None
    strikes_saved = run.times is None and (
        run.section is None or isinstance(run.section, HeelStrike)
    )
    count, kept, strikes = found.arrivals.total, run.room, found.arrivals.t
    if not strikes_saved:
        plain: RigidSimulation = jax.lax.stop_gradient(run.saving_strikes(0))
        again = plain.solved().arrivals
        assert again is not None
        count, kept, strikes = again.total, 0, again.t
    known = [each for each in (count, run.walk.footsteps) if not isinstance(each, jax.core.Tracer)]
    room = int(known[0]) if known and int(known[0]) else _ROOM
    if room > kept:
        walk: RigidSimulation = jax.lax.stop_gradient(run.saving_strikes(room))
        again = walk.solved().arrivals
        assert again is not None
        strikes = again.t
    moments = None
    if not strikes_saved:
        moments = found.t if run.section is None else found.arrivals.t
    end = found.t[-1], found.ending
    section = None if strikes_saved else run.section
    if run.times is not None:
        end = run.walk.duration, found.ending
    slopes = rigid_slopes_of(
        run.walk, strikes, count, *end, moments, section=section, places=places, active=active
    )
    # Another solve may tell what this one cannot: it then differentiates another walk.
    grazes = jnp.asarray(found.grazes)
    slopes = jtu.tree_map(lambda leaf: jnp.where(grazes > 0, jnp.nan, leaf), slopes)
    if not strikes_saved or len(strikes) == kept:
        return slopes
    # Of the strikes only those that are kept, then the end.
    return Slopes(*(jnp.concatenate([leaf[:kept], leaf[-1:]]) for leaf in slopes))
