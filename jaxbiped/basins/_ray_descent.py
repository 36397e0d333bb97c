"""Descent of rays towards the boundary's normal, where the boundary is nearest."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from jaxbiped._checks import ArgumentError
from jaxbiped.basins._label_oracle import normalise
from jaxbiped.basins._rays import Brackets, Surroundings, bisect_brackets, nearest_of

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
        tried = _intermediate_directions(old, normals[k], length[k])
        if normals_of.polls:
            tried = np.concatenate([tried, _perturbed_rays(old, _POLL * length[k], random)], axis=1)
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


def _intermediate_directions(rays: Brackets, normals: np.ndarray, length: np.ndarray) -> np.ndarray:
    """Directions part of the way to the normals, and beyond; shape (n, turns, d)."""
    parts = np.multiply.outer(length, _TURNS)[:, :, None]
    return normalise(rays.directions[:, None] + parts * (normals - rays.directions)[:, None])


def _perturbed_rays(rays: Brackets, angle: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Directions at an angle (n,) to the rays, another way each time; shape (n, 2 (d − 1), d)."""
    tangents = _tangents(rays.directions)
    basis = np.linalg.qr(random.normal(size=(tangents.shape[1],) * 2))[0]
    return _neighbouring_directions(rays.directions, basis @ tangents, angle)


def _angle(rays: Brackets, normals: np.ndarray) -> np.ndarray:
    """Angles [rad] between rays and normals, exact near zero too."""
    apart = np.linalg.norm(rays.directions - normals, axis=1)
    return 2.0 * np.arcsin(np.minimum(0.5 * apart, 1.0))
