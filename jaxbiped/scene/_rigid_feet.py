"""Rigid feet of a mechanism: which may stand and strike, and what is refused of them."""

from collections.abc import Sequence

import numpy as np

from jaxbiped._checks import ArgumentError
from jaxbiped.scene._mechanism import Mechanism
from jaxbiped.scene._modes import Modes, modes_of
from jaxbiped.scene._placement import feet_named
from jaxbiped.scene._structure import Indices, Structure


def standing_legs(structure: Structure) -> Indices:
    """Numbers of the legs that may stand, last the one that does where a cycle begins.

    A mirror or a turn exchanges names at each footstep, so that the same one always stands.
    """
    last = structure.stance_leg
    if structure.leg_twins is not None or structure.turn is not None:
        return (last,)
    return (*(i for i in range(len(structure.legs)) if i != last), last)


def next_leg(structure: Structure, leg: int) -> int:
    """Number of the leg that swings, and stands next, where this one stands."""
    return (leg + 1) % len(structure.legs)


def leg_after_strike(structure: Structure, leg: int) -> int:
    """Number of the leg that stands after the next heel strike, names exchanged."""
    return leg if len(standing_legs(structure)) == 1 else next_leg(structure, leg)


def _check_feet(structure: Structure) -> None:
    """Raises `ArgumentError` for feet of which it is not known how they stand."""
    if structure.turn is not None:
        return
    soles = [
        len(feet) <= 2 and len({structure.feet[k] for k in feet}) == 1
        for feet in structure.feet_of_leg
    ]
    if len(soles) != 2 or not all(soles):
        raise ArgumentError(
            f"walker has the feet {', '.join(structure.feet_told)}, which is not allowed on rigid "
            "feet yet: there must be two legs, each with one or two feet on one body; use a Scene "
            "for others, whose feet are compliant."
        )


def rigid_modes(mechanism: Mechanism) -> Modes:
    """The modes of a mechanism on rigid feet."""
    structure = mechanism.structure
    legs = standing_legs(structure)
    return modes_of(mechanism, {leg: structure.feet_of_leg[leg] for leg in sorted(legs)})


def held_count(mechanism: Mechanism, mode: float) -> int:
    """How many angles a mode holds."""
    modes = rigid_modes(mechanism)
    found = modes.decoded(np, np.float64(mode))
    return sum(map(bool, (*found.held, *modes.flat(found).values())))


def check_rolls(mechanism: Mechanism) -> None:
    """Raises `ArgumentError` for a mechanism whose walk on rigid feet is not known yet."""
    _check_feet(mechanism.structure)
    rigid_modes(mechanism)


def check_stands(structure: Structure, standing: str | Sequence[str] | None) -> Indices:
    """Numbers of the feet that are named as standing, all of one leg.

    Raises:
        ArgumentError: other feet.
    """
    able = standing_legs(structure)
    if standing is None:
        return structure.feet_of_leg[able[-1]]
    named = feet_named(structure, standing)
    if not any(set(named) <= set(structure.feet_of_leg[leg]) for leg in able):
        told = " or ".join(
            repr(structure.feet_told[k]) for leg in able for k in structure.feet_of_leg[leg]
        )
        which = "one leg stands" if len(able) > 1 else "the second of each pair stands"
        raise ArgumentError(f"standing = {standing!r} is not allowed: {which}, {told}.")
    return named
