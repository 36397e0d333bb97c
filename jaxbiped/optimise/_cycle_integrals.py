"""Cycle integrals as cyclic coordinates: slip, losses, motors' work, depth of the swing foot.

A coordinate whose rate is the integrand, and on which no rate depends, gains the integral over a
cycle. The return map then has its value, its derivatives and their errors from one solve.
"""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import Scalar, Time
from jaxbiped.dynamics._actuation import actuator_powers
from jaxbiped.dynamics._contacts import feet
from jaxbiped.dynamics._energy import is_driven, powers
from jaxbiped.dynamics._footfalls import touches
from jaxbiped.dynamics._impact import impact
from jaxbiped.dynamics._push_off import push_off_work
from jaxbiped.dynamics._rolling import rolling_hip_motion
from jaxbiped.dynamics._stance import kinetic_energy
from jaxbiped.dynamics._strike_surfaces import clearance
from jaxbiped.dynamics._switches import Switch
from jaxbiped.optimise._augmented_system import AbstractAugmentedSystem, join, motion_of
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.variational._hybrid_system import Rolling, Walking

COMPLIANT = ("slip_distance", "friction_loss", "impact_loss")
"""Integrals of a walker with laws of contact."""
RIGID = ("impact_loss",)
"""Those of the rigid walker."""
MOTOR_WORK = "motor_work"
"""What a driven walker of either kind has beside them."""


def _driving(motors: tuple[Scalar, ...], like: Scalar) -> Scalar:
    """Power of the motors that drive, added up [W]: none gains energy by braking."""
    power = jnp.zeros_like(like)
    for motor in motors:
        power = power + jnp.maximum(motor, 0.0)
    return power


class WalkingIntegrals(AbstractAugmentedSystem):
    """`Walking` with its integrals; its load is the depth of a foot that swings [m].

    Attributes:
        walker: that system.
        coordinates: names of the integrals.
    """

    walker: Walking
    coordinates: tuple[str, ...] = eqx.field(static=True)

    def vector_field(self, t: Time, y: PyTree, args: Scene) -> PyTree:
        state = motion_of(y)
        power = powers(args, state)
        slip = jnp.zeros_like(state[0])
        for foot in feet(args, state):
            slip = slip + jnp.where(touches(foot), jnp.abs(foot.slip_speed), 0.0)
        rates = {
            "slip_distance": slip,
            "friction_loss": power.friction,
            "impact_loss": power.indentation,
        }
        if power.motors is not None:
            rates[MOTOR_WORK] = _driving(power.motors, slip)
        return join(y, self.walker.vector_field(t, state, args), rates)

    def switches(self, args: Scene, y: PyTree) -> tuple[Switch, ...]:
        """The walker's, touchdown as a jump of the rate of slip, and changes of sign.

        Those of slip, and of each motor's power.
        """
        state = motion_of(y)
        own = self.walker.switches(args, state)
        for foot in feet(args, state):
            admitted = True if foot.admitted is None else foot.admitted
            own += (Switch(foot.penetration, admitted, force_jumps=True),)
            own += (Switch(foot.slip_speed, touches(foot)),)
        motors = powers(args, state).motors or ()
        return own + tuple(Switch(power, True) for power in motors)

    def ending(self, args: Scene, y: PyTree) -> Scalar:
        return self.walker.ending(args, motion_of(y))

    def reset_map(self, args: Scene, y: PyTree) -> PyTree:
        gained = {name: getattr(y, name) for name in self.coordinates}
        return join(y, self.walker.reset_map(args, motion_of(y)), gained)

    def load(self, args: Scene, y: PyTree) -> Scalar:
        """How deep a foot is underground that the clearance rule lets pass [m]."""
        none = -args.mechanism.height
        found = none
        for foot in feet(args, motion_of(y)):
            if foot.admitted is not None and foot.admitted is not False:
                admitted = jnp.asarray(foot.admitted)
                found = jnp.maximum(found, jnp.where(admitted, none, foot.penetration))
        return found


class RollingIntegrals(AbstractAugmentedSystem):
    """`Rolling` with the energy that impacts take; its load is the swing foot's depth [m].

    The work of motors is that of the push-off, too.

    Attributes:
        walker: that system.
        coordinates: names of the integrals.
    """

    walker: Rolling
    coordinates: tuple[str, ...] = eqx.field(static=True)

    def vector_field(self, t: Time, y: PyTree, args: RigidScene) -> PyTree:
        state = motion_of(y)
        rates = {"impact_loss": jnp.zeros_like(state[0])}
        if MOTOR_WORK in self.coordinates:
            rates[MOTOR_WORK] = _driving(_rolling_motors(args, state), state[0])
        return join(y, self.walker.vector_field(t, state, args), rates)

    def switches(self, args: RigidScene, y: PyTree) -> tuple[Switch, ...]:
        """Each motor's change of sign."""
        return tuple(Switch(power, True) for power in _rolling_motors(args, motion_of(y)))

    def ending(self, args: RigidScene, y: PyTree) -> Scalar:
        return self.walker.ending(args, motion_of(y))

    def reset_map(self, args: RigidScene, y: PyTree) -> PyTree:
        state = motion_of(y)
        after = impact(args, state).state
        push = push_off_work(args, state)
        lost = kinetic_energy(args, state) + push - kinetic_energy(args, after)
        gained = {"impact_loss": y.impact_loss + lost}
        if MOTOR_WORK in self.coordinates:
            gained[MOTOR_WORK] = y.motor_work + jnp.maximum(push, 0.0)
        return join(y, after, gained)

    def load(self, args: RigidScene, y: PyTree) -> Scalar:
        """How deep the swing foot is underground [m]."""
        return -clearance(args, motion_of(y))


def _rolling_motors(scene: RigidScene, state: Any) -> tuple[Scalar, ...]:
    """Power of each motor at the hip of the walker that rolls on leg 2 [W]."""
    if scene.actuation is None:
        return ()
    return actuator_powers(scene, rolling_hip_motion(scene, state)).motors


def integrals_of(scene: Scene | RigidScene) -> WalkingIntegrals | RollingIntegrals:
    """The walker with its integrals."""
    driven = (MOTOR_WORK,) if is_driven(scene) else ()
    if scene.compliant:
        return WalkingIntegrals(Walking(), (*COMPLIANT, *driven))
    return RollingIntegrals(Rolling(), (*RIGID, *driven))
