"""Walkers by their named parameters: two rigid legs, legs with knees, a torso on the hip."""

import dataclasses
from typing import Any, ClassVar

import equinox as eqx

from jaxbiped._checks import ArgumentError, are_zero_together, check_choice, check_pair, check_type
from jaxbiped._parameter_declaration import check_parameters, parameter
from jaxbiped._summary import in_short
from jaxbiped._types import Parameter, Scalar, by_numpy
from jaxbiped.scene._bodies import Body, Foot, Point
from jaxbiped.scene._clearance import AbstractClearance, StanceRotation
from jaxbiped.scene._joint_parts import HOLDS, Coupling, Spring, Stop, Weights
from jaxbiped.scene._mechanism import Mechanism
from jaxbiped.scene.laws._abstract_laws import AbstractNormalLaw


class Walker(eqx.Module):
    """Two equal rigid legs joined by a frictionless hinge, each ending in a circular foot.

    Source: the seed paper, section 2.1. The centre of the foot lies on the leg's axis.

    Attributes (leaves of any batch shape):
        m: mass of one leg [kg].
        J: moment of inertia of one leg about its centre of mass [kg·m²].
        l: distance from the hip to the sole [m].
        d: distance from the hip to the leg's centre of mass [m].
        r: foot radius [m].
        hip_mass: point mass at the hip [kg].

    Raises:
        ArgumentError: m or l is not above 0; J, d, r or hip_mass is below 0; l is below r; or J is
            zero (legs that are mass points) and d and hip_mass are not both above 0.
    """

    clearance: ClassVar[AbstractClearance] = StanceRotation()
    m: Parameter = parameter("leg mass", "$m$", "kg", positive=True)
    J: Parameter = parameter("leg inertia", "$J$", "kg m^2", minimum=0.0)
    l: Parameter = parameter("leg length", "$l$", "m", positive=True)
    d: Parameter = parameter("hip to mass centre", "$d$", "m", minimum=0.0)
    r: Parameter = parameter("foot radius", "$r$", "m", minimum=0.0)
    hip_mass: Parameter = parameter("hip mass", "$m_S$", "kg", minimum=0.0, default=0.0)
    __repr__ = in_short

    def __check_init__(self) -> None:
        check_parameters(self)
        check_pair("l", self.l, "r", self.r)
        for name in ("d", "hip_mass"):
            if are_zero_together(self.J, getattr(self, name)):
                raise ArgumentError(
                    f"J = 0 is not allowed where {name} = 0: legs that are mass points need d "
                    "and hip_mass above 0."
                )

    @property
    def hip_to_foot(self) -> Scalar:
        """Distance from the hip to the centre of the foot, l − r [m]."""
        return by_numpy(lambda _, l, r: l - r, self.l, self.r)

    def mechanism(self) -> Mechanism:
        """The walker as a mechanism: bodies "1" and "2" on the hip, of which the second stands."""
        return Mechanism(
            root_mass=self.hip_mass,
            bodies=tuple(Body(n, mass=self.m, inertia=self.J, centre=Point(self.d)) for n in "12"),
            feet=tuple(Foot(n, centre=Point(self.hip_to_foot), radius=self.r) for n in "12"),
            mirror=(("1", "2"),),
        )

    @property
    def total_mass(self) -> Scalar:
        """Mass of both legs and the hip [kg]."""
        return by_numpy(lambda _, m, hip: 2.0 * m + hip, self.m, self.hip_mass)


class Kneed(eqx.Module):
    """Two equal legs with knees and round feet; stops keep the knees from overextending.

    The bodies are "thigh_1", "shank_1", "thigh_2" and "shank_2". A knee's angle is the shank's
    angle minus the thigh's; it is positive if the shank is ahead.

    Source: McGeer 1990, Passive walking with knees.

    Attributes (leaves of any batch shape):
        m_thigh, J_thigh: mass of a thigh [kg], moment of inertia about its mass centre [kg·m²].
        l_thigh, d_thigh: hip to knee, hip to the thigh's mass centre [m].
        m_shank, J_shank: mass [kg] and moment of inertia [kg·m²] of a shank with its foot.
        l_shank, d_shank: knee to sole, knee to the shank's mass centre along the shank [m].
        w_shank: distance of that mass centre ahead of the shank's line [m].
        r: foot radius; the foot's centre lies on the shank's line [m].
        hip_mass: point mass at the hip [kg].
        epsilon: knee angle at which the stop begins to act [rad].
        stop: law of the stop's torque in scenes with laws of contact, one of `NORMAL_LAWS`, with an
            angle [rad] as its penetration; None for use on rigid feet only.
        holds: how long the stops hold on rigid feet, see `Stop`.

    Raises:
        ArgumentError: a mass or a length is not above 0, an inertia, r or hip_mass is below 0,
            l_shank is below r, or `stop` or `holds` is of another kind.
    """

    m_thigh: Parameter = parameter("thigh mass", r"$m_\mathrm{t}$", "kg", positive=True)
    J_thigh: Parameter = parameter("thigh inertia", r"$J_\mathrm{t}$", "kg m^2", minimum=0.0)
    l_thigh: Parameter = parameter("hip to knee", r"$l_\mathrm{t}$", "m", positive=True)
    d_thigh: Parameter = parameter("hip to mass centre", r"$d_\mathrm{t}$", "m")
    m_shank: Parameter = parameter("shank mass", r"$m_\mathrm{s}$", "kg", positive=True)
    J_shank: Parameter = parameter("shank inertia", r"$J_\mathrm{s}$", "kg m^2", minimum=0.0)
    l_shank: Parameter = parameter("knee to sole", r"$l_\mathrm{s}$", "m", positive=True)
    d_shank: Parameter = parameter("knee to mass centre", r"$d_\mathrm{s}$", "m")
    w_shank: Parameter = parameter("mass centre ahead of the shank", r"$w_\mathrm{s}$", "m")
    r: Parameter = parameter("foot radius", "$r$", "m", minimum=0.0)
    hip_mass: Parameter = parameter("hip mass", r"$m_\mathrm{h}$", "kg", minimum=0.0)
    epsilon: Parameter = parameter("knee angle at the stop", r"$\varepsilon$", "rad")
    stop: AbstractNormalLaw | None = None
    _: dataclasses.KW_ONLY
    holds: str = eqx.field(static=True, default="while pressed")

    def __check_init__(self) -> None:
        check_parameters(self)
        check_pair("l_shank", self.l_shank, "r", self.r)
        if self.stop is not None:
            check_type("stop", self.stop, AbstractNormalLaw)
        check_choice("holds", self.holds, HOLDS)

    def mechanism(self) -> Mechanism:
        """The walker as data; the second of each pair of bodies stands where a cycle begins."""
        return Mechanism(
            root_mass=self.hip_mass,
            bodies=tuple(body for n in "12" for body in self._leg(n)),
            feet=tuple(
                Foot(
                    f"shank_{n}",
                    centre=Point(by_numpy(lambda _, l, r: l - r, self.l_shank, self.r)),
                    radius=self.r,
                )
                for n in "12"
            ),
            joints=tuple(
                Stop(f"shank_{n}", upper=self.epsilon, law=self.stop, holds=self.holds)
                for n in "12"
            ),
            mirror=(("thigh_1", "thigh_2"), ("shank_1", "shank_2")),
        )

    def _leg(self, number: str) -> tuple[Body, Body]:
        thigh = Body(
            f"thigh_{number}", mass=self.m_thigh, inertia=self.J_thigh, centre=Point(self.d_thigh)
        )
        shank = Body(
            f"shank_{number}",
            mass=self.m_shank,
            inertia=self.J_shank,
            centre=Point(self.d_shank, self.w_shank),
            parent=thigh.name,
            at=Point(self.l_thigh),
        )
        return thigh, shank


_TORSO = "torso"


class WithTorso(eqx.Module):
    """A walker with a torso, held by a spring, or midway between the legs by a coupling.

    Source: Wisse, Schwab and van der Helm 2004, Passive dynamic walking model with upper body.

    Attributes (leaves of any batch shape):
        walker: the walker below the torso: `Walker`, `Kneed` or any other module with a method
            `mechanism()`; or a `Mechanism`.
        m_torso: mass of the torso [kg].
        J_torso: moment of inertia of the torso about its mass centre [kg·m²].
        h: height of the torso's mass centre above the hip [m].
        spring: a spring that holds the body "torso", on any angle. None: a coupling, with which the
            torso exactly bisects the angle between the legs.

    Raises:
        ArgumentError: a mass is not above 0, an inertia is below 0, `walker` has no mechanism, or,
            without a spring, the walker does not have exactly two mirrored bodies on its root
            point.
    """

    walker: Any
    m_torso: Parameter = parameter("torso mass", r"$m_\mathrm{T}$", "kg", positive=True)
    J_torso: Parameter = parameter("torso inertia", r"$J_\mathrm{T}$", "kg m^2", minimum=0.0)
    h: Parameter = parameter("hip to the torso's mass centre", "$h$", "m")
    spring: Spring | None = None

    def __check_init__(self) -> None:
        check_parameters(self)
        if not isinstance(self.walker, Mechanism) and not hasattr(self.walker, "mechanism"):
            raise ArgumentError(
                f"walker = {self.walker!r} is not allowed: give a Mechanism or a module with a "
                "method mechanism()."
            )
        if self.spring is not None:
            check_type("spring", self.spring, Spring)
        self.mechanism()

    def mechanism(self) -> Mechanism:
        """The walker's mechanism with the body "torso" on its root point."""
        below = self.walker if isinstance(self.walker, Mechanism) else self.walker.mechanism()
        given = below.arguments()
        torso = Body(
            _TORSO,
            mass=self.m_torso,
            inertia=self.J_torso,
            centre=Point(by_numpy(lambda _, h: -h, self.h)),
        )
        holds = Coupling(_bisecting(below)) if self.spring is None else self.spring
        given["bodies"] = (*given["bodies"], torso)
        given["joints"] = (*given["joints"], holds)
        return Mechanism(**given)


def _bisecting(mechanism: Mechanism) -> Weights:
    """Weights of the torso's angle from the mean of the two mirrored bodies on the root point."""
    structure = mechanism.structure
    legs = [
        structure.bodies[i] for pair in structure.pairs for i in pair if structure.parents[i] < 0
    ]
    if len(legs) != 2:
        raise ArgumentError(
            f"spring = None is not allowed for a walker with {len(legs)} mirrored bodies on its "
            "root point: there must be two for the torso to bisect; give a spring."
        )
    return (_TORSO, 1.0), (legs[0], -0.5), (legs[1], -0.5)
