"""A walker with a torso on its hip, held between the legs."""

from typing import Any

import equinox as eqx

from jaxbiped._checks import ArgumentError, check_type
from jaxbiped._parameter_declaration import check_parameters, parameter
from jaxbiped._types import Parameter, by_numpy
from jaxbiped.scene._bodies import Body, Point
from jaxbiped.scene._joint_parts import Coupling, Spring, Weights
from jaxbiped.scene._mechanism import Mechanism

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
