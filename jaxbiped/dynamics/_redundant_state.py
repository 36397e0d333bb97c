"""State in redundant coordinates: each leg has its own."""

from typing import TYPE_CHECKING, NamedTuple, TypeAlias, cast

import jax.numpy as jnp

from jaxbiped._circular import sine_cosine
from jaxbiped._types import Scalar
from jaxbiped.caching._cached_jit import kept_alone
from jaxbiped.dynamics._state import BristleState, MinimalState, State, state_type
from jaxbiped.scene._scene import AbstractWalkerScene, RedundantScene
from jaxbiped.scene._walker import leg_of

if TYPE_CHECKING:
    from typing_extensions import TypeIs


class RedundantState(NamedTuple):
    """Centre of mass and angle of each leg, and their rates: twelve scalar leaves.

    The frame is that of `State`. Where the hip has a mass, half of it belongs to each leg, and the
    centre of mass is that of both.

    Attributes:
        x_1, z_1, x_2, z_2: centres of mass [m].
        theta_1, theta_2: leg angles [rad].
        vx_1, vz_1, vx_2, vz_2: velocities [m/s].
        omega_1, omega_2: leg rates [rad/s].
        bristle_1, bristle_2: see `AbstractBristleLaw` [–]; None where friction has no memory.
    """

    x_1: Scalar
    z_1: Scalar
    theta_1: Scalar
    x_2: Scalar
    z_2: Scalar
    theta_2: Scalar
    vx_1: Scalar
    vz_1: Scalar
    omega_1: Scalar
    vx_2: Scalar
    vz_2: Scalar
    omega_2: Scalar
    bristle_1: Scalar | None = None
    bristle_2: Scalar | None = None


class EulerState(NamedTuple):
    """A `RedundantState` with the planar Euler parameters of each leg: sixteen scalar leaves.

    Attributes:
        x_1, z_1, x_2, z_2: centres of mass [m].
        cos_half_1, sin_half_1, cos_half_2, sin_half_2: cos θ/2 and sin θ/2 of each leg [–].
        vx_1, vz_1, vx_2, vz_2: velocities [m/s].
        cos_rate_1, sin_rate_1, cos_rate_2, sin_rate_2: rates of the Euler parameters [1/s].
        bristle_1, bristle_2: see `AbstractBristleLaw` [–]; None where friction has no memory.
    """

    x_1: Scalar
    z_1: Scalar
    cos_half_1: Scalar
    sin_half_1: Scalar
    x_2: Scalar
    z_2: Scalar
    cos_half_2: Scalar
    sin_half_2: Scalar
    vx_1: Scalar
    vz_1: Scalar
    cos_rate_1: Scalar
    sin_rate_1: Scalar
    vx_2: Scalar
    vz_2: Scalar
    cos_rate_2: Scalar
    sin_rate_2: Scalar
    bristle_1: Scalar | None = None
    bristle_2: Scalar | None = None

    @property
    def theta_1(self) -> Scalar:
        """Angle of leg 1 [rad]."""
        return _angle(self.cos_half_1, self.sin_half_1)

    @property
    def theta_2(self) -> Scalar:
        """Angle of leg 2 [rad]."""
        return _angle(self.cos_half_2, self.sin_half_2)

    @property
    def omega_1(self) -> Scalar:
        """Rate of leg 1 [rad/s]."""
        return _rate(self.cos_half_1, self.sin_half_1, self.cos_rate_1, self.sin_rate_1)

    @property
    def omega_2(self) -> Scalar:
        """Rate of leg 2 [rad/s]."""
        return _rate(self.cos_half_2, self.sin_half_2, self.cos_rate_2, self.sin_rate_2)


LegsState: TypeAlias = RedundantState | EulerState
"""A state with coordinates of each leg."""

CompliantState: TypeAlias = MinimalState | LegsState
"""A state of a walker with laws of contact."""


class Leg(NamedTuple):
    """One leg as its own coordinates have it: the hip is where this leg says it is.

    Attributes:
        hip_x, hip_z: [m]. hip_vx, hip_vz: [m/s]. angle: [rad]. rate: [rad/s].
        sine, cosine: of the angle.
        bristle: None where friction has no memory.
    """

    hip_x: Scalar
    hip_z: Scalar
    hip_vx: Scalar
    hip_vz: Scalar
    angle: Scalar
    rate: Scalar
    sine: Scalar
    cosine: Scalar
    bristle: Scalar | None


def is_redundant(state: object) -> "TypeIs[LegsState]":
    """Whether a state has coordinates for each leg."""
    return isinstance(state, RedundantState | EulerState)


def legs_of(scene: AbstractWalkerScene, state: CompliantState) -> tuple[Leg, Leg]:
    """Both legs of a state of either formulation."""
    return _leg(scene, state, 1), _leg(scene, state, 2)


@state_type.register
def _(scene: RedundantScene) -> type[LegsState]:
    return EulerState if scene.orientation == "euler" else RedundantState


@kept_alone
def redundant_state(scene: RedundantScene, state: MinimalState) -> LegsState:
    """The consistent state of a redundant scene that is the same as a minimal one.

    Args:
        scene: says how orientations are written.
        state: a `State` or `BristleState`, leaves of any batch shape.

    Returns:
        A `RedundantState`, or an `EulerState` where the scene has Euler parameters.
    """
    _, distance = leg_of(scene.walker)
    kind = state_type(scene)
    fields: dict[str, Scalar | None] = {}
    for leg, angle, rate in (
        ("1", state.theta_1, state.omega_1),
        ("2", state.theta_2, state.omega_2),
    ):
        sine, cosine = sine_cosine(angle)
        fields |= {
            f"x_{leg}": state.hip_x + distance * sine,
            f"z_{leg}": state.hip_z - distance * cosine,
            f"vx_{leg}": state.hip_vx + distance * cosine * rate,
            f"vz_{leg}": state.hip_vz + distance * sine * rate,
            f"bristle_{leg}": getattr(state, f"bristle_{leg}", None),
        }
        if kind is RedundantState:
            fields |= {f"theta_{leg}": angle, f"omega_{leg}": rate}
        else:
            s, c = sine_cosine(0.5 * angle)
            fields |= {
                f"cos_half_{leg}": c,
                f"sin_half_{leg}": s,
                f"cos_rate_{leg}": -0.5 * rate * s,
                f"sin_rate_{leg}": 0.5 * rate * c,
            }
    return kind(**fields)


def minimal_state(scene: AbstractWalkerScene, state: CompliantState) -> MinimalState:
    """The minimal state that a redundant one stands for: the hip half way between the legs' two.

    A minimal state is returned as it is.

    Args:
        scene: says how orientations are written.
        state: redundant or minimal, leaves of any common shape, SI units.

    Returns:
        A `State`, or a `BristleState` where there are bristles.
    """
    return _half_way(scene, state) if is_redundant(state) else state


@kept_alone
def _half_way(scene: AbstractWalkerScene, state: LegsState) -> MinimalState:
    one, two = legs_of(scene, state)
    values = dict(
        hip_x=0.5 * (one.hip_x + two.hip_x),
        hip_z=0.5 * (one.hip_z + two.hip_z),
        theta_1=one.angle,
        theta_2=two.angle,
        hip_vx=0.5 * (one.hip_vx + two.hip_vx),
        hip_vz=0.5 * (one.hip_vz + two.hip_vz),
        omega_1=one.rate,
        omega_2=two.rate,
    )
    if state.bristle_1 is None:
        return State(**values)
    return BristleState(
        **values, bristle_1=cast("Scalar", one.bristle), bristle_2=cast("Scalar", two.bristle)
    )


def _leg(scene: AbstractWalkerScene, state: CompliantState, number: int) -> Leg:
    def own(name: str) -> Scalar:
        return getattr(state, f"{name}_{number}")

    angle, rate = own("theta"), own("omega")
    sine, cosine = sine_cosine(angle)
    if is_redundant(state):
        _, distance = leg_of(scene.walker)
        x, z = own("x") - distance * sine, own("z") + distance * cosine
        vx, vz = own("vx") - distance * cosine * rate, own("vz") - distance * sine * rate
    else:
        x, z, vx, vz = state.hip_x, state.hip_z, state.hip_vx, state.hip_vz
    bristle = getattr(state, f"bristle_{number}", None)
    return Leg(x, z, vx, vz, angle, rate, sine, cosine, bristle)


def _angle(cosine: Scalar, sine: Scalar) -> Scalar:
    return 2.0 * jnp.arctan2(sine, cosine)


def _rate(cosine: Scalar, sine: Scalar, cosine_rate: Scalar, sine_rate: Scalar) -> Scalar:
    return 2.0 * (cosine * sine_rate - sine * cosine_rate) / (cosine * cosine + sine * sine)
