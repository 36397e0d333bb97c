"""Placement of a mechanism on its ground: a whole state from the scalars that are named."""

from collections.abc import Mapping, Sequence
from typing import Any

import jax.tree_util as jtu
import numpy as np

from jaxbiped._checks import ArgumentError, check_choice, check_finite
from jaxbiped._types import Parameter, Scalar, as_float, by_numpy
from jaxbiped.scene._couplings import angles_and_rates_named
from jaxbiped.scene._mechanism import Mechanism
from jaxbiped.scene._structure import Indices, Structure

_TURNING = ("theta", "omega")
_LAST_DIGITS = 4


def placement(
    mechanism: Mechanism,
    slope: Parameter,
    given: Mapping[str, Parameter],
    standing: str | Sequence[str] | None = None,
    names: Sequence[str] | None = None,
) -> dict[str, Scalar]:
    """Every scalar of a state, the root point placed on the ground.

    Args:
        mechanism: what is placed.
        slope: of the ground, the angle of the vertical [rad].
        given: values by name, SI units: numbers, or arrays that broadcast to one shape. What is not
            named is 0, except for the root point: its height is the one at which the lowest foot,
            or the standing one, just touches the ground; its velocity the one at which the standing
            foot rolls.
        standing: the feet that may stand, told by a leg, by a body or as "BODY.FOOT"; the lowest of
            them stands. None for no velocity of the root point, and a height from all feet.
        names: names of the state's scalars, in order. Default: coordinates and rates.

    Returns:
        The state's scalars by name, in the order of the names, all of one shape.

    Raises:
        ArgumentError: a name that the state does not have, a foot that does not exist, or a value
            that is not finite.
    """
    structure = mechanism.structure
    order = tuple(names or (*structure.coordinates, *structure.rates))
    fixed = [structure.bodies[each.body] for each in structure.fixed]
    for name, value in given.items():
        if name.partition("_")[0] in _TURNING and name.partition("_")[2] in fixed:
            raise ArgumentError(
                f"{name} is not allowed: a coupling makes it follow from the other angles."
            )
        check_choice("a scalar of the state", name, order)
        check_finite(name, value)
    feet = range(len(structure.feet)) if standing is None else feet_named(structure, standing)
    leaves, tree = jtu.tree_flatten(mechanism)
    values = [as_float(value) for value in given.values()]
    shapes = {name: value.shape for name, value in zip(given, values, strict=True)}
    try:
        np.broadcast_shapes(*shapes.values())
    except ValueError:
        raise ArgumentError(
            f"values of shapes {shapes} are not allowed: they must broadcast to one shape."
        ) from None

    def place(numpy: Any, slope: Any, *numbers: Any) -> tuple[Any, ...]:
        known = dict(zip(given, numbers[: len(given)], strict=True))
        placed = jtu.tree_unflatten(tree, numbers[len(given) :])
        state = {name: known.get(name, 0.0 * slope) for name in order}
        root = root_on_feet(numpy, placed, slope, state, tuple(feet), standing is not None)
        height = root[f"{structure.root}_z"]
        # Pressed by a few last digits, lest rounding tell whether the foot touches.
        pressed = _LAST_DIGITS * float(np.finfo(height.dtype).eps)
        root[f"{structure.root}_z"] = height - pressed * numpy.abs(height)
        state |= {name: root[name] for name in root if name not in known}
        shape = np.broadcast_shapes(*map(np.shape, state.values()))
        return tuple(numpy.broadcast_to(state[name], shape) for name in order)

    placed = by_numpy(place, as_float(slope), *values, *leaves)
    return dict(zip(order, placed, strict=True))


def feet_named(structure: Structure, standing: str | Sequence[str]) -> Indices:
    """Numbers of the feet of a leg, of a body or of a name "BODY.FOOT", or of several of these.

    Raises:
        ArgumentError: a name that is none of these.
    """
    named: dict[str, list[int]] = {}
    for k, j in enumerate(structure.feet):
        body, leg = structure.bodies[j], structure.legs[structure.leg_of_foot[k]]
        for name in {leg, body, f"{body}.{structure.foot_names[k]}"}:
            named.setdefault(name, []).append(k)
    wanted = [standing] if isinstance(standing, str) else standing
    if not isinstance(wanted, list | tuple) or not wanted:
        raise ArgumentError(
            f"standing = {standing!r} is not allowed: give a leg, a body, a foot, or several."
        )
    for name in wanted:
        check_choice("standing", name, sorted(named))
    return tuple(sorted({k for name in wanted for k in named[name]}))


def root_on_feet(
    numpy: Any, mechanism: Mechanism, slope: Any, state: dict[str, Any], feet: Indices, rolls: bool
) -> dict[str, Any]:
    """Height of the root point on the lowest of some feet, and its velocity if that one rolls."""
    structure = mechanism.structure
    angles, rates = angles_and_rates_named(mechanism, slope, state)
    height = vx = vz = None
    for k in feet:
        foot = mechanism.feet[k]
        radius = 0.0 if foot.radius is None else foot.radius
        z, own_vx, own_vz = foot_motion(numpy, mechanism, k, angles, rates)
        own = radius - z, -own_vx - radius * rates[structure.feet[k]], -own_vz
        if height is None:
            height, vx, vz = own
        else:
            lower = own[0] > height
            height, vx, vz = (
                numpy.where(lower, a, b) for a, b in zip(own, (height, vx, vz), strict=True)
            )
    root = {f"{structure.root}_z": height}
    return root | {f"{structure.root}_vx": vx, f"{structure.root}_vz": vz} if rolls else root


def foot_motion(
    numpy: Any, mechanism: Mechanism, foot: int, angles: list[Any], rates: list[Any]
) -> tuple[Any, Any, Any]:
    """Height above the root point of a foot's centre, and its velocity relative to that point."""
    structure, bodies = mechanism.structure, mechanism.bodies
    chain = structure.chains[structure.feet[foot]]
    z = vx = vz = 0.0
    for link, after in zip(chain, (*chain[1:], None), strict=True):
        point = mechanism.feet[foot].centre if after is None else bodies[after].at
        if point is None:
            continue
        ahead = 0.0 if point.ahead is None else point.ahead
        sine, cosine = numpy.sin(angles[link]), numpy.cos(angles[link])
        down, across = point.along * cosine - ahead * sine, point.along * sine + ahead * cosine
        z, vx, vz = z - down, vx + down * rates[link], vz + across * rates[link]
    return z, vx, vz
