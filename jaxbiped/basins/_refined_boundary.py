"""The boundary between basins, on a grid that is fine only where labels disagree."""

import dataclasses
import itertools
import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from jaxbiped._checks import ArgumentError, check_count
from jaxbiped.basins._label_oracle import LabelOf, LabelOracle, check_box


@dataclasses.dataclass(frozen=True, eq=False)
class RefinedBoundary:
    """Labels near the boundaries between basins, and the cells that the boundaries cross.

    In d dimensions, n points are labelled. At level k, a cell is as wide as the box divided by
    `shape` 2^k.

    Attributes:
        lower, upper: corners of the box, shape (d,).
        shape: number of cells along each dimension at level 0.
        levels: the finest level.
        positions: positions of the labelled points on the lattice of the finest level; whole
            numbers, shape (n, d).
        labels: their labels, shape (n,).
        cells: for each level from 0, the cells whose corners disagree: positions on the lattice of
            that level's cells; whole numbers, shape (m_k, d).
        calls: number of calls for labels.
    """

    lower: np.ndarray
    upper: np.ndarray
    shape: tuple[int, ...]
    levels: int
    positions: np.ndarray
    labels: np.ndarray
    cells: tuple[np.ndarray, ...]
    calls: int

    @property
    def asked(self) -> int:
        """Number of labelled points."""
        return len(self.labels)

    @property
    def full(self) -> int:
        """Number of points of the full grid of the finest level."""
        return math.prod(n + 1 for n in self.cells_across(self.levels))

    @property
    def points(self) -> np.ndarray:
        """Coordinates of the labelled points, shape (n, d)."""
        return _places(self.lower, self.upper, self.cells_across(self.levels), self.positions)

    def cells_across(self, level: int) -> tuple[int, ...]:
        """Number of cells of a level along each dimension of the box."""
        return tuple(n << level for n in self.shape)

    def cell_size(self, level: int) -> np.ndarray:
        """Sides of a cell of a level, shape (d,)."""
        return (self.upper - self.lower) / self.cells_across(level)

    def axis(self, k: int) -> np.ndarray:
        """Coordinates of the finest level's grid along dimension k."""
        return np.linspace(self.lower[k], self.upper[k], (self.shape[k] << self.levels) + 1)

    def on_grid(self, *, largest: int = 10_000_000) -> np.ndarray:
        """Labels on the full grid of the finest level, one entry a lattice point.

        A point that was not labelled gets the label of the nearest labelled one along the lattice;
        no boundary cell lies between them.

        Args:
            largest: maximum number of points of the grid.

        Raises:
            ArgumentError: the full grid is larger than that.
        """
        if self.full > largest:
            raise ArgumentError(
                f"the full grid has {self.full} points: it must have at most largest = {largest}."
            )
        from scipy.ndimage import distance_transform_cdt

        counts = [n + 1 for n in self.cells_across(self.levels)]
        unknown = np.ones(counts, dtype=bool)
        grid = np.zeros(counts, dtype=int)
        grid[tuple(self.positions.T)] = self.labels
        unknown[tuple(self.positions.T)] = False
        nearest = distance_transform_cdt(
            unknown, metric="taxicab", return_distances=False, return_indices=True
        )
        return grid[tuple(nearest)]


def refine_boundary(
    label_of: LabelOf,
    lower: npt.ArrayLike,
    upper: npt.ArrayLike,
    shape: Sequence[int],
    *,
    levels: int,
    follow: bool = True,
    batch: int = 65536,
) -> RefinedBoundary:
    """Labels a coarse grid over a box, then repeatedly halves the cells that a boundary crosses.

    A cell is halved along all dimensions if its 2^d corners do not all have the same label. A basin
    (or a bay of one) that contains no corner of the coarse grid is therefore missed, unless the
    boundary leads to it from cell to cell. No point is labelled twice.

    Args:
        label_of: labels, whole numbers of shape (n,), of points of shape (n, d).
        lower, upper: corners of the box, shape (d,), in the units of the points.
        shape: number of cells of the coarse grid along each dimension.
        levels: number of times that cells are halved; 0 labels only the coarse grid.
        follow: whether a boundary that leaves the halved cells through a face is followed into the
            neighbour at the same level. This costs further calls with few points.
        batch: maximum number of points in a call. Without `follow`, a level is one call if it fits.

    Returns:
        All labelled points, and the boundary cells of every level.

    Raises:
        ArgumentError: an argument is not allowed, or labels have a wrong shape.
    """
    low, high = check_box(lower, upper)
    coarse = tuple(check_count("shape", n) for n in np.atleast_1d(np.asarray(shape)))
    if len(coarse) != low.size:
        raise ArgumentError(
            f"shape has {len(coarse)} entries and the box {low.size} dimensions: they must agree."
        )
    check_count("levels", levels, 0)
    if math.prod((n << levels) + 1 for n in coarse) >= 2**62:
        raise ArgumentError(
            f"levels = {levels} is not allowed: the finest grid must have fewer than 2^62 points."
        )
    lattice = _Lattice(LabelOracle(label_of, batch), low, high, [n << levels for n in coarse])
    corners = np.asarray(list(itertools.product((0, 1), repeat=low.size)))
    cells = np.indices(coarse).reshape(low.size, -1).T
    found = []
    for level in range(levels + 1):
        across = tuple(n << level for n in coarse)
        found.append(_boundary(lattice, cells, corners, across, follow))
        cells = (2 * found[-1][:, None] + corners).reshape(-1, low.size)
    return RefinedBoundary(
        lower=low,
        upper=high,
        shape=coarse,
        levels=levels,
        positions=lattice.positions(lattice.keys),
        labels=lattice.labels,
        cells=tuple(found),
        calls=lattice.ask.calls,
    )


def _places(
    lower: np.ndarray, upper: np.ndarray, across: npt.ArrayLike, positions: np.ndarray
) -> np.ndarray:
    """Coordinates of lattice positions (n, d), to the last bit those of `np.linspace`."""
    inside = lower + positions * ((upper - lower) / across)
    return np.where(positions == across, upper, inside)


class _Lattice:
    """Labels of the finest lattice's points: asked for once, then remembered by number."""

    def __init__(self, ask: LabelOracle, lower: np.ndarray, upper: np.ndarray, across: list[int]):
        self.ask = ask
        self.lower, self.upper = lower, upper
        self.across = np.asarray(across)
        self.keys = np.empty(0, dtype=np.int64)
        self.labels = np.empty(0, dtype=int)

    def positions(self, keys: np.ndarray) -> np.ndarray:
        return np.stack(np.unravel_index(keys, tuple(self.across + 1)), axis=-1)

    def __call__(self, positions: np.ndarray) -> np.ndarray:
        """Labels of positions of shape (..., d), shape (...)."""
        keys = np.ravel_multi_index(tuple(np.moveaxis(positions, -1, 0)), tuple(self.across + 1))
        new = np.setdiff1d(keys, self.keys)
        if new.size:
            labels = self.ask(_places(self.lower, self.upper, self.across, self.positions(new)))
            keys_now = np.concatenate([self.keys, new])
            order = np.argsort(keys_now)
            self.keys = keys_now[order]
            self.labels = np.concatenate([self.labels, labels])[order]
        return self.labels[np.searchsorted(self.keys, keys)]


def _boundary(
    lattice: _Lattice,
    cells: np.ndarray,
    corners: np.ndarray,
    across: tuple[int, ...],
    follow: bool,
) -> np.ndarray:
    """Those of the cells whose corners disagree, and those that their boundaries lead to."""
    step = lattice.across // across
    seen = np.empty(0, dtype=np.int64)
    boundary = np.empty((0, len(across)), dtype=np.int64)
    while len(cells):
        seen = np.union1d(seen, np.ravel_multi_index(tuple(cells.T), across))
        labels = lattice((cells[:, None] + corners) * step)
        mixed = _disagree(labels)
        boundary = np.concatenate([boundary, cells[mixed]])
        if not follow:
            break
        cells = _across_faces(cells[mixed], labels[mixed], corners, across)
        keys = np.setdiff1d(np.ravel_multi_index(tuple(cells.T), across), seen)
        cells = np.stack(np.unravel_index(keys, across), axis=-1)
    return boundary[np.lexsort(boundary.T[::-1])]


def _across_faces(
    cells: np.ndarray, labels: np.ndarray, corners: np.ndarray, across: tuple[int, ...]
) -> np.ndarray:
    """Neighbours through faces whose own corners disagree: a boundary passes into them too."""
    neighbours = [np.empty((0, len(across)), dtype=np.int64)]
    for axis, side in itertools.product(range(len(across)), (0, 1)):
        leaves = _disagree(labels[:, corners[:, axis] == side])
        moved = cells[leaves]
        moved[:, axis] += 2 * side - 1
        neighbours.append(moved[(moved[:, axis] >= 0) & (moved[:, axis] < across[axis])])
    return np.concatenate(neighbours)


def _disagree(labels: np.ndarray) -> np.ndarray:
    """Whether a row holds more than one label."""
    return (labels != labels[:, :1]).any(axis=1)
