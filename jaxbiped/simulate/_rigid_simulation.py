"""A rigid walk that is ready to run: what to solve, how tightly, by which engine."""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from jaxbiped._types import Parameter, as_float
from jaxbiped.compiler import Request
from jaxbiped.dynamics._state import RigidState
from jaxbiped.simulate._derivatives import with_derivatives
from jaxbiped.simulate._rigid_slopes import rigid_slopes_of
from jaxbiped.simulate._slopes import Slopes
from jaxbiped.solve._engine_names import engine_named
from jaxbiped.solve._rigid_program import rigid_program
from jaxbiped.solve._rigid_steps import RigidWalk
from jaxbiped.solve._scene_key import scene_key
from jaxbiped.solve._trajectory import Trajectory, arrivals_among, single_time

_ROOM = 256
"""Heel strikes that there is room for where it is not known how many come."""


class RigidSimulation(eqx.Module):
    """A prepared rigid walk. Call it for its trajectory.

    Attributes:
        walk: the program's inputs.
        waits: whether the duration only bounds the wait for footsteps.
        embedded: whether steps go on with the embedded solution, one order lower.
        max_arrivals: how many heel strikes to keep.
        engine: "lanes", "cuda" or "xla".
    """

    walk: RigidWalk
    waits: bool = eqx.field(static=True)
    embedded: bool = eqx.field(static=True)
    max_arrivals: int = eqx.field(static=True)
    engine: str = eqx.field(static=True)

    def with_inputs(
        self, *, embedded: bool | None = None, **inputs: Parameter
    ) -> "RigidSimulation":
        """The same with other numbers of `walk`, by name, in its precision."""
        like = self.walk.duration.dtype
        new: Any = {name: as_float(value).astype(like) for name, value in inputs.items()}
        kept = self.embedded if embedded is None else embedded
        return dataclasses.replace(self, walk=self.walk._replace(**new), embedded=kept)

    def __call__(self) -> Trajectory[RigidState]:
        """Solves it, differentiably."""
        walk = with_derivatives(self, RigidSimulation.solved, moving=_moving, slopes=_slopes)
        return dataclasses.replace(walk, scene_key=scene_key(self.walk.scene))

    def solved(self) -> Trajectory[RigidState]:
        """Solves it."""
        state = self.walk.state
        program = rigid_program(self.max_arrivals > 0, self.waits, self.embedded)
        request = Request(program, self.walk, room=self.max_arrivals, quick=True)
        found, recorded, _ = engine_named(self.engine).run(request)
        no_rows = np.zeros((0, 1 + len(state)), state.theta_1.dtype)
        rows = no_rows if recorded is None else recorded.values
        t, end = single_time(found.t, found.state)
        return Trajectory(
            t=t,
            state=end,
            ending=found.ending,
            accepted=found.accepted,
            rejected=found.rejected,
            arrivals=arrivals_among(rows, found.footsteps, state),
            grazes=found.grazes,
            engine=self.engine,
        )


def _moving(run: RigidSimulation) -> tuple[PyTree, PyTree, PyTree]:
    return run.walk.state, run.walk.scene, run.walk.duration


def _slopes(
    run: RigidSimulation,
    found: Trajectory[RigidState],
    places: tuple[int, ...],
    active: tuple[int, ...],
) -> Slopes:
    assert found.arrivals is not None
    count, kept = found.arrivals.total, run.max_arrivals
    strikes = found.arrivals.t
    known = [each for each in (count, run.walk.footsteps) if not isinstance(each, jax.core.Tracer)]
    room = int(known[0]) if known and int(known[0]) else _ROOM
    if room > kept:
        walk: RigidSimulation = jax.lax.stop_gradient(dataclasses.replace(run, max_arrivals=room))
        again = walk.solved().arrivals
        assert again is not None
        strikes = again.t
    slopes = rigid_slopes_of(
        run.walk.scene,
        run.walk.state,
        strikes,
        count,
        found.t[-1],
        found.ending,
        until=run.walk.duration,
        rtol=run.walk.rtol,
        places=places,
        active=active,
    )
    if len(strikes) == kept:
        return slopes
    # Of the strikes only those that are kept, then the end.
    return Slopes(*(jnp.concatenate([leaf[:kept], leaf[-1:]]) for leaf in slopes))
