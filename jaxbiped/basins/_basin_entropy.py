"""Basin entropy: how uncertain the end of a walk is, at a given resolution of the start."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from jaxbiped._checks import ArgumentError, check_count
from jaxbiped.basins._labels import check_label_grid


class Entropy(NamedTuple):
    """Entropies in nats, over boxes of a label grid.

    Attributes:
        basin: S_b, mean entropy of all boxes.
        boundary: S_bb, mean entropy of the boxes with more than one label; NaN without any.
        boundary_error: standard error of that mean; NaN with fewer than two such boxes.
        box: side of a box [grid points].
        boxes: number of boxes.
        boundary_boxes: number of boxes with more than one label.
        fractal: whether S_bb > log 2. A smooth boundary separates only two basins in all but a few
            boxes, so its S_bb cannot exceed log 2. If S_bb > log 2, the boundary is fractal;
            otherwise, nothing is known.
    """

    basin: float
    boundary: float
    boundary_error: float
    box: int
    boxes: int
    boundary_boxes: int
    fractal: bool


def entropy(labels: npt.ArrayLike, *, box: int = 5) -> Entropy:
    """Basin entropy and boundary basin entropy of a grid of labels, of any dimension.

    S_i = −Σ_j p_ij log p_ij, where p_ij is the fraction of box i with label j. Source, also of the
    log 2 criterion: Daza, Wagemakers, Georgeot, Guéry-Odelin and Sanjuán, "Basin entropy: a new
    tool to analyze uncertainty in dynamical systems", Sci. Rep. 6 (2016) 31416, equations 2 to 4.
    The values depend on the size of a box: compare only values of one box size and resolution.

    Args:
        labels: label codes. Points at the far ends that do not fill a whole box are left out.
        box: side of a box [grid points], at least 2; the source uses 5.

    Returns:
        The two entropies [nats], and whether the boundary is fractal by the log 2 criterion.

    Raises:
        ArgumentError: labels are not allowed, or the box is larger than the grid.

    Examples:
        >>> import jaxbiped as jb
        >>> import numpy as np
        >>> halves = np.repeat([0, 1], 50)[:, None] * np.ones(100, dtype=int)
        >>> round(jb.basins.entropy(halves).basin, 6)
        0.0
    """
    grid = check_label_grid(labels)
    side = check_count("box", box, 2)
    if side > min(grid.shape):
        raise ArgumentError(
            f"box = {side} is not allowed: it must be at most {min(grid.shape)}, "
            "the shortest axis of the grid."
        )
    entropies = np.zeros([n // side for n in grid.shape])
    for label in np.unique(grid):
        p = _box_means(grid == label, side)
        entropies -= p * np.log(p, where=p > 0, out=np.zeros_like(p))
    mixed = entropies[entropies > 0]
    boundary = float(mixed.mean()) if mixed.size else np.nan
    return Entropy(
        basin=float(entropies.mean()),
        boundary=boundary,
        boundary_error=float(mixed.std(ddof=1) / np.sqrt(mixed.size)) if mixed.size > 1 else np.nan,
        box=side,
        boxes=entropies.size,
        boundary_boxes=mixed.size,
        fractal=bool(boundary > np.log(2.0)),
    )


def _box_means(values: np.ndarray, side: int) -> np.ndarray:
    counts = [n // side for n in values.shape]
    whole = values[tuple(slice(n * side) for n in counts)]
    split = [length for n in counts for length in (n, side)]
    return whole.reshape(split).mean(axis=tuple(range(1, 2 * len(counts), 2)))
