"""Motion that a motor's law sees, and what laws must not tell apart: the images of a motion."""

import contextlib
import functools
import math
from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxbiped._checks import LIBRARIES, ArgumentError
from jaxbiped._jax_versions import untraced
from jaxbiped._types import Scalar, is_traced
from jaxbiped.caching._known_by_shape import known_by_shape
from jaxbiped.compiler import kept_alone
from jaxbiped.scene._joint_parts import Motor
from jaxbiped.scene._mechanism_pieces import named_sum, with_fixed
from jaxbiped.scene._structure import Angle, Indices, Structure
from jaxbiped.scene.actuation._actuators import (
    AbstractHipActuator,
    HipMotion,
    UnknownTimeError,
    known_time,
)

_NUMBERS = 1000
"""Numbers in random motions, as many as NumPy runs a function of."""
_ROUNDING = 1e-9


def angle_value(angle: Angle, values: Sequence[Scalar], vertical: Scalar | None) -> Scalar:
    """A sum of angles, or of rates, for which `vertical` is None."""
    total = angle.of(values, vertical)
    return jnp.zeros_like(values[0]) if total is None else total


class MotorMotion(NamedTuple):
    """A motion as a motor's law sees it; see `JointMotion`.

    Attributes:
        structure: of the mechanism.
        angles: of all bodies [rad], exchanged where the law's sides are.
        rates: of all bodies [rad/s], likewise.
        slope: angle of the vertical [rad].
        joint: the motor's angle.
        stance: line of the leg that stands; None where no leg does.
        clock: time since the last strike [s]; None where no law reads it.
    """

    structure: Structure
    angles: Sequence[Scalar]
    rates: Sequence[Scalar]
    slope: Scalar
    joint: Angle
    stance: Any
    clock: Scalar | None = None

    @property
    def angle(self) -> Scalar:
        """The motor's own angle [rad]."""
        return angle_value(self.joint, self.angles, self.slope)

    @property
    def rate(self) -> Scalar:
        """Its rate [rad/s]."""
        return angle_value(self.joint, self.rates, None)

    def of(self, angle: Any) -> tuple[Scalar, Scalar]:
        """Value [rad] and rate [rad/s] of a body's angle by its name, or of weighted angles.

        Raises:
            ArgumentError: a name that is no body, "normal" or "vertical".
        """
        read = named_sum("motion.of", angle, self.structure.parents, self.structure.bodies)
        return angle_value(read, self.angles, self.slope), angle_value(read, self.rates, None)

    @property
    def phase(self) -> Scalar:
        """Minus the angle of the leg that stands [rad]."""
        return -self._stance().angle

    @property
    def phase_rate(self) -> Scalar:
        """Its rate [rad/s]."""
        return -self._stance().rate

    @property
    def time(self) -> Scalar:
        """Time since the last strike [s]."""
        return known_time(self.clock)

    def _stance(self) -> Any:
        if self.stance is None:
            raise ArgumentError(
                "motion.phase is not known for a motor by side, or of a mechanism without a "
                "mirror: read an angle by motion.of instead."
            )
        return self.stance


def exchange_of(structure: Structure) -> Indices:
    """Number of the body whose role each body takes where the sides of the mirror are exchanged."""
    twin = list(range(len(structure.bodies)))
    for one, other in structure.pairs:
        twin[one], twin[other] = other, one
    return tuple(twin)


def check_images(mechanism: Any) -> None:
    """Raises `ArgumentError` for a law that differs at motions which its mechanism takes for alike.

    Laws are evaluated at random motions and at their images by the mirror or the turn. Those by
    role are their own images, and numbers that JAX traces cannot be compared.
    """
    s = mechanism.structure
    parts = [part for part in mechanism.joints if _acts_by_side(part, s)]
    symmetric = s.joint_twins is not None or s.turn is not None
    if parts and symmetric and not is_traced(mechanism.joints):
        count = _NUMBERS // (2 * len(s.bodies) + 1)
        motions = np.random.default_rng(0).uniform(-1.0, 1.0, (count, 2 * len(s.bodies) + 1))
        motions[::2] *= 0.1  # of every second one all angles are small
        words = [f"the law of Motor({part.angle!r})" for part in parts]
        symmetry = "turn" if s.joint_twins is None else "mirror"
        _check_alike(words, symmetry, _torques_at_images, mechanism, motions)


def check_legs_alike(actuation: Any) -> None:
    """Raises `ArgumentError` for an actuator at the hip that tells one leg from the other."""
    draw = np.random.default_rng(0).uniform
    for part in actuation or ():
        name, package = type(part).__name__, type(part).__module__.partition(".")[0]
        users = package not in LIBRARIES
        if users and isinstance(part, AbstractHipActuator) and not is_traced(part):
            for load in (tuple(draw(0.0, 0.5, (2, 100))), (None, np.ones(100))):
                angle, rate = map(tuple, draw(-1.0, 1.0, (2, 2, 100)))
                hip = HipMotion(angle, rate, load).timed(np.linspace(0.0, 1.0, 100))  # type: ignore[arg-type]
                _check_alike([name, name], "mirror", _torques_of_legs, part, hip)


def reads_time(mechanism: Any, actuation: Any) -> bool:
    """Whether the law of a motor, or an actuator at the hip, reads the time since a strike."""
    parts = [part for part in actuation or () if isinstance(part, AbstractHipActuator)]
    return bool(parts or mechanism.has_motors) and _reads_time(mechanism, parts)


@known_by_shape
def _reads_time(mechanism: Any, parts: list[AbstractHipActuator]) -> bool:
    s, zero = mechanism.structure, jnp.zeros(())
    at_rest, pair = [zero] * len(s.bodies), (zero, zero)
    hip = HipMotion(pair, pair, pair)
    torques: list[Callable[[], Any]] = [functools.partial(part.torques, hip) for part in parts]
    for part, joint in zip(mechanism.joints, s.joints, strict=True):
        if isinstance(part, Motor):
            line = None if _acts_by_side(part, s) else SimpleNamespace(angle=zero, rate=zero)
            motion = MotorMotion(s, at_rest, at_rest, zero, joint, line)
            torques.append(functools.partial(part.law, motion))
    return any(map(_asks_for_time, torques))


def _asks_for_time(evaluate: Callable[[], Any]) -> bool:
    try:
        evaluate()
    except UnknownTimeError:
        return True
    except Exception:
        return False  # it is refused where it acts
    return False


def _check_alike(
    words: Sequence[str], symmetry: str, at_images: Callable[..., Any], part: Any, motions: Any
) -> None:
    """Raises `ArgumentError` where torques at motions and images, (n, 2, len(words)), differ."""
    torques = images = np.zeros((1, 1))
    with contextlib.suppress(Exception), untraced():  # a law that fails is refused where it acts
        torques, images = np.moveaxis(np.asarray(at_images(part, motions)), 1, 0)
    off = np.nan_to_num(np.abs(torques - images))
    if np.max(off) > _ROUNDING * np.max(np.nan_to_num(np.abs(torques))):
        worst = np.unravel_index(np.argmax(off), off.shape)
        raise ArgumentError(
            f"{words[int(worst[1])]} gives {torques[worst]:.4g} N m at a motion and "
            f"{images[worst]:.4g} N m at its image by the {symmetry}, which is not allowed: treat "
            f"both alike, or leave the {symmetry} out."
        )


def _acts_by_side(part: Any, structure: Structure) -> bool:
    return isinstance(part, Motor) and (part.by == "side" or not structure.pairs)


@kept_alone
def _torques_at_images(mechanism: Any, motions: Any) -> Any:
    """Computes torques by side [N·m] at motions (n, 2 bodies + 1), and of twins at images."""
    s, joints, count = mechanism.structure, mechanism.joints, len(mechanism.structure.bodies)
    twin = range(count) if s.body_twins is None else s.body_twins
    motors = [k for k, part in enumerate(joints) if _acts_by_side(part, s)]
    twins = motors if s.joint_twins is None else [s.joint_twins[k] for k in motors]

    def torques(values: Any) -> Any:
        slope = values[-1]
        angles = with_fixed(s, values[:count], slope, joints)
        rates = with_fixed(s, values[count:-1])
        turned = [angles[j] for j in twin]
        if s.turn is not None:
            turned[s.turn.body] += 2.0 * math.pi / s.turn.order
        images = (motors, (angles, rates)), (twins, (turned, [rates[j] for j in twin]))
        return [
            [
                joints[k].law(MotorMotion(s, *seen, slope, s.joints[k], None, jnp.abs(slope)))
                for k in numbers
            ]
            for numbers, seen in images
        ]

    return jax.vmap(lambda values: jnp.asarray(torques(values)))(motions)


@kept_alone
def _torques_of_legs(part: AbstractHipActuator, hip: HipMotion) -> Any:
    """Computes torques [N·m] at motions and, exchanged back, at images, shape (n, 2, 2)."""

    def torques(hip: HipMotion) -> Any:
        swapped = hip._replace(angle=hip.angle[::-1], rate=hip.rate[::-1], load=hip.load[::-1])
        return jnp.asarray([part.torques(hip), part.torques(swapped)[::-1]])

    return jax.vmap(torques)(hip)
