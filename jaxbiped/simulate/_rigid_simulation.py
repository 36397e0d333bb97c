"""Walk of the rigid walker: a checked request, which either engine runs."""

import dataclasses
import functools
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import (
    ArgumentError,
    check_positive,
    check_room,
    check_unbatched,
    traced_rules,
)
from jaxbiped._types import Scalar, as_float, by_numpy
from jaxbiped.caching._caches import PROGRAMS, bounded_cache
from jaxbiped.compiler import BY_NAME, Program, Request
from jaxbiped.dynamics._state import check_state, state_type, without_whole_turns
from jaxbiped.dynamics._surfaces import HeelStrike
from jaxbiped.scene._ground import check_pulls
from jaxbiped.scene._modes import check_mode, rigid_modes
from jaxbiped.scene._scene import RigidScene
from jaxbiped.scene._scene_checks import check_scene, where_allowed
from jaxbiped.simulate._derivatives import Slopes, rigid_slopes_of, with_derivatives
from jaxbiped.simulate._start import (
    Options,
    check_limits,
    check_single_scene,
    in_one_precision,
    in_own_precision,
)
from jaxbiped.solve._accuracy import ACCURACIES
from jaxbiped.solve._engine_names import engine_for
from jaxbiped.solve._mode_history import history_of
from jaxbiped.solve._rigid_steps import (
    RigidProgress,
    RigidWalk,
    attempt_step,
    ending_of,
    initial_progress,
    is_pulled,
    state_with_hip,
)
from jaxbiped.solve._trajectory import Trajectory, arrivals_among, scene_key, single_time

_ROOM = 256
"""Heel strikes that there is room for where it is not known how many come."""
_ROWS = 64
"""Changes of mode that there is room for beside heel strikes."""
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
        embedded: whether steps go on with the embedded solution, one order lower.
        max_arrivals: how many heel strikes to keep.
        engine: "lanes", "cuda" or "xla".
        finest_tolerance: finest relative tolerance to which its error is refined: rolling is smooth
            and never stiff.
    """

    finest_tolerance: ClassVar[float] = 1e-13
    walk: RigidWalk
    waits: bool = eqx.field(static=True)
    embedded: bool = eqx.field(static=True)
    max_arrivals: int = eqx.field(static=True)
    engine: str = eqx.field(static=True)

    @staticmethod
    def of(scene: RigidScene, state: Any, asked: Options) -> "RigidSimulation":
        """Checks what is asked, and forms it."""
        asked.refuse(scene, "solver", "atol", "dt", "extremes", "watch", "adjoint")
        section, duration, footsteps = asked.section, asked.duration, asked.footsteps
        ends_alone = isinstance(asked.save, str) and asked.save == "end"
        if not ends_alone and not isinstance(section, HeelStrike):
            raise ArgumentError(
                f"save = {asked.save!r} is not allowed for a RigidScene: "
                'give "end" or HeelStrike().'
            )
        check_limits(duration, footsteps, asked.max_solver_steps)
        with traced_rules() as rules:
            scene = check_scene(scene, RigidScene)
            state = check_state(in_own_precision(state), state_type(scene))
            state = in_one_precision(without_whole_turns(scene, state))
            check_single_scene(scene)
            check_unbatched("state", state, "one start")
            if (modes := rigid_modes(scene.mechanism)).any:
                check_mode(scene.mechanism, modes, scene.ground.slope, state)
            if duration is None:
                check_pulls(scene.ground)
            else:
                check_positive("duration", duration, "s")
            usual = ACCURACIES[asked.accuracy].rigid_walk
            tolerance = usual if asked.rtol is None else asked.rtol
            check_positive("rtol", tolerance)
        # Of a lane that is not allowed nothing is known from the start.
        state, duration = where_allowed(rules, state), where_allowed(rules, duration, 1.0)
        check_room("max_arrivals", asked.max_arrivals)
        dtype = state[0].dtype
        narrow = "it computes in 64 bits" if dtype != jnp.float64 else None
        count, longest = 1 if footsteps is None else footsteps, duration
        if duration is None:
            longest = by_numpy(
                lambda numpy, l, g: count * (_PATIENCE * numpy.sqrt(l / g)),
                scene.mechanism.height,
                scene.ground.g,
            )
        others = footsteps or 0, tolerance, asked.max_solver_steps

        def cast(leaf: Any) -> Scalar:
            return as_float(leaf).astype(dtype)

        # In the precision of the start, as a compliant walk has it. A scene that is formed anew
        # makes its mechanism anew.
        scene = scene if narrow is None else jtu.tree_map(cast, scene)
        return RigidSimulation(
            RigidWalk(scene, state, cast(longest), *map(cast, others)),
            waits=duration is None,
            embedded=False,
            max_arrivals=0 if section is None else int(asked.max_arrivals),
            engine=engine_for(asked.engine, obstacle=narrow, by_device=True, by_any=True),
        )

    @property
    def scene(self) -> RigidScene:
        """What walks."""
        return self.walk.scene

    @property
    def rtol(self) -> Scalar:
        """Relative tolerance."""
        return self.walk.rtol

    def at_tolerance(self, rtol: float) -> "RigidSimulation":
        """The same at another relative tolerance."""
        changed = as_float(rtol).astype(self.rtol.dtype)
        return dataclasses.replace(self, walk=self.walk._replace(rtol=changed))

    def by_other_method(self) -> tuple["RigidSimulation", float, float]:
        """The same by the embedded method; its tolerance in units of the walk's, and its weight."""
        return dataclasses.replace(self, embedded=True), _EMBEDDED, 1.0

    def first_tolerance(self, wanted: float) -> float:
        """The relative tolerance to begin with where this relative error is wanted."""
        return min(_FIRST * wanted, _LOOSEST)

    def __call__(self) -> Trajectory[Any]:
        """Solves it, differentiably."""
        walk = with_derivatives(self, RigidSimulation.solved, moving=_moving, slopes=_slopes)
        return dataclasses.replace(walk, scene_key=scene_key(self.walk.scene))

    def solved(self) -> Trajectory[Any]:
        """Solves it."""
        state = self.walk.state
        moded = rigid_modes(self.scene.mechanism).any
        program = rigid_program(self.max_arrivals > 0, moded, self.waits, self.embedded)
        room = _ROWS + 8 * self.max_arrivals if moded else self.max_arrivals
        request = Request(program, self.walk, room=room, quick=True)
        found, recorded, _ = BY_NAME[self.engine].run(request)
        no_rows = np.zeros((0, 1 + len(state)), state[0].dtype)
        rows: Any = no_rows if recorded is None else recorded.values
        history = None
        if moded and recorded is not None:
            history = history_of(self.scene, found.begin, rows, recorded.counts)
            kept = functools.partial(_first_strikes, count=self.max_arrivals)
            rows = by_numpy(kept, rows) if self.max_arrivals else no_rows
        t, end = single_time(found.t, found.state)
        return Trajectory(
            t=t,
            state=end,
            ending=found.ending,
            accepted=found.accepted,
            rejected=found.rejected,
            arrivals=arrivals_among(rows, found.footsteps, state),
            grazes=found.grazes,
            pulls=found.pulls,
            mode_history=history,
            engine=self.engine,
        )


def _first_strikes(numpy: Any, rows: Any, count: int) -> Any:
    """So many rows, those of heel strikes first, in their order and without the flag."""
    order = numpy.argsort(rows[:, 1] == 0.0, stable=True)[:count]
    return numpy.concatenate([rows[:, :1], rows[:, 2:]], axis=1)[order]


class RigidSolved(NamedTuple):
    """One walk's outputs: see `RigidProgress`."""

    t: Scalar
    state: Any
    ending: Scalar
    footsteps: Scalar
    accepted: Scalar
    rejected: Scalar
    grazes: Scalar
    pulls: Scalar
    begin: Scalar | None


@bounded_cache(PROGRAMS)  # the same object each time, so that nothing is compiled again
def rigid_program(strikes: bool, modes: bool, waits: bool, embedded: bool = False) -> Program:
    """The program of a `RigidWalk`.

    Args:
        strikes: whether time and state after each strike are recorded.
        modes: whether every change of mode is recorded, with its state where strikes are.
        waits: whether the duration only bounds the wait for footsteps.
        embedded: whether steps go on with the embedded solution; see `rolling_step`.
    """

    def finish(walk: RigidWalk, now: RigidProgress) -> RigidSolved:
        code = ending_of(walk, now, jnp.asarray(waits))
        counts = (now.footsteps, now.accepted, now.rejected, now.grazes, now.pulls)
        begin = getattr(walk.state, "mode", None)
        begin = begin if now.modes is None else now.modes.begin
        return RigidSolved(now.t, state_with_hip(walk, now), code, *counts, begin)

    def attempt(walk: RigidWalk, now: RigidProgress) -> tuple[RigidProgress, Scalar]:
        after, over = attempt_step(walk, now, embedded=embedded)
        pulled = (after.accepted > now.accepted) & is_pulled(walk, after)
        return after._replace(pulls=now.pulls + jnp.where(pulled, 1, 0)), over

    def record(walk: RigidWalk, now: RigidProgress, time: Scalar) -> tuple[Scalar, list[Scalar]]:
        happens = now.struck if now.modes is None else now.struck | now.modes.changed
        if not strikes:
            return happens, [now.t, now.state.mode]
        flag = [jnp.where(now.struck, 1.0, 0.0)] if modes else []
        return happens, [now.t, *flag, *state_with_hip(walk, now)]

    return Program(initial_progress, attempt, finish, record if strikes or modes else None)


def _moving(run: RigidSimulation) -> tuple[PyTree, PyTree, PyTree]:
    return run.walk.state, run.walk.scene, run.walk.duration


def _slopes(
    run: RigidSimulation,
    found: Trajectory[Any],
    places: tuple[int, ...],
    active: tuple[int, ...],
) -> Slopes:
    assert found.arrivals is not None
    count, kept, grazes = found.arrivals.total, run.max_arrivals, jnp.asarray(found.grazes)
    strikes = found.arrivals.t
    known = [each for each in (count, run.walk.footsteps) if not isinstance(each, jax.core.Tracer)]
    room = int(known[0]) if known and int(known[0]) else _ROOM
    if room > kept:
        walk: RigidSimulation = jax.lax.stop_gradient(dataclasses.replace(run, max_arrivals=room))
        again = walk.solved().arrivals
        assert again is not None
        strikes = again.t
    end = found.t[-1], found.ending
    slopes = rigid_slopes_of(run.walk, strikes, count, *end, places=places, active=active)
    # Another solve may tell what this one cannot: it then differentiates another walk.
    slopes = jtu.tree_map(lambda leaf: jnp.where(grazes > 0, jnp.nan, leaf), slopes)
    if len(strikes) == kept:
        return slopes
    # Of the strikes only those that are kept, then the end.
    return Slopes(*(jnp.concatenate([leaf[:kept], leaf[-1:]]) for leaf in slopes))
