"""Where the feet are, how they move, and which of them touch the ground."""

from typing import NamedTuple

import jax.numpy as jnp

from jaxbiped._circular import sine_cosine
from jaxbiped._types import Scalar
from jaxbiped.dynamics._state import State
from jaxbiped.scene._scene import Scene


class Foot(NamedTuple):
    """Kinematics of one foot, leaves shaped as the state's.

    Attributes:
        x, z: centre of the foot in the slope's frame [m].
        vx, vz: velocity of that centre [m/s].
        penetration: δ = r − z, positive when indented [m].
        penetration_rate: δ̇ = −vz [m/s].
        slip_speed: V_T = vx + r θ̇, tangential velocity of the material point in contact [m/s].
        admitted: whether the clearance rule lets the foot touch (boolean), None for "always",
            Python's False for "never".
        bristle: see `AbstractBristleLaw` [–]; None where friction has no memory.
    """

    x: Scalar
    z: Scalar
    vx: Scalar
    vz: Scalar
    penetration: Scalar
    penetration_rate: Scalar
    slip_speed: Scalar
    admitted: Scalar | bool | None
    bristle: Scalar | None


class Feet(NamedTuple):
    """One entry for each leg."""

    foot_1: Foot
    foot_2: Foot


def feet(scene: Scene, state: State) -> Feet:
    """Both feet's kinematics (model: foot centre O = S + (l − r)(sin θ, −cos θ))."""
    return Feet(
        _foot(scene, state, 1, state.theta_1, state.omega_1, getattr(state, "bristle_1", None)),
        _foot(scene, state, 2, state.theta_2, state.omega_2, getattr(state, "bristle_2", None)),
    )


def _foot(
    scene: Scene, state: State, leg: int, angle: Scalar, rate: Scalar, bristle: Scalar | None
) -> Foot:
    length, radius = scene.walker.hip_to_foot, scene.walker.r
    sine, cosine = sine_cosine(angle)
    x = state.hip_x + length * sine
    z = state.hip_z - length * cosine
    vx = state.hip_vx + length * cosine * rate
    vz = state.hip_vz + length * sine * rate
    return Foot(
        x=x,
        z=z,
        vx=vx,
        vz=vz,
        penetration=radius - z,
        penetration_rate=-vz,
        slip_speed=vx + radius * rate,
        admitted=scene.clearance.admits(leg, rate),
        bristle=bristle,
    )


def touches(foot: Foot) -> Scalar:
    """Whether the foot is in contact (boolean): indented and admitted by the clearance rule."""
    below = foot.penetration > 0.0
    return below if foot.admitted is None else below & foot.admitted


def landings(before: Feet, after: Feet) -> tuple[Scalar, Scalar]:
    """Whether each foot comes to touch between two moments and is the one ahead (booleans).

    Such a landing is a heel strike where the other foot made the one before.
    """

    def lands(i: int) -> Scalar:
        newly = ~touches(before[i]) & touches(after[i])
        return newly & (after[i].x > after[1 - i].x)

    return lands(0), lands(1)


def standing_foot(both: Feet) -> Scalar:
    """The foot that alone touches: 1 or 2, or 0 where none or both do."""
    touch_1, touch_2 = touches(both.foot_1), touches(both.foot_2)
    return jnp.where(touch_1 & ~touch_2, 1, jnp.where(touch_2 & ~touch_1, 2, 0))


def standing_height(
    scene: Scene, stance_angle: Scalar, penetration: Scalar | float = 0.0
) -> Scalar:
    """Hip height [m] over a leg at `stance_angle` [rad] that indents the ground [m]."""
    walker = scene.walker
    return walker.r - penetration + walker.hip_to_foot * jnp.cos(stance_angle)
