"""Hybrid systems of the literature on nonsmooth motion, as users of `jb.hybrid` write them."""

from types import MappingProxyType
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

import jaxbiped as jb

At, Guard, HybridSystem = jb.hybrid.At, jb.hybrid.Guard, jb.hybrid.HybridSystem
parameter = jb.laws.parameter


class Bounce(NamedTuple):
    """A ball over a table.

    Attributes:
        height, speed: of the ball [m, m/s].
        phase: of the table [rad].
    """

    height: Any
    speed: Any
    phase: Any

    own_units = MappingProxyType({"height": "m", "speed": "m/s", "phase": "rad"})
    periodic = MappingProxyType({"phase": 2.0 * np.pi})


class BouncingBall(HybridSystem):
    """A ball on a table that vibrates. Guckenheimer and Holmes (1983), section 2.4."""

    state_type = Bounce
    gravity: float = parameter("gravity", "$g$", "m/s^2", default=9.81)
    restitution: float = parameter("restitution", "$e$", default=0.5)
    amplitude: float = parameter("amplitude", "$A$", "m", default=0.03)
    frequency: float = parameter("angular frequency", r"$\omega$", "rad/s", default=6.0 * np.pi)

    def rates(self, y: Bounce) -> Bounce:
        return Bounce(y.speed, -self.gravity, self.frequency)

    def gap(self, y: Bounce) -> Any:
        return y.height - self.amplitude * jnp.sin(y.phase)

    def bounce(self, y: Bounce) -> Bounce:
        table = self.amplitude * self.frequency * jnp.cos(y.phase)
        return y._replace(speed=table - self.restitution * (y.speed - table))

    def guards(self) -> tuple[Guard, ...]:
        return (Guard("impact", self.gap, reset=self.bounce),)

    def one_period(self) -> Bounce:
        """The state behind the impact of the orbit with one impact in a period, in closed form."""
        e, period = self.restitution, 2.0 * np.pi / self.frequency
        speed = 0.5 * self.gravity * period
        phase = np.arccos((1.0 - e) / (1.0 + e) * speed / (self.amplitude * self.frequency))
        return Bounce(self.amplitude * np.sin(phase), speed, phase)


class Oscillation(NamedTuple):
    """A driven mass on a spring.

    Attributes:
        place, speed: of the mass.
        phase: of the force [rad].
    """

    place: Any
    speed: Any
    phase: Any

    periodic = MappingProxyType({"phase": 2.0 * np.pi})


class ImpactOscillator(HybridSystem):
    """A driven mass on a spring that strikes a stop. Nordmark (1991), J. Sound Vib. 145, 279."""

    state_type = Oscillation
    damping: float = parameter("damping ratio", r"$\zeta$", default=0.05)
    force: float = parameter("force", "$F$", default=1.0)
    frequency: float = parameter("angular frequency", r"$\omega$", default=0.8)
    stop: float = parameter("place of the stop", r"$\sigma$", default=1.5)
    restitution: float = parameter("restitution", "$r$", default=0.8)

    def rates(self, y: Oscillation) -> Oscillation:
        pull = self.force * jnp.cos(y.phase) - y.place - 2.0 * self.damping * y.speed
        return Oscillation(y.speed, pull, self.frequency)

    def guards(self) -> tuple[Guard, ...]:
        def impact(y: Oscillation) -> Oscillation:
            return y._replace(speed=-self.restitution * y.speed)

        return (Guard("impact", lambda y: self.stop - y.place, reset=impact),)

    def response(self) -> float:
        """Amplitude of the motion that strikes nothing: at a stop there it grazes."""
        detuned, damped = 1.0 - self.frequency**2, 2.0 * self.damping * self.frequency
        return float(self.force / np.hypot(detuned, damped))


class Sliding(NamedTuple):
    """A mass on a belt.

    Attributes:
        place, speed: of the mass.
        sticks: 1 where the belt carries it along, else 0.
    """

    place: Any
    speed: Any
    sticks: Any

    modes = ("sticks",)


class BeltFriction(HybridSystem):
    """A mass on a spring that a belt carries along, by Stribeck friction.

    Leine, van Campen, de Kraker and van den Steen (1998), Nonlinear Dynamics 16, 41. Unit mass and
    stiffness.
    """

    state_type = Sliding
    belt: float = parameter("speed of the belt", "$v$", default=0.2)
    static: float = parameter("static friction", "$F_s$", default=1.0)
    stribeck: float = parameter("Stribeck's rate", r"$\gamma$", default=3.0)

    def rates(self, y: Sliding) -> Sliding:
        # The mass is slower than the belt: beyond its guards each mode's field goes on smoothly.
        friction = self.static / (1.0 + self.stribeck * (self.belt - y.speed))
        sticks = y.sticks > 0.5
        speed = jnp.where(sticks, self.belt, y.speed)
        return Sliding(speed, jnp.where(sticks, 0.0, friction - y.place), 0.0)

    def guards(self) -> tuple[Guard, ...]:
        def stick(y: Sliding) -> Sliding:
            return y._replace(speed=self.belt, sticks=1.0)

        def holds(y: Sliding) -> Any:
            return (y.sticks < 0.5) & (jnp.abs(y.place) < self.static)

        return (
            Guard("sticks", lambda y: self.belt - y.speed, armed=holds, reset=stick),
            Guard(
                "slips",
                lambda y: self.static - y.place,
                armed=lambda y: y.sticks > 0.5,
                reset=lambda y: y._replace(sticks=0.0),
            ),
        )


class Running(NamedTuple):
    """A point mass with a leg.

    Attributes:
        x, height, forward, upward: of the mass [m, m/s].
        reach: how far it is in front of its foot; 0 in flight [m].
        stands: 1 where the foot stands, else 0.
    """

    x: Any
    height: Any
    forward: Any
    upward: Any
    reach: Any
    stands: Any

    own_units = MappingProxyType(
        {"x": "m", "height": "m", "forward": "m/s", "upward": "m/s", "reach": "m"}
    )
    cyclic = ("x",)
    modes = ("stands",)


class SpringLegRunner(HybridSystem):
    """A point mass on a massless spring leg that is put down at a fixed angle.

    Seyfarth, Geyer, Günther and Blickhan (2002), J. Biomechanics 35, 649.
    """

    state_type = Running
    stiffness: float = parameter("leg stiffness", "$k$", "N/m", default=20e3)
    mass: float = parameter("mass", "$m$", "kg", default=80.0)
    length: float = parameter("leg length", "$l$", "m", default=1.0)
    attack: float = parameter("angle of attack", r"$\alpha$", "rad", default=np.deg2rad(68.0))
    gravity: float = parameter("gravity", "$g$", "m/s^2", default=9.81)

    def rates(self, y: Running) -> Running:
        leg = jnp.sqrt(y.reach**2 + y.height**2)
        stiff = jnp.where(y.stands > 0.5, self.stiffness / self.mass, 0.0)
        push = stiff * (self.length / leg - 1.0)
        reach = jnp.where(y.stands > 0.5, y.forward, 0.0)
        return Running(
            y.forward, y.upward, push * y.reach, push * y.height - self.gravity, reach, 0.0
        )

    def guards(self) -> tuple[Guard, ...]:
        def put_down(y: Running) -> Running:
            return y._replace(reach=-self.length * jnp.cos(self.attack), stands=1.0)

        return (
            Guard(
                "touchdown",
                lambda y: y.height - self.length * jnp.sin(self.attack),
                armed=lambda y: y.stands < 0.5,
                reset=put_down,
            ),
            Guard(
                "lift off",
                lambda y: self.length - jnp.sqrt(y.reach**2 + y.height**2),
                armed=lambda y: y.stands > 0.5,
                reset=lambda y: y._replace(reach=0.0, stands=0.0),
            ),
            Guard("fell", lambda y: y.height, ends=True),
        )

    def energy(self, y: Running) -> Any:
        """Of the mass and of the spring [J]."""
        squeezed = self.length - np.sqrt(np.square(y.reach) + np.square(y.height))
        kinetic = 0.5 * self.mass * (np.square(y.forward) + np.square(y.upward))
        spring = np.where(np.asarray(y.stands) > 0.5, 0.5 * self.stiffness * squeezed**2, 0.0)
        return kinetic + spring + self.mass * self.gravity * np.asarray(y.height)


APEX = jb.Section(lambda system, y: -y.upward, condition=lambda system, y: y.stands < 0.5)
"""Where a runner is highest in flight."""


class Relayed(NamedTuple):
    """States of a linear system, and its input, which a relay gives."""

    slow: Any
    fast: Any
    input: Any

    modes = ("input",)


class RelayFeedback(HybridSystem):
    """A stable linear system under relay feedback with hysteresis.

    Åström (1995), in Adaptive Control, Filtering and Signal Processing, p. 1. With hysteresis 0.1
    its half period is ln 3, and its multiplier over half a period 1/27.
    """

    state_type = Relayed
    slow: float = parameter("slow rate", default=1.0)
    fast: float = parameter("fast rate", default=2.0)
    hysteresis: float = parameter("hysteresis", default=0.1)

    def rates(self, y: Relayed) -> Relayed:
        return Relayed(y.input - self.slow * y.slow, y.input - self.fast * y.fast, 0.0)

    def image(self, y: Relayed) -> Relayed:
        return Relayed(-y.slow, -y.fast, -y.input)

    def guards(self) -> tuple[Guard, ...]:
        return (
            Guard(
                "rises",
                lambda y: y.slow - y.fast - self.hysteresis,
                direction=1,
                armed=lambda y: y.input > 0.0,
                reset=lambda y: y._replace(input=-1.0),
            ),
            Guard(
                "falls",
                lambda y: y.slow - y.fast + self.hysteresis,
                armed=lambda y: y.input < 0.0,
                reset=lambda y: y._replace(input=1.0),
            ),
        )


class Voltage(NamedTuple):
    """Of van der Pol's oscillator, and its rate."""

    value: Any
    rate: Any


class VanDerPol(HybridSystem):
    """Van der Pol's oscillator, x'' = μ (1 − x²) x' − x, without guards."""

    state_type = Voltage
    time_unit = 1e3
    mu: float = parameter("nonlinearity", r"$\mu$", default=1e3)

    def rates(self, y: Voltage) -> Voltage:
        return Voltage(y.rate, self.mu * (1.0 - y.value**2) * y.rate - y.value)

    def asymptotic_period(self) -> float:
        """For large μ, to O(ln μ / μ). Dorodnicyn (1947), with the first zero of Airy's Ai."""
        mu, zero = float(self.mu), 2.338107410459767
        return float((3.0 - 2.0 * np.log(2.0)) * mu + 3.0 * zero / np.cbrt(mu))


RELAXED = jb.Section(lambda system, y: 1.5 - y.value)
"""On the slow part of van der Pol's relaxation oscillation, as it falls."""
