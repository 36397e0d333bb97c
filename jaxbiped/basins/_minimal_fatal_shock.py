"""Minimal fatal shock: the nearest start about a gait with another label."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from jaxbiped._checks import ArgumentError, check_count, check_finite, check_positive
from jaxbiped.basins._label_oracle import (
    LabelOf,
    LabelOracle,
    check_vector,
    normalise,
    spread_directions,
)
from jaxbiped.basins._rays import (
    Brackets,
    GivenNormals,
    Normal,
    SecantNormals,
    Surroundings,
    bisect_brackets,
    descend_rays,
    first_exits,
)

_APART = 0.5
"""Angle [rad] between the rays that are improved, so that they lead to different places."""
_ROUGHLY = 1.0 / 16.0
"""To this part of a step of the march all rays are bisected."""


class FatalShock(NamedTuple):
    """The smallest push found that changes the label; distances are in scaled coordinates.

    Attributes:
        distance: distance of the failing start from the gait; infinite if none was found.
        push: vector from the gait to that start, in the coordinates' units, shape (d,); NaN if
            none.
        boundary_point: coordinates between the last start with the gait's label along the ray and
            the failing one, at most the tolerance apart, shape (d,).
        label: label of the failing start; that of the gait if none was found.
        direction: unit vector of the push in scaled coordinates, shape (d,).
        angle: between direction and the boundary's normal there [rad]: 0 at a nearest point of
            a smooth boundary. NaN where the normal is not known.
        bisected_distance: the distance before any ray was rotated.
        origin_label: label of the gait.
        asked: number of requested labels.
        calls: number of calls in which they were requested.
    """

    distance: float
    push: np.ndarray
    boundary_point: np.ndarray
    label: int
    direction: np.ndarray
    angle: float
    bisected_distance: float
    origin_label: int
    asked: int
    calls: int

    @property
    def found(self) -> bool:
        """Whether any start within `max_distance` has another label than the gait."""
        return bool(np.isfinite(self.distance))


def minimal_fatal_shock(
    label_of: LabelOf,
    origin: npt.ArrayLike,
    *,
    scales: npt.ArrayLike,
    max_distance: float,
    tolerance: float,
    directions: int | npt.ArrayLike | None = None,
    steps: int = 32,
    normal: Normal | None = None,
    improved: int = 8,
    batch: int = 1024,
) -> FatalShock:
    """Distance from a gait to the nearest start with another label, in scaled coordinates.

    All rays march outward together, max_distance / steps at a time, until they are half as long
    again as the first ray that met another label; the last steps are bisected. A tongue of another
    basin that is thinner than a step, or lies between the rays, may be missed. The distance is
    therefore that of a start that was found to fail, to within the tolerance along its ray, and a
    nearer one may exist. The nearest rays are then rotated towards the boundary normal (computed
    with `normal`, or estimated from the distances along nearby rays) for as long as this shortens
    them. The search ends at a local minimum of the distance, or only near one if the minimum lies
    on an edge of the boundary, where no normal exists. (The smallest distance to the boundary of
    the basin is the "minimal fatal shock" of Halekotte and Feudel, Sci. Rep. 10 (2020) 11783.)

    Args:
        label_of: labels, whole numbers of shape (n,), of points of shape (n, d). Every label
            that differs from the origin's counts as fatal, including "unresolved"; if a difference
            should not count, map the codes first.
        origin: coordinates of the gait, shape (d,).
        scales: unit of distance along each coordinate, shape (d,).
        max_distance: scaled distance up to which rays march.
        tolerance: scaled distance to which the boundary is bisected.
        directions: number of rays (both ways along every axis first, so at least 2 d, then evenly
            over the sphere; d = 1 has two), or scaled directions of shape (n, d). Default: 32 d
            rays.
        steps: number of steps of the march.
        normal: gradients, shape (n, d), at points of shape (n, d) near the boundary, in the units
            of the points, of any function that is constant along the boundary; either sign. NaN
            where it is not known: such a ray is not rotated.
        improved: number of rays to rotate: the nearest ones that are at least 0.5 rad apart.
        batch: maximum number of points in a call.

    Returns:
        The push to the nearest start that was found to fail, its scaled distance, and the boundary
        there.

    Raises:
        ArgumentError: an argument is not allowed, or labels or normals have a wrong shape.
    """
    around = _surroundings(LabelOracle(label_of, batch), origin, scales)
    ways = _directions(directions, around.origin.size)
    check_positive("max_distance", max_distance)
    check_positive("tolerance", tolerance)
    if not 1e-12 * max_distance <= tolerance < max_distance:
        raise ArgumentError(
            f"tolerance = {tolerance:g} is not allowed: it must be at least 1e-12 max_distance = "
            f"{1e-12 * max_distance:g} and below max_distance = {max_distance:g}."
        )
    check_count("improved", improved, 0)
    marks = np.linspace(0.0, max_distance, check_count("steps", steps) + 1)[1:]

    rays = first_exits(around, ways, marks)
    rays = rays.take(np.isfinite(rays.outside))
    if not rays.inside.size:
        nowhere, far = np.full((1, around.origin.size), np.nan), np.array([np.inf])
        rays = Brackets(nowhere, far, far, np.array([around.label]))
        return _result(around, rays, np.array([np.nan]), np.inf, tolerance)
    rays = _nearest(around, rays, max(improved, 1), tolerance)
    bisected = float(rays.outside.min())
    normals_of = (
        SecantNormals(around, tolerance) if normal is None else GivenNormals(around, normal)
    )
    angle = np.full(len(rays.inside), np.nan)
    if improved:
        rays, angle = descend_rays(around, rays, normals_of, tolerance)
    return _result(around, rays, angle, bisected, tolerance)


def _surroundings(ask: LabelOracle, origin: npt.ArrayLike, scales: npt.ArrayLike) -> Surroundings:
    centre, units = check_vector("origin", origin), check_vector("scales", scales)
    check_positive("scales", units)
    if centre.shape != units.shape:
        raise ArgumentError(
            f"scales has shape {units.shape} and origin {centre.shape}: they must be the same."
        )
    return Surroundings(ask, centre, units, int(ask(centre[None])[0]))


def _directions(directions: Any, d: int) -> np.ndarray:
    if directions is None:
        return spread_directions(32 * d, d)
    if np.ndim(directions) == 0:
        return spread_directions(check_count("directions", directions), d)
    check_finite("directions", directions)
    given = np.asarray(directions, dtype=float)
    if given.ndim != 2 or given.shape[1] != d or len(given) == 0:
        raise ArgumentError(f"directions has shape {given.shape}: it must be (n, {d}), n above 0.")
    if not given.any(axis=1).all():
        raise ArgumentError("directions holds a row of zeros: each must point somewhere.")
    return normalise(given)


def _nearest(around: Surroundings, rays: Brackets, most: int, tolerance: float) -> Brackets:
    """The nearest ray and others that point elsewhere, bisected to the tolerance.

    Only those that may be among them are: to tell which, a few halvings of all brackets do.
    """
    widest = np.max(rays.outside - rays.inside)
    rays = bisect_brackets(around, rays, max(tolerance, widest * _ROUGHLY))
    may_be_nearest = rays.inside <= rays.outside.min()
    may_be_nearest[_nearest_apart(rays, most)] = True
    rays = bisect_brackets(around, rays.take(may_be_nearest), tolerance)
    return rays.take(_nearest_apart(rays, most))


def _nearest_apart(rays: Brackets, most: int) -> np.ndarray:
    """The nearest ray, the nearest of those that point elsewhere, and so on."""
    chosen: list[int] = []
    for k in np.argsort(rays.outside, kind="stable"):
        if len(chosen) < most and (
            not chosen or np.max(rays.directions[chosen] @ rays.directions[k]) < np.cos(_APART)
        ):
            chosen.append(int(k))
    return np.asarray(chosen)


def _result(
    around: Surroundings, rays: Brackets, angle: np.ndarray, bisected: float, tolerance: float
) -> FatalShock:
    # Among rays that are equally near, to the tolerance, the one best aligned.
    near = rays.outside <= rays.outside.min() + tolerance
    near &= rays.outside <= bisected
    k = int(np.argmin(np.where(near, np.nan_to_num(angle, nan=np.pi), np.inf)))
    direction, distance = rays.directions[k], rays.outside[k]
    return FatalShock(
        distance=float(distance),
        push=around.scales * direction * distance,
        boundary_point=around.points(direction, 0.5 * (rays.inside[k] + distance)),
        label=int(rays.labels[k]),
        direction=direction,
        angle=float(angle[k]),
        bisected_distance=bisected,
        origin_label=around.label,
        asked=around.ask.asked,
        calls=around.ask.calls,
    )
