"""Rigid walk as a program for lanes."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import jax.tree_util as jtu

from jaxbiped._caches import PROGRAMS, bounded_cache
from jaxbiped._types import Scalar
from jaxbiped.compiler import CompiledProgram, Program, Recorded, call
from jaxbiped.dynamics._rigid_state import RigidState
from jaxbiped.solve._rigid_steps import (
    RigidProgress,
    RigidWalk,
    attempt_step,
    ending_of,
    initial_progress,
    state_with_hip,
)


class RigidSolved(NamedTuple):
    """One walk's outputs: see `RigidProgress`."""

    t: Scalar
    state: RigidState
    code: Scalar
    footsteps: Scalar
    attempts: Scalar


def rigid_walk_by_lanes(
    walk: RigidWalk, *, room: int, waits: bool
) -> tuple[RigidSolved, Recorded | None]:
    """Walks one walk, or under `vmap` many; records time and state after the first strikes.

    `waits`: whether the duration only bounds the wait for footsteps.
    """
    structure = jtu.tree_structure(walk.scene)
    return call(_compiled(structure, room > 0, waits), walk, room=room, quick=True)


@bounded_cache(PROGRAMS)
def _compiled(structure: Any, recording: bool, waits: bool) -> CompiledProgram:
    number: Any = jax.ShapeDtypeStruct((), jnp.float64)
    scene = jtu.tree_unflatten(structure, [number] * structure.num_leaves)
    inputs = RigidWalk(scene, RigidState(*[number] * 5), *[number] * 4)

    def finish(walk: RigidWalk, now: RigidProgress) -> RigidSolved:
        code = ending_of(walk, now, jnp.asarray(waits))
        return RigidSolved(now.t, state_with_hip(walk, now), code, now.footsteps, now.attempts)

    program = Program(initial_progress, attempt_step, finish, record=_record if recording else None)
    return CompiledProgram(program, inputs)


def _record(walk: RigidWalk, now: RigidProgress, time: Scalar) -> tuple[Scalar, list[Scalar]]:
    return now.struck, [now.t, *state_with_hip(walk, now)]
