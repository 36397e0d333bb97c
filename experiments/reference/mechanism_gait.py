"""A gait of a mechanism, from a state of it and its period: corrections and derivatives.

From the flow over one cycle, without a section: the flow's own direction has the multiplier 1.
"""

from typing import Any, NamedTuple

import numpy as np

from .mechanism_equations import Tree
from .mechanism_flow import flow
from .mechanism_pieces import Field, pieces_at


class CheckedCycle(NamedTuple):
    """What the check knows of a gait.

    Attributes:
        residual: largest change of the state over the cycle but for the root's x [SI].
        period: corrected by a step of Newton's method [s].
        multipliers: complex, the flow's own 1 among them, largest first, shape (n − 1,).
        slopes: of the period by the directions, shape (k,).
        switches: what was met, with its times [s].
    """

    residual: float
    period: float
    multipliers: np.ndarray
    slopes: np.ndarray
    switches: list[tuple[str, float]]


def checked_cycle(
    tree: Tree, state: Any, period: float, directions: np.ndarray, *, exchanges: bool, **how: Any
) -> CheckedCycle:
    """The gait near a state.

    Args:
        tree: the mechanism.
        state: of the gait, leaves in the tree's order: root point, free angles, their rates.
        period: of the cycle [s].
        directions: in the tree's numbers, by which to differentiate, (k, P).
        exchanges: whether the sides have exchanged their names after the cycle.
        how: options of `flow`.
    """
    start = np.array([float(leaf) for leaf in state])
    own, n = _names_later(tree, exchanges), len(start)
    found = flow(tree, start, period, directions, **how)
    end, rows, rates = found.state[own], found.gradient[own], found.rates[own]
    residual, moved = end[1:] - start[1:], rows[1:, 1:n]
    # Unknown are the change of the state, across the flow, and that of the period.
    along = Field(tree, pieces_at(tree, start))(start, tree.p)[1:]
    matrix = np.zeros((n, n))
    matrix[:-1, :-1], matrix[:-1, -1] = moved - np.eye(n - 1), rates[1:]
    matrix[-1, :-1] = along / np.linalg.norm(along)
    right = np.column_stack([residual, rows[1:, n:]])
    solved = np.linalg.solve(matrix, np.vstack([-right, np.zeros(right.shape[1])]))[-1]
    values = np.linalg.eigvals(moved)
    return CheckedCycle(
        float(np.max(np.abs(residual))),
        period + float(solved[0]),
        values[np.argsort(-np.abs(values))],
        solved[1:],
        found.switches,
    )


def _names_later(tree: Tree, exchanges: bool) -> list[int]:
    """Places in a state of what has each place's name after the cycle."""
    free = list(tree.free)
    half = [0, 1, *(2 + free.index(tree.sides[j] if exchanges else j) for j in free)]
    return half + [len(half) + k for k in half]
