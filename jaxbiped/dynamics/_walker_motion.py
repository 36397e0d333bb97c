"""Walker's motion as costs and constraints see it: angles, rates, motor torques, ground forces."""

import functools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp

from jaxbiped._checks import ArgumentError, check_choice
from jaxbiped._types import Scalar
from jaxbiped.dynamics._actuation import Carriers, hip_actuators, motor_torques
from jaxbiped.dynamics._contacts import FootForce, feet, foot_force
from jaxbiped.dynamics._energy import in_driven_motion, is_driven
from jaxbiped.dynamics._equivalent_states import poses_of, whole_state
from jaxbiped.dynamics._impact import push_off_impulse
from jaxbiped.dynamics._stance import of_stance
from jaxbiped.dynamics._stance_motion import rolling
from jaxbiped.dynamics._surfaces import clearance
from jaxbiped.dynamics._tree import Motion
from jaxbiped.scene._joint_parts import Motor
from jaxbiped.scene._mechanism_pieces import named_sum
from jaxbiped.scene._motor_motion import angle_value
from jaxbiped.scene._state_types import CLOCK
from jaxbiped.scene._structure import Angle
from jaxbiped.scene.actuation._actuators import HipMotion, known_time


class Drive(NamedTuple):
    """A torque of a motor on an angle.

    Attributes:
        torque: the torque [N·m], positive where it increases the angle.
        rate: the rate of the angle [rad/s].
    """

    torque: Scalar
    rate: Scalar

    @property
    def power(self) -> Scalar:
        """Power of the torque [W]."""
        return self.torque * self.rate


class WalkerMotion(NamedTuple):
    """A walker's state on its scene, as functions of the motion see it.

    Attributes:
        scene: the walker on its ground.
        state: of the scene's kind, leaves of any common shape.
    """

    scene: Any
    state: Any

    def angle(self, angle: Any) -> Scalar:
        """An angle [rad]: of a body from the one it hangs on, or weighted by name as in `Motor`.

        Raises:
            ArgumentError: a name that is no body, "normal" or "vertical".
        """
        motion = self._bodies()
        return angle_value(self._named(angle), motion.angles, self.scene.ground.slope)

    def rate(self, angle: Any) -> Scalar:
        """The rate of such an angle [rad/s]."""
        return angle_value(self._named(angle), self._bodies().rates, None)

    @property
    def time(self) -> Scalar:
        """Time since the last strike [s].

        Raises:
            ArgumentError: no law of the scene reads it, so that its states have no clock.
        """
        return known_time(getattr(self.state, CLOCK, None))

    def motors(self) -> dict[str, tuple[Drive, ...]]:
        """The torques of every motor by its name, one for each angle on which it acts.

        A motor at a joint is called by its `name`, without one "motor"; an actuator at the hip by
        its class's. One between the legs acts on the angle between them; one against a trunk that
        is not modelled acts on each leg's.
        """
        if not is_driven(self.scene):
            return {}
        return in_driven_motion(self.scene, self.state, functools.partial(_torques, self.scene))

    def motor(self, name: str) -> tuple[Drive, ...]:
        """The torques of one motor by its name, as `motors` has them.

        Raises:
            ArgumentError: a name that is no motor's.
        """
        torques = self.motors()
        check_choice("motor", name, tuple(torques))
        return torques[name]

    def torque(self, motor: str) -> Scalar:
        """The torque of a motor that acts on one angle [N·m], by the motor's name.

        Raises:
            ArgumentError: a name that is no motor's, or a motor that acts on several angles.
        """
        torques = self.motor(motor)
        if len(torques) > 1:
            raise ArgumentError(
                f"motor = {motor!r} is not allowed: it acts on {len(torques)} angles; take its "
                "torques from motion.motors()."
            )
        return torques[0].torque

    def power(self, motor: str) -> Scalar:
        """The power of a motor [W], by its name.

        Raises:
            ArgumentError: a name that is no motor's.
        """
        first, *others = (each.power for each in self.motor(motor))
        return sum(others, first)

    def ground_force(self) -> FootForce:
        """The ground's reaction on all feet together [N]."""
        if not self.scene.compliant:
            return rolling(self.scene, self.state).force
        normal = tangential = 0.0 * self.state[0]
        for foot in feet(self.scene, self.state):
            force = foot_force(self.scene, foot)
            normal = normal + force.normal
            if force.tangential is not None:
                tangential = tangential + force.tangential
        return FootForce(normal, tangential)

    def clearance(self) -> Scalar:
        """Height of the swinging foot above the ground [m], negative where it passes underground.

        Of compliant feet it is the lowest of those that the clearance rule lets pass, and the
        walker's height where it lets none.
        """
        if not self.scene.compliant:
            return clearance(self.scene, self.state)
        lowest = none = self.scene.mechanism.height + 0.0 * self.state[0]
        for foot in feet(self.scene, self.state):
            if foot.admitted is not None and foot.admitted is not False:
                admitted = jnp.asarray(foot.admitted)
                lowest = jnp.minimum(lowest, jnp.where(admitted, none, -foot.penetration))
        return lowest

    def push_off(self) -> Scalar:
        """The push-off's impulse at a heel strike [N·s]; zero without one."""

        def size(stance: Any) -> Scalar:
            impulse = push_off_impulse(self.scene, stance)
            if impulse is None:
                return 0.0 * stance.pose.motion.x
            return (impulse.x**2 + impulse.z**2) ** 0.5

        return of_stance(self.scene, self.state, size)

    def _bodies(self) -> Motion:
        scene, state = self.scene, self.state
        placed = state if scene.compliant else whole_state(scene, state)
        return poses_of(scene, placed)[0].motion

    def _named(self, angle: Any) -> Angle:
        structure = self.scene.mechanism.structure
        return named_sum("angle", angle, structure.parents, structure.bodies)


def _torques(
    scene: Any,
    motion: Motion,
    carriers: Carriers,
    hip: Callable[[], HipMotion],
    pressing: Sequence[Scalar],
) -> dict[str, tuple[Drive, ...]]:
    by_name: dict[str, tuple[Drive, ...]] = {}
    for part in hip_actuators(scene):
        torques = part.motor_torques(now := hip())
        if torques is None:
            continue
        drives = tuple(map(Drive, torques, now.rate))
        if getattr(part, "reaction", "swing") == "swing":
            drives = (Drive(torques[0], now.rate[0] - now.rate[1]),)
        name = part.name or type(part).__name__
        by_name[name] = by_name.get(name, ()) + drives
    mechanism = scene.mechanism
    on_angle: dict[int, dict[Angle, Scalar]] = {}
    for number, angle, torque in motor_torques(mechanism, motion, scene.ground.slope, *carriers):
        # The legs' parts of a motor between them turn one angle, which each counts from its side.
        torques_of, turned = on_angle.setdefault(number, {}), _without_vertical(angle)
        if turned.reversed() in torques_of:
            turned, torque = turned.reversed(), -torque
        torques_of[turned] = torques_of[turned] + torque if turned in torques_of else torque
    for number, torques_of in on_angle.items():
        motor = mechanism.joints[number]
        assert isinstance(motor, Motor)
        by_name[motor.name or motor.kind] = tuple(
            Drive(torque, angle_value(angle, motion.rates, None))
            for angle, torque in torques_of.items()
        )
    return by_name


def _without_vertical(angle: Angle) -> Angle:
    """An angle that is equal to those with the same rate."""
    return Angle(tuple(sorted(angle.weights)))
