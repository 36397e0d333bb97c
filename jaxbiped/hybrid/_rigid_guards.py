"""Guards of a rigid walker: where a mode of its feet and stops ends."""

from typing import Any

import jax.numpy as jnp

from jaxbiped._types import Scalar
from jaxbiped.dynamics._holds import gap_of
from jaxbiped.dynamics._mode_changes import foot_loads, held_reactions, loose_limits
from jaxbiped.dynamics._stance import Stance, of_stance, stance_on
from jaxbiped.dynamics._stance_motion import turning_of
from jaxbiped.hybrid._guards import Switch
from jaxbiped.scene._modes import rigid_modes
from jaxbiped.scene._scene import RigidScene


def mode_switches(scene: RigidScene, state: Any) -> tuple[Switch, ...]:
    """Where a scene's mode changes: gaps and reactions of limits, heights and loads of two feet.

    Values are in rad, heights in units of the walker's, and loads in units of its weight too.
    """
    mechanism, modes = scene.mechanism, rigid_modes(scene.mechanism)
    if not modes.any:
        return ()
    weight = mechanism.total_mass * scene.ground.g
    mode = modes.decoded(jnp, state.mode)

    def gaps_and_reactions(stance: Stance) -> list[Scalar]:
        reactions = held_reactions(stance, turning_of(scene, stance))
        gaps = [gap_of(scene, limit, stance) for limit in modes.limits]
        return [*gaps, *(each / (weight * mechanism.height) for each in reactions)]

    pressed = [a & b for a, b in zip(mode.held, loose_limits(modes, mode), strict=True)]
    live = [*(~held for held in mode.held), *pressed]
    values = of_stance(scene, state, gaps_and_reactions) if modes.limits else []
    found = [_falls(*each) for each in zip(values, live, strict=True)]
    for leg, flat in modes.flat(mode).items():
        stance, here = stance_on(scene, state, leg), modes.stands_on(mode, leg)
        for k, stands in zip(stance.feet, stance.stands, strict=True):
            found.append(_falls(stance.height(k) / mechanism.height, here & ~stands))
        loads = foot_loads(scene, stance, turning_of(scene, stance))
        found += [_falls(load / weight, flat) for load in loads]
    return tuple(found)


def _falls(value: Scalar, live: Scalar) -> Switch:
    return Switch(value, live, resets=True, first_only=True)
