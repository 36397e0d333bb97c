"""Rays from a gait outward, and the brackets in which the label changes along them."""

import dataclasses
from typing import NamedTuple

import numpy as np

from jaxbiped.basins._label_oracle import LabelOracle

_LOOK_ON = 1.5
"""Rays are followed this much farther than the first exit: a nearer one may lie beside them."""
_MOST_PARTS = 4
"""Brackets are split into at most so many parts a call: fewer calls, but more points."""


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
        """Some of the rays."""
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

    All directions of a group share one bracket: whichever still fails at a nearer distance goes
    on, the others drop out.

    Args:
        around: the starts around the gait.
        candidates: directions, the preferred ones first, shape (n, c, d).
        max_distance: distances within which a change is looked for, shape (n,).
        tolerance: largest width of a bracket.

    Returns:
        Infinite `outside` where no direction of a group fails at its `max_distance`.
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
