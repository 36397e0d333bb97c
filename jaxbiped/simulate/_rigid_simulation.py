"""Walk of the rigid walker: a checked request, which either engine runs."""

import dataclasses
import functools
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np

from jaxbiped._checks import ArgumentError
from jaxbiped._types import as_float, by_numpy, is_traced
from jaxbiped.compiler import BY_NAME, Request
from jaxbiped.hybrid._landing_system import LandingMotion
from jaxbiped.hybrid._mode_history import history_of
from jaxbiped.hybrid._rolling_system import ROLLING
from jaxbiped.hybrid._sections import HeelStrike
from jaxbiped.scene._modes import rigid_modes
from jaxbiped.scene._scene import RigidScene
from jaxbiped.simulate._abstract_simulation import AbstractSimulation
from jaxbiped.simulate._backends import recorder_for
from jaxbiped.simulate._derivatives import Slopes, rigid_slopes_of
from jaxbiped.simulate._start import Options
from jaxbiped.simulate._trajectory import Trajectory, arrivals_among, single_time
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


class RigidSimulation(AbstractSimulation):
    """A checked request for a rigid walk, whose motion between impacts is smooth and never stiff.

    Attributes:
        method: its steps.
        waits: whether the duration only bounds the wait for footsteps.
    """

    kinds: ClassVar[tuple[type, ...]] = (RigidScene,)
    finest_tolerance: ClassVar[float] = 1e-13
    method: ExplicitMethod = eqx.field(static=True)
    waits: bool = eqx.field(static=True)

    @classmethod
    def method_of(cls, asked: Options) -> ExplicitMethod:
        """By default the explicit method of order eight."""
        solver = asked.solver
        if isinstance(solver, str) and solver == Options._field_defaults["solver"]:
            return ExplicitMethod()
        names = {kind: name for name, kind in EXPLICIT_METHODS.items()}
        name = solver if isinstance(solver, str) else names.get(type(solver))
        if name not in EXPLICIT_METHODS:
            raise ArgumentError(
                f"solver = {solver!r} is not allowed for a RigidScene, whose motion between "
                "impacts is smooth and never stiff: choose one of "
                f"{', '.join(EXPLICIT_METHODS)}."
            )
        method = ExplicitMethod(name)
        if asked.dt is None and not method.estimates:
            raise ArgumentError(
                f"dt = None is not allowed for solver = {name}, whose steps have a fixed size: "
                "give it in seconds."
            )
        return method

    @classmethod
    def completed(
        cls, fields: dict[str, Any], scene: Any, asked: Options, method: Any
    ) -> "RigidSimulation":
        """The engine must be able to save what is asked."""
        narrow = fields["rtol"].dtype != jnp.float64
        obstacle = "it computes in 64 bits" if narrow else None
        engine = engine_for(asked.engine, obstacle=obstacle, by_device=True, by_any=True)
        obstacle = None
        if asked.section is not None and jtu.tree_leaves(asked.section):
            obstacle = f"the section {type(asked.section).__name__} holds numbers of its own"
        if asked.times is not None:
            if is_traced(asked.times):
                obstacle = "the times to save at must be known beforehand"
            else:  # in 64 bits whatever the start is
                fields |= dict(times=np.asarray(asked.times, dtype=float))
        if obstacle is not None:
            raise ArgumentError(f"save = {asked.save!r} is not allowed here: {obstacle}.")
        return cls(**fields, method=method, engine=engine, waits=asked.duration is None)

    @property
    def inputs(self) -> Landing:
        """The program's inputs."""
        footsteps, most = (
            as_float(count).astype(self.rtol.dtype)
            for count in (self.footsteps or 0, self.max_solver_steps)
        )
        limits = (self.duration, footsteps, self.rtol, most)
        return Landing(ROLLING, self.scene, self.state, *limits, dt=self.dt)

    @property
    def room(self) -> int:
        """How many steps or arrivals to keep."""
        if self.save_steps:
            return self.max_solver_steps
        return 0 if self.section is None else self.max_arrivals

    def saving_strikes(self, room: int) -> "RigidSimulation":
        """The same, of which so many heel strikes are saved and nothing else."""
        section = HeelStrike() if room else None
        saved: dict[str, Any] = dict(times=None, save_steps=False, extremes=None, integrals=None)
        return dataclasses.replace(self, section=section, max_arrivals=room, **saved)

    def by_other_method(self) -> tuple["RigidSimulation", float, float]:
        if self.method == ExplicitMethod():
            return dataclasses.replace(self, method=ExplicitMethod(embedded=True)), _EMBEDDED, 1.0
        return dataclasses.replace(self, method=ExplicitMethod()), 1.0, 1.0

    def first_tolerance(self, wanted: float) -> float:
        return min(_FIRST * wanted, _LOOSEST)

    def solved(self) -> Trajectory[Any]:
        scene, state = self.scene, self.state
        moded = rigid_modes(scene.mechanism).any
        recorder = self._recorder(moded)
        strikes = isinstance(recorder, StrikeRecorder)
        solved, rows, total = self._run(
            recorder, _ROWS + 8 * self.room if moded and strikes else self.room
        )
        (t, told), dense = single_time(solved.t, solved.state), None
        arrivals, changes = arrivals_among(self._no_rows, solved.footsteps, state), (rows, total)
        if self.save_steps:
            record = landing_record(LandingMotion(ROLLING, scene), state, rows, total)
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

    def slopes(
        self, found: Trajectory[Any], places: tuple[int, ...], active: tuple[int, ...]
    ) -> Slopes:
        assert found.arrivals is not None
        strikes_saved = self.times is None and (
            self.section is None or isinstance(self.section, HeelStrike)
        )
        count, kept, strikes = found.arrivals.total, self.room, found.arrivals.t
        if not strikes_saved:
            plain: RigidSimulation = jax.lax.stop_gradient(self.saving_strikes(0))
            again = plain.solved().arrivals
            assert again is not None
            count, kept, strikes = again.total, 0, again.t
        traced = isinstance(count, jax.core.Tracer)
        room = int((self.footsteps or 0) if traced else count) or _ROOM
        if room > kept:
            walk: RigidSimulation = jax.lax.stop_gradient(self.saving_strikes(room))
            again = walk.solved().arrivals
            assert again is not None
            strikes = again.t
        moments = None
        if not strikes_saved:
            moments = found.t if self.section is None else found.arrivals.t
        end = found.t[-1], found.ending
        section = None if strikes_saved else self.section
        if self.times is not None:
            end = self.duration, found.ending
        slopes = rigid_slopes_of(
            self.inputs,
            strikes,
            count,
            *end,
            moments,
            section=section,
            places=places,
            active=active,
        )
        # Another solve may tell what this one cannot: it then differentiates another walk.
        grazes = jnp.asarray(found.grazes)
        slopes = jtu.tree_map(lambda leaf: jnp.where(grazes > 0, jnp.nan, leaf), slopes)
        if not strikes_saved or len(strikes) == kept:
            return slopes
        # Of the strikes only those that are kept, then the end.
        return Slopes(*(jnp.concatenate([leaf[:kept], leaf[-1:]]) for leaf in slopes))

    @property
    def _no_rows(self) -> np.ndarray:
        return np.zeros((0, 1 + len(self.state)), self.rtol.dtype)

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
            system=ROLLING,
            recorder=recorder,
            extremes=self.extremes,
            integrals=self.integrals,
            waits=self.waits,
            method=self.method,
            endings=endings,
        )
        inputs, scheduled = self.inputs, recorder is not None and recorder.scheduled
        request = Request(
            program_of(steps),
            inputs,
            room=0 if scheduled else room,
            times=self.times if scheduled else None,
            quick=True,
        )
        if self.save_steps and not is_traced(inputs):
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


def _first_strikes(numpy: Any, rows: Any, count: int) -> Any:
    """So many rows, those of heel strikes first, in their order and without the flag."""
    order = numpy.argsort(rows[:, 1] == 0.0, stable=True)[:count]
    return numpy.concatenate([rows[:, :1], rows[:, 2:]], axis=1)[order]
