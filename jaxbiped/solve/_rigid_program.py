"""Rigid walk as a program for either engine."""

import functools
from typing import NamedTuple

import jax.numpy as jnp

from jaxbiped._types import Scalar
from jaxbiped.caching._caches import PROGRAMS, bounded_cache
from jaxbiped.compiler import Program
from jaxbiped.dynamics._state import RigidState
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
    ending: Scalar
    footsteps: Scalar
    accepted: Scalar
    rejected: Scalar
    grazes: Scalar


@bounded_cache(PROGRAMS)  # the same object each time, so that nothing is compiled again
def rigid_program(records: bool, waits: bool, embedded: bool = False) -> Program:
    """The program of a `RigidWalk`.

    Args:
        records: whether time and state after each strike are recorded.
        waits: whether the duration only bounds the wait for footsteps.
        embedded: whether steps go on with the embedded solution; see `rolling_step`.
    """

    def finish(walk: RigidWalk, now: RigidProgress) -> RigidSolved:
        code = ending_of(walk, now, jnp.asarray(waits))
        counts = (now.footsteps, now.accepted, now.rejected, now.grazes)
        return RigidSolved(now.t, state_with_hip(walk, now), code, *counts)

    attempt = functools.partial(attempt_step, embedded=embedded)
    return Program(initial_progress, attempt, finish, record=_record if records else None)


def _record(walk: RigidWalk, now: RigidProgress, time: Scalar) -> tuple[Scalar, list[Scalar]]:
    return now.struck, [now.t, *state_with_hip(walk, now)]
