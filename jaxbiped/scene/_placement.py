"""Placement of a mechanism: at its zero pose, and on its ground from the scalars that are named.

With all angles 0 it must stand above the ground, and every motion must have inertia.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import jax.tree_util as jtu
import numpy as np

from jaxbiped._checks import ArgumentError, check_choice, check_finite
from jaxbiped._types import Parameter, Scalar, as_float, by_numpy, is_traced
from jaxbiped.scene._mechanism_pieces import with_fixed
from jaxbiped.scene._structure import Indices, Structure

if TYPE_CHECKING:
    from jaxbiped.scene._mechanism import Mechanism

_TURNING = ("theta", "omega")
_LAST_DIGITS = 4


def placement(
    mechanism: "Mechanism",
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
    numpy: Any,
    mechanism: "Mechanism",
    slope: Any,
    state: dict[str, Any],
    feet: Indices,
    rolls: bool,
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
    numpy: Any, mechanism: "Mechanism", foot: int, angles: list[Any], rates: list[Any]
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


_SINGULAR = 1e-12
"""Least eigenvalue of a mass matrix scaled to a diagonal of ones that still is an inertia."""


def check_zero_pose(mechanism: "Mechanism") -> None:
    """Raises `ArgumentError` where the root point is not above the ground with all angles 0.

    Nor may the mass matrix be known to be singular there.

    Hanging straight down, what has no inertia of its own has none at all: a mass at its hinge, a
    massless thigh over a shank that is a mass point, legs without inertia under a massless root.
    """
    if is_traced(mechanism):
        return
    _check_shapes(mechanism)
    height = np.min(np.asarray(mechanism.height))
    if height <= 0.0:
        raise ArgumentError(
            f"feet are not allowed where all angles are 0: the root point is at {height:g} m, not "
            "above the ground; put one foot's sole below it."
        )
    structure = mechanism.structure
    matrix = _mass_matrix(mechanism)
    diagonal = np.sqrt(np.diagonal(matrix, axis1=-2, axis2=-1))
    for j, body in enumerate(structure.free):
        if np.any(diagonal[..., 2 + j] == 0.0):
            _refuse(mechanism, body)
    if np.any(diagonal[..., :2] == 0.0):
        raise ArgumentError(
            "bodies and root_mass are all without mass, which is not allowed: give one some mass."
        )
    scaled = matrix / diagonal[..., :, None] / diagonal[..., None, :]
    values, vectors = np.linalg.eigh(scaled)
    if np.any(values[..., 0] < _SINGULAR):
        worst = np.reshape(vectors[..., 2:, 0], (-1, len(structure.free)))
        sizes = np.max(np.abs(worst), axis=0)
        # Of those that turn as much as the first one does, whatever the rounding.
        most = int(np.argmax(sizes > (1.0 - 1e-6) * np.max(sizes)))
        _refuse(mechanism, structure.free[most])


def _check_shapes(mechanism: "Mechanism") -> None:
    """Raises `ArgumentError` where two numbers are arrays that do not broadcast to one shape."""
    known: dict[tuple[int, ...], str] = {}
    leaves = jtu.tree_leaves(mechanism)
    for name, leaf in zip(mechanism.parameter_names(), leaves, strict=True):
        for shape, other in known.items():
            try:
                np.broadcast_shapes(shape, np.shape(leaf))
            except ValueError:
                raise ArgumentError(
                    f"{other} and {name} have the shapes {shape} and {np.shape(leaf)}, which are "
                    "not allowed together: give arrays of one shape, an entry for each scene; many "
                    "numbers of a law are a tuple of numbers."
                ) from None
        known.setdefault(np.shape(leaf), name)


def _refuse(mechanism: "Mechanism", body: int) -> None:
    structure = mechanism.structure
    name = structure.bodies[body]
    mend = "give it some inertia, or put its mass away from its hinge"
    if body in structure.feet and not np.any(mechanism.bodies[body].mass):
        mend = "give it an inertia of 1e-4 kg m^2, or put the foot on the leg"
    raise ArgumentError(
        f"Body({name!r}) can turn without any inertia where all angles are 0, which is not "
        f"allowed: {mend}."
    )


def _mass_matrix(mechanism: "Mechanism") -> np.ndarray:
    """Of the root point's place and the free angles, all angles 0; shape (..., n, n)."""
    structure, bodies = mechanism.structure, mechanism.bodies
    n = len(bodies)
    total: Any = 0.0
    for body, chain in zip(bodies, structure.chains, strict=True):
        moves: Any = np.eye(2, 2 + n)
        for link, after in zip(chain, (*chain[1:], None), strict=True):
            point = body.centre if after is None else bodies[after].at
            if point is None:
                continue
            # At angle 0 a point (along, ahead) moves by (along, ahead) for each radian.
            moves = _added(moves, 0, 2 + link, point.along)
            if point.ahead is not None:
                moves = _added(moves, 1, 2 + link, point.ahead)
        mass = np.asarray(body.mass)[..., None, None]
        total = total + mass * (np.swapaxes(moves, -1, -2) @ moves)
        total = _added(total, 2 + chain[-1], 2 + chain[-1], body.inertia)
    if mechanism.root_mass is not None:
        for i in range(2):
            total = _added(total, i, i, mechanism.root_mass)
    free = np.zeros((2 + n, 2 + len(structure.free)))
    free[0, 0] = free[1, 1] = 1.0
    for k, j in enumerate(structure.free):
        free[2 + j, 2 + k] = 1.0
    for each in structure.fixed:
        for j, weight in each.angle.weights:
            free[2 + each.body, 2 + structure.free.index(j)] = weight
    return np.asarray(free.T @ total @ free)


def _added(matrix: Any, row: int, column: int, value: Any) -> Any:
    """A matrix, or a batch of them, with a value added to one entry of each."""
    value = np.asarray(value, dtype=float)
    shape = np.broadcast_shapes(np.shape(matrix)[:-2], value.shape)
    matrix = np.array(np.broadcast_to(matrix, (*shape, *np.shape(matrix)[-2:])))
    matrix[..., row, column] += value
    return matrix


def angles_and_rates_named(
    mechanism: Any, slope: Any, values: Mapping[str, Any]
) -> tuple[list[Any], list[Any]]:
    """Angles and rates of all bodies, from a state's scalars by name; 0 where not named.

    `slope`: the angle of the vertical [rad].
    """
    structure = mechanism.structure
    angles, rates = (
        [values.get(f"{kind}_{name}", 0.0) for name in structure.bodies]
        for kind in ("theta", "omega")
    )
    fixed = with_fixed(structure, angles, slope, mechanism.joints)
    return fixed, with_fixed(structure, rates)
