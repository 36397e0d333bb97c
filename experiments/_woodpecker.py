"""The woodpecker toy: a bird on a spring, whose sleeve slides, sticks and lifts off along a pole.

The model of Glocker and Studer, "Formulation and preparation for numerical evaluation of linear
complementarity systems in dynamics", Multibody System Dynamics 13 (2005), 447-463: three
coordinates, the beak's impact on the pole, and impacts and Coulomb friction at the sleeve's lower
and upper edge. Parameters as in the example "Woodpecker" of Siconos (WoodPeckerConsts.h).
"""

from typing import Any, NamedTuple

import jax.numpy as jnp

import jaxbiped as jb
from jaxbiped.hybrid import Guard, HybridSystem

parameter = jb.laws.parameter


class Woodpecker(NamedTuple):
    """Height of the sleeve [m], its tilt and the bird's [rad], and their rates.

    `edge` is the sleeve's edge that touches the pole: -1 the lower, 1 the upper one, 0 none;
    `slip` tells which way it slides: 1 up, -1 down, 0 where it sticks or nothing touches.
    """

    height: Any
    sleeve: Any
    bird: Any
    speed: Any
    sleeve_rate: Any
    bird_rate: Any
    edge: Any
    slip: Any

    cyclic = ("height",)
    modes = ("edge", "slip")
    scales = {  # noqa: RUF012
        "height": 0.02,
        "sleeve": 0.1,
        "bird": 0.3,
        "speed": 0.3,
        "sleeve_rate": 20.0,
        "bird_rate": 10.0,
    }


class WoodpeckerToy(HybridSystem):
    """A bird on a spring at a sleeve that falls along a pole, and jams on it."""

    state_type = Woodpecker
    time_unit = 0.01
    sleeve_mass: float = parameter("mass of the sleeve", "$m_M$", "kg", default=0.0003)
    bird_mass: float = parameter("mass of the bird", "$m_S$", "kg", default=0.0045)
    sleeve_inertia: float = parameter("inertia of the sleeve", "$J_M$", "kg m^2", default=5e-9)
    bird_inertia: float = parameter("inertia of the bird", "$J_S$", "kg m^2", default=7e-7)
    stiffness: float = parameter("stiffness of the spring", "$c_\\phi$", "N m/rad", default=0.0056)
    gravity: float = parameter("gravity", "$g$", "m/s^2", default=9.81)
    pole: float = parameter("radius of the pole", "$r_O$", "m", default=0.0025)
    sleeve_radius: float = parameter("inner radius of the sleeve", "$r_M$", "m", default=0.0031)
    sleeve_height: float = parameter("half the sleeve's height", "$h_M$", "m", default=0.0058)
    spring: float = parameter("from the sleeve to the spring", "$l_M$", "m", default=0.010)
    arm: float = parameter("from the spring to the bird", "$l_G$", "m", default=0.015)
    beak_height: float = parameter("beak above the bird", "$h_S$", "m", default=0.02)
    beak_length: float = parameter("beak before the bird", "$l_S$", "m", default=0.0201)
    restitution: float = parameter("restitution of the beak", "$\\epsilon_{N1}$", default=0.5)
    friction: float = parameter("friction", "$\\mu$", default=0.3)

    @property
    def tilt(self):
        """Of the sleeve where an edge touches [rad]."""
        return (self.sleeve_radius - self.pole) / self.sleeve_height

    @property
    def reach(self):
        """Of the bird's angle where its beak touches [rad]."""
        return (self.spring + self.arm - self.beak_length - self.pole) / self.beak_height

    def response(self, force, sleeve, bird):
        """Accelerations by a force on the sleeve and torques on both: the inverse mass matrix."""
        loads = (force, sleeve, bird)
        inertias = (self.sleeve_mass, self.sleeve_inertia, self.bird_inertia)
        arms = (1.0, self.spring, self.arm)  # by which the bird's place moves
        parts = list(zip(loads, inertias, arms, strict=True))
        along = sum(arm * load / inertia for load, inertia, arm in parts)
        against = 1.0 / self.bird_mass + sum(arm**2 / inertia for _, inertia, arm in parts)
        drag = along / against
        return tuple((load - arm * drag) / inertia for load, inertia, arm in parts)

    def stop(self, normal, tangent, rates, slip=None):
        """Forces, or impulses, by which a contact stops.

        Args:
            normal, tangent: coefficients of the opening's rate and of the sliding speed.
            rates: of the three coordinates, that would be without the contact; the opening's and
                the speed's, which become 0.
            slip: direction in which it slides, with friction; None: it sticks.
        """
        opens, slides = rates
        by_normal, by_tangent = self.response(*normal), self.response(*tangent)
        nn, nt, tt = _dot(normal, by_normal), _dot(normal, by_tangent), _dot(tangent, by_tangent)
        if slip is None:
            determinant = nn * tt - nt**2
            return (nt * slides - tt * opens) / determinant, (
                nt * opens - nn * slides
            ) / determinant
        pressed = -opens / (nn - slip * self.friction * nt)
        return pressed, -slip * self.friction * pressed

    def edge_contact(self, y):
        """Normal and tangent of the edge that touches, or of the upper one."""
        side = jnp.where(y.edge == 0.0, 1.0, y.edge)
        return (0.0, -side * self.sleeve_height, 0.0), (1.0, self.sleeve_radius, 0.0)

    def free_rates(self, y):
        twist = self.stiffness * (y.bird - y.sleeve)
        up, *turns = self.response(0.0, twist, -twist)
        return (up - self.gravity, *turns)

    def grip(self, y):
        """Pressure and friction at the edge that touches [N]."""
        normal, tangent = self.edge_contact(y)
        free = self.free_rates(y)
        rates = _dot(normal, free), _dot(tangent, free)
        stuck, sliding = (
            self.stop(normal, tangent, rates),
            self.stop(normal, tangent, rates, y.slip),
        )
        return tuple(jnp.where(y.slip == 0.0, a, b) for a, b in zip(stuck, sliding, strict=True))

    def rates(self, y):
        normal, tangent = self.edge_contact(y)
        pressure, drag = (jnp.where(y.edge == 0.0, 0.0, force) for force in self.grip(y))
        loads = (n * pressure + t * drag for n, t in zip(normal, tangent, strict=True))
        more = self.response(*loads)
        up, turn, bird = (a + b for a, b in zip(self.free_rates(y), more, strict=True))
        # What sticks, or touches, does not move by rounding either.
        up = jnp.where((y.edge != 0.0) & (y.slip == 0.0), 0.0, up)
        turn = jnp.where(y.edge == 0.0, turn, 0.0)
        return Woodpecker(y.speed, y.sleeve_rate, y.bird_rate, up, turn, bird, 0.0, 0.0)

    def struck(self, y, normal, tangent, restitution):
        """The state behind an impact with friction, and the direction in which it slides then."""
        rates = y.speed, y.sleeve_rate, y.bird_rate
        opens, slides = (1.0 + restitution) * _dot(normal, rates), _dot(tangent, rates)
        stuck = self.stop(normal, tangent, (opens, slides))
        slip = -jnp.sign(stuck[1]) * (jnp.abs(stuck[1]) > self.friction * stuck[0])
        sliding = self.stop(normal, tangent, (opens, slides), slip)
        pressed, drag = (jnp.where(slip == 0.0, *both) for both in zip(stuck, sliding, strict=True))
        change = self.response(
            *(n * pressed + t * drag for n, t in zip(normal, tangent, strict=True))
        )
        speed, sleeve_rate, bird_rate = (a + b for a, b in zip(rates, change, strict=True))
        return y._replace(speed=speed, sleeve_rate=sleeve_rate, bird_rate=bird_rate), slip

    def edge_strikes(self, y, side):
        y = y._replace(sleeve=side * self.tilt, edge=side)
        y, slip = self.struck(y, *self.edge_contact(y), 0.0)
        speed = jnp.where(slip == 0.0, 0.0, y.speed)
        return self.settled(y._replace(speed=speed, sleeve_rate=0.0, slip=slip))

    def beak_strikes(self, y):
        normal = (0.0, 0.0, -self.beak_height)
        tangent = (1.0, self.spring, self.arm - self.beak_length)
        return self.struck(y._replace(bird=self.reach), normal, tangent, self.restitution)[0]

    def settled(self, y):
        """Whether an edge that touches sticks, slides or leaves the pole at once."""
        pressure, drag = self.grip(y)
        gives = (y.slip == 0.0) & (jnp.abs(drag) > self.friction * pressure)
        y = y._replace(slip=jnp.where(gives, -jnp.sign(drag), y.slip))
        stays = self.grip(y)[0] > 0.0
        return y._replace(edge=jnp.where(stays, y.edge, 0.0), slip=jnp.where(stays, y.slip, 0.0))

    def guards(self):
        def opening(y, side):
            return self.tilt - side * y.sleeve

        def holds(y):
            pressure, drag = self.grip(y)
            return self.friction * pressure - jnp.abs(drag)

        def strikes(name, side):
            return Guard(
                name,
                lambda y: opening(y, side),
                armed=lambda y: y.edge == 0.0,
                reset=lambda y: self.edge_strikes(y, side),
                scale=0.1,
            )

        return (
            strikes("lower edge", -1.0),
            strikes("upper edge", 1.0),
            Guard(
                "beak",
                lambda y: self.reach - y.bird,
                armed=lambda y: y.edge == 0.0,
                reset=self.beak_strikes,
                scale=0.1,
            ),
            Guard(
                "lifts",
                lambda y: self.grip(y)[0],
                armed=lambda y: y.edge != 0.0,
                reset=lambda y: y._replace(edge=0.0, slip=0.0),
                scale=0.05,
            ),
            Guard(
                "sticks",
                lambda y: y.slip * y.speed,
                armed=lambda y: y.slip != 0.0,
                reset=lambda y: self.settled(y._replace(speed=0.0, slip=0.0)),
                scale=0.3,
            ),
            Guard(
                "slips",
                holds,
                armed=lambda y: (y.edge != 0.0) & (y.slip == 0.0),
                reset=lambda y: y._replace(slip=-jnp.sign(self.grip(y)[1])),
                scale=0.05,
            ),
            Guard(
                "beak strikes on a jammed sleeve",
                lambda y: self.reach - y.bird,
                armed=lambda y: y.edge != 0.0,
                ends=True,
                scale=0.1,
            ),
        )


def _dot(coefficients, rates):
    return sum(a * b for a, b in zip(coefficients, rates, strict=True))
