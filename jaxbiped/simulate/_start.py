"""Checks of how a simulation starts and steps."""

from typing import Any

import diffrax

from jaxbiped._checks import ArgumentError, check_positive, holds_somewhere
from jaxbiped.dynamics._bristles import state_for
from jaxbiped.dynamics._consistent import Consistent, consistent_state
from jaxbiped.dynamics._independence import check_independent
from jaxbiped.dynamics._redundant_motion import coordinates_of
from jaxbiped.scene._redundant_scene import RedundantScene
from jaxbiped.scene._scene import Scene


def start_for(scene: Scene | RedundantScene, state: Any) -> tuple[Any, Consistent | None]:
    """A checked start of the kind that a scene needs, and how it was put on its constraints.

    Raises:
        ArgumentError: a start that is not allowed, or constraints that the method cannot hold.
    """
    if not isinstance(scene, RedundantScene):
        return state_for(scene, state), None
    correction = consistent_state(scene, state)
    q, _ = coordinates_of(scene, correction.state)
    check_independent(scene.linkage, scene.method, q)
    return correction.state, correction


def check_steps(solver: Any, dt: float | None, *, most_steps: int, duration: Any) -> None:
    """Raises `ArgumentError` for steps that a solver cannot make or the cap on steps forbids."""
    if dt is None:
        if isinstance(solver, diffrax.Euler):
            raise ArgumentError("dt = None is not allowed for solver = euler: give its step [s].")
        return
    check_positive("dt", dt, "s")
    if holds_somewhere(duration > dt * most_steps):
        raise ArgumentError(
            f"dt = {float(dt):g} is not allowed: {float(duration):g} s of such steps are more than "
            f"max_solver_steps = {most_steps}."
        )
