"""Cause of a branch's end by a limit of the model, from the walks on either side of it."""

from typing import NamedTuple, cast

import numpy as np

from jaxbiped._ending import Ending
from jaxbiped.dynamics._contacts import contacts
from jaxbiped.dynamics._rigid_state import WalkerState
from jaxbiped.dynamics._state import State
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


class _Contact(NamedTuple):
    """Contact of a walk over one cycle.

    Attributes:
        at_start: force on both feet where it begins, in units of the weight.
        slipping: share of the load, summed over time, on feet that slip faster than the speed
            over which friction builds up.
    """

    at_start: float
    slipping: float


def limit_cause(here: Scene, beyond: Scene, state: WalkerState, period: float) -> str | None:
    """What a limit between two scenes comes from; None where neither touch nor slip tells.

    Args:
        here, beyond: the scene of the last gait, and one just behind the limit.
        state: of the last gait, on the section.
        period: of its cycle [s].
    """
    last, next_one = (_contact(scene, state, period) for scene in (here, beyond))
    if last.at_start < _UNLOADED:
        return "no touch: the stance foot carries nothing on the section"
    if next_one.slipping > max(_SLIDES * last.slipping, last.slipping + _LITTLE):
        return "slip: beyond, a foot that lands slides on"
    return None


def _contact(scene: Scene, state: WalkerState, period: float) -> _Contact:
    walk = simulate(scene, cast(State, state), duration=period)
    found = contacts(scene, walk.state)
    normal = np.stack([np.asarray(force.normal) for force in found.forces])
    slip = np.stack([np.abs(np.asarray(foot.slip_speed)) for foot in found.feet])
    name = getattr(scene.friction, "builds_up_over", None)
    slow = float(getattr(scene.friction, name)) if name is not None else 0.0
    load = normal[:, 1:] * np.diff(np.asarray(walk.t))
    weight = float(scene.walker.total_mass * scene.ground.g)
    slipping = float(np.sum(load * (slip[:, 1:] > slow)) / max(float(np.sum(load)), 1e-300))
    return _Contact(float(np.sum(normal[:, 0])) / weight, slipping)
