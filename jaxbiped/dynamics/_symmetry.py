"""The mirror of a mechanism in its states: the same motion with the sides exchanged."""

import math
from typing import Any

from jaxbiped.dynamics._redundant_state import motion_in
from jaxbiped.dynamics._stance import stance_on
from jaxbiped.dynamics._state_quantities import OF_BODIES
from jaxbiped.scene._abstract_scene import AbstractWalkerScene
from jaxbiped.scene._scene import is_rigid
from jaxbiped.scene._state_types import SomeState
from jaxbiped.scene._structure import Structure


def exchange_legs(scene: AbstractWalkerScene, state: SomeState, times: int = 1) -> SomeState:
    """The same motion with the names of mirror images exchanged, for a state of any kind.

    For a mechanism with a turn, the next foot takes the name of the one before.

    Args:
        scene: a scene whose mechanism has a mirror or a turn; otherwise nothing is exchanged.
        state: leaves of any common shape, SI units.
        times: number of exchanges; −1 undoes an exchange.

    Returns:
        A state of the same kind.
    """
    structure = scene.mechanism.structure
    if times == 0 or len(structure.namings) == 1:
        return state
    names: dict[str, str] = {}
    for name, k in zip(structure.bristles, structure.feet_renamed(times), strict=True):
        names[structure.bristles[k]] = name
    if structure.turn is not None:
        values = _turned(structure, state, times)
    else:
        values, bodies = state._asdict(), structure.bodies
        for name, twin in zip(bodies, structure.body_twins or (), strict=True):
            names |= {f"{kind}_{name}": f"{kind}_{bodies[twin]}" for kind in OF_BODIES}
        if structure.fixed and structure.coordinates[0] in values:
            # The image of a free body's angle may be one that a coupling fixes.
            rigid = is_rigid(scene)
            stands = structure.stance_leg
            rolls = stance_on(scene, state, stands).pose.motion if rigid else None
            motion = motion_in(scene, state) if rolls is None else rolls
            for name, angle, rate in zip(bodies, motion.angles, motion.rates, strict=True):
                values |= {f"theta_{name}": angle, f"omega_{name}": rate}
    return state._replace(**{name: values[names.get(name, name)] for name in state._fields})


def images(scene: AbstractWalkerScene, state: SomeState) -> list[tuple[int, SomeState]]:
    """The same motion in all names that a symmetry allows, those that it has last.

    With each the number of the leg that is the stance leg in these names.
    """
    legs = scene.mechanism.structure.namings
    return [(leg, exchange_legs(scene, state, k)) for k, leg in enumerate(legs)][::-1]


def _turned(structure: Structure, state: SomeState, times: int) -> dict[str, Any]:
    """The leaves of a state, a body turned so many times."""
    assert structure.turn is not None
    values, turn = state._asdict(), structure.turn
    name, angle = structure.bodies[turn.body], times * 2.0 * math.pi / turn.order
    if f"theta_{name}" in values:
        values[f"theta_{name}"] = values[f"theta_{name}"] + angle
        return values
    c, s = math.cos(0.5 * angle), math.sin(0.5 * angle)
    for kind in ("half", "rate"):  # Euler parameters
        first, second = f"cos_{kind}_{name}", f"sin_{kind}_{name}"
        own = values[first], values[second]
        values |= {first: c * own[0] - s * own[1], second: s * own[0] + c * own[1]}
    return values
