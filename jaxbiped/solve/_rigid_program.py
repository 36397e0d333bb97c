"""Rigid walk as a program for either engine."""

from typing import NamedTuple

import jax.numpy as jnp

from jaxbiped._caches import PROGRAMS, bounded_cache
from jaxbiped._types import Scalar
from jaxbiped.compiler import Program
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
    ending: Scalar
    footsteps: Scalar
    accepted: Scalar
    rejected: Scalar


@bounded_cache(PROGRAMS)  # the same object each time, so that nothing is compiled again
def rigid_program(records: bool, waits: bool) -> Program:
    """The program of a `RigidWalk`; it records time and state after each strike, if it does.

    `waits`: whether the duration only bounds the wait for footsteps.
    """

    def finish(walk: RigidWalk, now: RigidProgress) -> RigidSolved:
        code = ending_of(walk, now, jnp.asarray(waits))
        counts = (now.footsteps, now.accepted, now.rejected)
        return RigidSolved(now.t, state_with_hip(walk, now), code, *counts)

    return Program(initial_progress, attempt_step, finish, record=_record if records else None)


def _record(walk: RigidWalk, now: RigidProgress, time: Scalar) -> tuple[Scalar, list[Scalar]]:
    return now.struck, [now.t, *state_with_hip(walk, now)]
