"""A walker with knees: two legs of thigh and shank, whose knees have a stop."""

import dataclasses

import equinox as eqx

from jaxbiped._checks import check_choice, check_pair, check_type
from jaxbiped._parameter_declaration import check_parameters, parameter
from jaxbiped._types import Parameter, by_numpy
from jaxbiped.scene._bodies import Body, Foot, Point
from jaxbiped.scene._joint_parts import HOLDS, Stop
from jaxbiped.scene._mechanism import Mechanism
from jaxbiped.scene.laws._abstract_laws import AbstractNormalLaw


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
        ArgumentError: a mass or a length is not above 0, another number is below 0, l_shank is
            below r, or `stop` or `holds` is of another kind.
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
