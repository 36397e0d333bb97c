"""Gaps that may close: under every foot, and at every limit of a stop."""

from typing import NamedTuple

from jaxbiped._types import Scalar
from jaxbiped.dynamics._contacts import feet
from jaxbiped.dynamics._joint_loads import Pressed, stop_limits
from jaxbiped.dynamics._redundant_state import CompliantState, motion_in
from jaxbiped.scene._scene import CompliantScene
from jaxbiped.scene.laws._abstract_laws import AbstractNormalLaw


class Gap(NamedTuple):
    """A gap between two parts that press on each other where it is closed.

    Attributes:
        penetration: positive where it is closed [m, at a stop rad].
        penetration_rate: its rate [m/s, rad/s].
        admitted: whether they may touch; None for "always", False for "never", as of a `Foot`.
    """

    penetration: Scalar
    penetration_rate: Scalar
    admitted: Scalar | bool | None


def limits_of(
    scene: CompliantScene, state: CompliantState
) -> tuple[tuple[AbstractNormalLaw, Pressed], ...]:
    """Every limit of the stops of a scene with its law."""
    motion = motion_in(scene, state)
    return stop_limits(scene.mechanism, motion, scene.ground.slope)


def gaps(scene: CompliantScene, state: CompliantState) -> tuple[Gap, ...]:
    """All gaps of a scene: those of its feet, then those of its stops."""
    under = [
        Gap(foot.penetration, foot.penetration_rate, foot.admitted) for foot in feet(scene, state)
    ]
    at_stops = [Gap(limit.penetration, limit.rate, None) for _, limit in limits_of(scene, state)]
    return (*under, *at_stops)
