"""Multipliers of what is held where a cycle begins, which are none of the gait's."""

import dataclasses
from typing import Any

import numpy as np

from jaxbiped.gait._gait import Gait
from jaxbiped.scene._rigid_feet import held_count


def without_held(scene: Any, gait: Gait) -> Gait:
    """A gait without the multipliers, all zero, of what is held where its cycle begins.

    Those of a state's mode and of the angles and rates that a stop or a flat foot holds.
    """
    if not hasattr(gait.measures.state, "mode"):
        return gait
    mode = float(gait.measures.state.mode)
    if not np.isfinite(mode):
        return gait
    held = held_count(scene.mechanism, mode)
    own = slice(np.shape(gait.multipliers)[-1] - 1 - 2 * held)
    return dataclasses.replace(
        gait,
        multipliers=gait.multipliers[own],
        multiplier_errors=gait.multiplier_errors[own],
        directions=gait.directions[:, own],
    )
