"""Ladder of fidelity: one walker, modelled more and more closely."""

import dataclasses

from jaxbiped._checks import check_type
from jaxbiped._types import by_numpy
from jaxbiped.scene._rigid_scene import RigidScene
from jaxbiped.scene._scene import Scene
from jaxbiped.scene._seed import seed_scene
from jaxbiped.scene.laws.bristles._lugre import LuGre
from jaxbiped.scene.laws.friction._bengisu_akay import BengisuAkay
from jaxbiped.scene.laws.friction._coulomb import RegularisedCoulomb

_CREEP = 1e-3
"""Slip speed of the friction without slip cost [m/s]: a stance foot creeps at less than it."""
_GIVE = 1e-5
"""Deflection of the bristles at the static coefficient [m]."""
_BRISTLE_DAMPING = 100.0
"""Their damping [s/m]: they settle without ringing under a leg of some kilograms."""


def ladder(scene: Scene | None = None) -> dict[str, Scene | RigidScene]:
    """Scenes of one walker by name, the cheapest first.

    - rigid: no contact laws at all.
    - creep: compliant feet, friction without a peak, spread over a slip of 1 mm/s.
    - stribeck: the scene itself, the seed's unless given.
    - bristles: friction that bends by 0.01 mm before it slips.

    Args:
        scene: the walker with its friction, the seed's unless given.

    Returns:
        The scenes by the names "rigid", "creep", "stribeck" and "bristles", in this order.

    Raises:
        ArgumentError: a scene whose friction is not `BengisuAkay`, from which the others follow.

    Examples:
        >>> import jaxbiped as jb
        >>> list(jb.ladder())
        ['rigid', 'creep', 'stribeck', 'bristles']
    """
    scene = seed_scene() if scene is None else scene
    check_type("scene", scene, Scene)
    law = scene.friction
    check_type("scene.friction", law, BengisuAkay)
    assert isinstance(law, BengisuAkay)
    bristles = LuGre(
        mu_static=law.mu_static,
        mu_kinetic=law.mu_kinetic,
        v_s=by_numpy(lambda _, xi: 1.0 / xi, law.xi),
        sigma_0=by_numpy(lambda _, mu: mu / _GIVE, law.mu_static),
        sigma_1=_BRISTLE_DAMPING,
    )
    creep = RegularisedCoulomb(mu=law.mu_kinetic, v_d=_CREEP)
    return {
        "rigid": RigidScene(walker=scene.walker, ground=scene.ground),
        "creep": dataclasses.replace(scene, friction=creep),
        "stribeck": scene,
        "bristles": dataclasses.replace(scene, friction=bristles),
    }
