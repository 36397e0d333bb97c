"""Rays from a gait outward: where the label changes along them, and their turns to the normal."""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from jaxbiped._checks import ArgumentError
from jaxbiped.basins._label_oracle import LabelOracle, normalise

_LOOK_ON = 1.5
"""Rays are followed this much farther than the first exit: a nearer one may lie beside them."""
_MOST_PARTS = 4
"""Brackets are split into at most so many parts a call: fewer calls, but more points."""
Normal = Callable[[np.ndarray], npt.ArrayLike]
"""Gradients, shape (n, d), of points on the boundary, shape (n, d)."""
_TURNS = (1.0, 0.5, 2.0, 0.25)
"""Parts of the way to the normal that are tried: short ones where the boundary bulges inward."""
_SHORTEST = 0.02
"""Turns are halved where none helps, and given up below this part of their lengths."""
_GAIN = 0.8
"""A turn that brings the boundary no nearer must bring the angle down to this part of it."""
_MOST_ROUNDS = 30
_POLL = 0.1
"""Angle [rad] to the rays beside one that are tried where normals are secants."""
_BESIDE = np.asarray([-8.0, -4.0, -2.0, 0.0, 2.0, 4.0, 8.0])
"""Where on a nearby ray the boundary is looked for: logarithms of distances, in angles to it."""


class Brackets(NamedTuple):
    """Rays, and the stretch of each in which its label changes; distances are scaled.

    Attributes:
        directions: unit vectors, shape (n, d).
        inside: distances where the label is still the origin's, shape (n,).
        outside: distances where it is not, infinite where no such was met, shape (n,).
        labels: the labels there, shape (n,).
    """

    directions: np.ndarray
    inside: np.ndarray
    outside: np.ndarray
    labels: np.ndarray

    def take(self, which: np.ndarray) -> "Brackets":
        return Brackets(*(leaf[which] for leaf in self))

    def replaced(self, which: np.ndarray, by: "Brackets") -> "Brackets":
        """These rays, some of them replaced."""
        leaves = [leaf.copy() for leaf in self]
        for leaf, new in zip(leaves, by, strict=True):
            leaf[which] = new
        return Brackets(*leaves)


@dataclasses.dataclass(frozen=True)
class Surroundings:
    """The starts around a gait, by direction and distance in scaled coordinates.

    Attributes:
        ask: gives labels of points.
        origin, scales: shape (d,): a push u in scaled coordinates leads to origin + scales u.
        label: the origin's.
    """

    ask: LabelOracle
    origin: np.ndarray
    scales: np.ndarray
    label: int

    def points(self, directions: np.ndarray, distances: np.ndarray) -> np.ndarray:
        """Coordinates of points, shape (..., d)."""
        return self.origin + self.scales * directions * distances[..., None]

    def labels(self, directions: np.ndarray, distances: np.ndarray) -> np.ndarray:
        """Labels at distances (...) along directions (..., d)."""
        points = self.points(directions, distances)
        return self.ask(points.reshape(-1, self.origin.size)).reshape(points.shape[:-1])


def first_exits(around: Surroundings, directions: np.ndarray, distances: np.ndarray) -> Brackets:
    """Marches outward along all rays together to increasing distances, shape (k,), until they end.

    It stops early, half as far again as the first exit: rays still inside then have none.
    """
    n = len(directions)
    found = Brackets(directions, np.zeros(n), np.full(n, np.inf), np.full(n, around.label))
    for distance in distances:
        walking = np.flatnonzero(np.isinf(found.outside))
        if not walking.size or distance > _LOOK_ON * found.outside.min():
            break
        labels = around.labels(directions[walking], np.full(walking.size, distance))
        out = labels != around.label
        found.inside[walking[~out]] = distance
        found.outside[walking[out]] = distance
        found.labels[walking[out]] = labels[out]
    return found


def bisect_brackets(around: Surroundings, rays: Brackets, tolerance: float) -> Brackets:
    """The brackets halved, or split further where few are left, until none is wider than this."""
    while True:
        wide = rays.outside - rays.inside > tolerance
        if not wide.any():
            return rays
        rays = rays.replaced(wide, _split(around, rays.take(wide)))


def _split(around: Surroundings, rays: Brackets) -> Brackets:
    n = len(rays.inside)
    parts = int(np.clip(around.ask.batch // n + 1, 2, _MOST_PARTS))
    ends = np.linspace(rays.inside, rays.outside, parts + 1, axis=1)
    labels = around.labels(np.repeat(rays.directions[:, None], parts - 1, axis=1), ends[:, 1:-1])
    labels = np.concatenate([labels, rays.labels[:, None]], axis=1)
    exits = np.argmax(labels != around.label, axis=1)
    row = np.arange(n)
    return Brackets(rays.directions, ends[row, exits], ends[row, exits + 1], labels[row, exits])


def nearest_of(
    around: Surroundings, candidates: np.ndarray, max_distance: np.ndarray, tolerance: float
) -> Brackets:
    """Of each group of directions the one that meets another label first; one ray a group.

    All directions of a group (n, c, d), the preferred ones first, share one bracket, at last no
    wider than the tolerance: whichever still fails at a nearer distance goes on, the others drop
    out. `outside` is infinite where none fails at the group's `max_distance`, shape (n,).
    """
    n, c, _ = candidates.shape
    inside, outside = np.zeros(n), max_distance.copy()
    labels = around.labels(candidates, np.broadcast_to(outside[:, None], (n, c)))
    alive = labels != around.label
    found = alive.any(axis=1)
    while True:
        wide = found & (outside - inside > tolerance)
        if not wide.any():
            break
        ends = np.linspace(inside, outside, _MOST_PARTS + 1, axis=1)
        group, which = np.nonzero(alive & wide[:, None])
        met = np.full((n, c, _MOST_PARTS), around.label)
        met[..., -1] = labels
        met[group, which, :-1] = around.labels(
            np.repeat(candidates[group, which, None], _MOST_PARTS - 1, axis=1), ends[group, 1:-1]
        )
        fails = (met != around.label) & alive[..., None]
        exits = np.argmax(fails.any(axis=1), axis=1)
        row = np.flatnonzero(wide)
        alive[row] = fails[row, :, exits[row]]
        labels[row] = met[row, :, exits[row]]
        inside[row], outside[row] = ends[row, exits[row]], ends[row, exits[row] + 1]
    first = np.argmax(alive, axis=1)
    row = np.arange(n)
    return Brackets(
        candidates[row, first], inside, np.where(found, outside, np.inf), labels[row, first]
    )


class GivenNormals:
    """Normals from gradients that the caller computes."""

    aligned = 0.1
    """A ray is aligned below this angle, in units of √(tolerance / distance)."""
    polls = False

    def __init__(self, around: Surroundings, normal: Normal):
        self.around, self.normal = around, normal

    def __call__(self, rays: Brackets) -> np.ndarray:
        """Outward unit normals in scaled coordinates where rays meet the boundary, (n, d)."""
        points = self.around.points(rays.directions, 0.5 * (rays.inside + rays.outside))
        gradients = np.asarray(self.normal(points), dtype=float)
        if gradients.shape != points.shape:
            raise ArgumentError(
                f"normal returned shape {gradients.shape} for points of shape {points.shape}: "
                "it must return the same shape."
            )
        normals = normalise(gradients * self.around.scales)
        inward = np.sum(normals * rays.directions, axis=1) < 0.0
        return np.where(inward[:, None], -normals, normals)


class SecantNormals:
    """Normals from differences of the boundary's distance along nearby rays."""

    aligned = 1.0
    polls = True

    def __init__(self, around: Surroundings, tolerance: float):
        self.around, self.tolerance = around, tolerance

    def __call__(self, rays: Brackets) -> np.ndarray:
        """Outward unit normals in scaled coordinates where rays meet the boundary, (n, d)."""
        n, d = rays.directions.shape
        # Wide enough for the tolerance not to drown the difference.
        angle = np.clip(2.0 * np.sqrt(self.tolerance / rays.outside), 1e-3, 0.2)
        tangents = _tangents(rays.directions)
        beside = _neighbouring_directions(rays.directions, tangents, angle).reshape(-1, d)
        each = 2 * (d - 1)
        distance = self._distances(beside, np.repeat(rays.outside, each), np.repeat(angle, each))
        rise = (distance.reshape(n, 2, d - 1) - rays.outside[:, None, None]) / angle[:, None, None]
        rise[:, 1] *= -1.0
        # A nearby ray that meets no boundary tells nothing: the other side's slope stands.
        known = np.isfinite(rise)
        slope = np.sum(rise, axis=1, where=known) / np.maximum(known.sum(axis=1), 1)
        slope = np.where(known.any(axis=(1, 2))[:, None], slope, np.nan)
        return normalise(
            rays.directions - np.einsum("nj,njd->nd", slope, tangents) / rays.outside[:, None]
        )

    def _distances(self, directions: np.ndarray, near: np.ndarray, angle: np.ndarray) -> np.ndarray:
        """Boundary's distances along rays at an angle to those that meet it at `near`, or inf."""
        n = len(near)
        marks = near[:, None] * np.exp(angle[:, None] * _BESIDE)
        labels = self.around.labels(np.repeat(directions[:, None], len(_BESIDE), axis=1), marks)
        fails = labels != self.around.label
        exits = np.argmax(fails, axis=1)
        row = np.arange(n)
        inside = np.where(exits > 0, marks[row, exits - 1], 0.0)
        rays = Brackets(directions, inside, marks[row, exits], labels[row, exits])
        meets = fails.any(axis=1)
        distances = np.full(n, np.inf)
        distances[meets] = bisect_brackets(self.around, rays.take(meets), self.tolerance).outside
        return distances


def _tangents(directions: np.ndarray) -> np.ndarray:
    """Orthonormal bases of what is perpendicular to each direction, shape (n, d − 1, d)."""
    full = np.linalg.svd(directions[:, None, :], full_matrices=True)[2]
    return full[:, 1:]


def _neighbouring_directions(
    directions: np.ndarray, tangents: np.ndarray, angle: np.ndarray
) -> np.ndarray:
    """Directions turned by an angle (n,) along each tangent, then against; (n, 2 (d − 1), d)."""
    ways = np.concatenate([tangents, -tangents], axis=1)
    return normalise(directions[:, None] + np.tan(angle)[:, None, None] * ways)


def descend_rays(
    around: Surroundings, rays: Brackets, normals_of: GivenNormals | SecantNormals, tolerance: float
) -> tuple[Brackets, np.ndarray]:
    """Turns each ray towards the boundary's normal while that brings the boundary nearer.

    A turn is taken only where the new ray fails at the old distance: distances never grow. Where
    normals are secants, rays beside it in all directions are tried too: at an edge of the
    boundary no normal shows the way.

    Returns:
        The rays, and their angles [rad] to the normals where they meet the boundary.
    """
    d = rays.directions.shape[1]
    if d == 1:
        return rays, np.zeros(len(rays.inside))
    normals = normals_of(rays)
    angle = _angle(rays, normals)
    length = np.ones(len(angle))
    random = np.random.default_rng(0)
    for _ in range(_MOST_ROUNDS):
        aligned = normals_of.aligned * np.sqrt(tolerance / rays.outside)
        k = np.flatnonzero((angle > aligned) & (length > _SHORTEST))
        if not k.size:
            break
        old = rays.take(k)
        parts = np.multiply.outer(length[k], _TURNS)[:, :, None]
        ways = old.directions[:, None] + parts * (normals[k] - old.directions)[:, None]
        tried = normalise(ways)
        if normals_of.polls:  # in other directions each time
            basis = np.linalg.qr(random.normal(size=(d - 1, d - 1)))[0]
            around_it = basis @ _tangents(old.directions)
            beside = _neighbouring_directions(old.directions, around_it, _POLL * length[k])
            tried = np.concatenate([tried, beside], axis=1)
        new = nearest_of(around, tried, old.outside, tolerance)
        found = np.isfinite(new.outside)
        length[k] *= 0.5
        if not found.any():
            continue
        k, new, old = k[found], new.take(found), old.take(found)
        new_normals = normals_of(new)
        new_angle = _angle(new, new_normals)
        better = (new.outside < old.outside - tolerance) | (new_angle < _GAIN * angle[k])
        k = k[better]
        length[k] *= 2.0
        rays = rays.replaced(k, new.take(better))
        normals[k], angle[k] = new_normals[better], new_angle[better]
    return rays, angle


def _angle(rays: Brackets, normals: np.ndarray) -> np.ndarray:
    """Angles [rad] between rays and normals, exact near zero too."""
    apart = np.linalg.norm(rays.directions - normals, axis=1)
    return 2.0 * np.arcsin(np.minimum(0.5 * apart, 1.0))
