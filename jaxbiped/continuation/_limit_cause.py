"""Cause of a branch's end by a limit of the model, from the walks on either side of it."""

from typing import cast

import numpy as np

from jaxbiped._ending import Ending
from jaxbiped.dynamics._contact_forces import contacts
from jaxbiped.dynamics._state import State, WalkerState
from jaxbiped.scene._scene import Scene
from jaxbiped.simulate._simulate import simulate

NOT_SMOOTH = "grazing: the return map is not smooth"
OF_ENDINGS = {
    Ending.TIMED_OUT: "no touch: no footstep comes (timed out)",
    Ending.STUMBLED: "scuffing: the foot behind comes down (stumbled)",
}
"""Endings of the walk beyond that are told in more words."""
_UNLOADED = 1e-3
"""Share of the weight on the stance foot from which it carries nothing."""
_SLIDES = 1.5
"""Factor of the load that slips from which feet slide beyond a limit that they do not before."""
_LITTLE = 0.01


def limit_cause(
    here: Scene, before: Scene, beyond: Scene, state: WalkerState, period: float
) -> str | None:
    """What a limit between two scenes comes from; None where neither touch nor slip tells.

    Args:
        here: the scene of the last gait; at the limit itself rounding decides whether feet slide.
        before, beyond: scenes as far before the limit as behind it.
        state: of the last gait, on the section.
        period: of its cycle [s].
    """
    if _load(here, state) < _UNLOADED:
        return "no touch: the stance foot carries nothing on the section"
    known, found = (_slipping(scene, state, period) for scene in (before, beyond))
    if found > max(_SLIDES * known, known + _LITTLE):
        return "slip: beyond, a foot that lands slides on"
    return None


def _load(scene: Scene, state: WalkerState) -> float:
    """Force on both feet, in units of the weight."""
    both = contacts(scene, cast(State, state)).forces
    weight = float(scene.walker.total_mass * scene.ground.g)
    return sum(float(force.normal) for force in both) / weight


def _slipping(scene: Scene, state: WalkerState, period: float) -> float:
    """Share of the load, summed over a cycle's time, on feet that slip faster than the speed over
    which friction builds up."""
    walk = simulate(scene, cast(State, state), duration=period)
    found = contacts(scene, walk.state)
    normal = np.stack([np.asarray(force.normal) for force in found.forces])
    slip = np.stack([np.abs(np.asarray(foot.slip_speed)) for foot in found.feet])
    name = getattr(scene.friction, "builds_up_over", None)
    slow = float(getattr(scene.friction, name)) if name is not None else 0.0
    load = normal[:, 1:] * np.diff(np.asarray(walk.t))
    return float(np.sum(load * (slip[:, 1:] > slow)) / max(float(np.sum(load)), 1e-300))
