"""Hip spring: spring and damper between the legs."""

import dataclasses
from typing import ClassVar, Self

from jaxbiped._parameter import parameter
from jaxbiped._types import Parameter
from jaxbiped.scene.actuation._abstract_actuator import AbstractHipActuator, HipMotion, LegTorques


class HipSpring(AbstractHipActuator):
    """A torque −k (θ − θ0) − b θ̇ on the swing leg, the opposite on the other; θ is between them.

    Without a rest angle nothing drives it, and it is the same in either leg's stance. A rest angle
    that is always ahead of the stance leg takes a motor, whose part is the torque k θ0; it changes
    sides with the load.

    Source: Kuo 2002, Energetics of actively powered locomotion using the simplest walking model,
    whose hip spring has no damper.

    Attributes (leaves of any batch shape):
        k: stiffness [N·m/rad].
        b: damping [N·m·s/rad].
        theta_0: how far the swing leg is ahead of the stance leg at rest [rad]; None for 0 and no
            motor.

    Raises:
        ArgumentError: k or b below 0.
    """

    name: ClassVar[str] = "hip-spring"
    k: Parameter = parameter("hip stiffness", "$k$", "N m/rad", minimum=0.0)
    b: Parameter = parameter("hip damping", "$b$", "N m s/rad", minimum=0.0, default=0.0)
    theta_0: Parameter | None = parameter("hip's rest angle", r"$\theta_0$", "rad", default=None)

    def torques(self, hip: HipMotion) -> LegTorques:
        on_leg_1 = -self.k * (hip.angle[0] - hip.angle[1]) - self.b * (hip.rate[0] - hip.rate[1])
        motor = self.motor_torques(hip)
        if motor is not None:
            on_leg_1 = on_leg_1 + motor[0]
        return on_leg_1, -on_leg_1

    def motor_torques(self, hip: HipMotion) -> LegTorques | None:
        if self.theta_0 is None:
            return None
        first, second = (0.0 if load is None else load for load in hip.load)
        torque = self.k * self.theta_0 * (second - first)
        return torque, -torque

    def idle(self) -> Self:
        return dataclasses.replace(self, k=0.0 * self.k, b=0.0 * self.b)
