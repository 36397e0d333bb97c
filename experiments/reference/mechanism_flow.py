"""The motion of a mechanism over a while, or its gait, with derivatives: collocation on pieces.

Every surface between smooth pieces is located, tangents jump there by saltation, and are carried by
the equations that the collocation's own solution satisfies. A gait is from a state of it and its
period, without a section: the flow's own direction has the multiplier 1.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import scipy.optimize

from .collocation import Radau, radau
from .mechanism_equations import FREE, Tree, contacts, leg_rates, motion_of
from .mechanism_pieces import KINDS, TINY, Field, beyond, pieces_at, sides, surfaces

END = -1
"""Among the surfaces: where a leg stands upright."""
FIRST_STEP, GROWTH = 1e-10, 2.5
"""Steps after a switch begin so small [s] that a root's singularity at touchdown is graded away."""


class Flow(NamedTuple):
    """A motion's end, and its derivatives at equal times.

    Attributes:
        time: [s]. state: (n,).
        gradient: with respect to the start and the directions, (n, n + k).
        rates: of the state at the end, (n,). switches: what was met, with its times [s].
        steps: each with its length [s] and the state at its end.
    """

    time: float
    state: np.ndarray
    gradient: np.ndarray
    rates: np.ndarray
    switches: list[tuple[str, float]]
    steps: "list[tuple[Step, float, np.ndarray]]"


class Step(NamedTuple):
    """A step's beginning on a piece, and the method."""

    y: np.ndarray
    field: Field
    method: Radau

    def stages(self, h: float) -> np.ndarray | None:
        """States at the stages (s, n) by Newton's method; None where it does not converge."""
        p, (nodes, matrix) = self.field.tree.p, self.method[:2]
        s, n = len(nodes), len(self.y)
        at = self.y + h * nodes[:, None] * self.field(self.y, p)
        change, factors = np.inf, None
        with np.errstate(all="ignore"):
            for trial in range(40):
                rates = self.field(at, p)
                left = (self.y - at + h * matrix @ rates).ravel()
                if not np.isfinite(left).all():
                    return None
                if trial % 3 == 0:
                    system = _system(h, matrix, self.field.slopes(at, p, np.zeros((0, len(p)))))
                    if not np.isfinite(system).all():
                        return None
                    factors = np.linalg.inv(system)
                step = (factors @ left).reshape(s, n)
                at = at + step
                before, change = change, float(np.max(np.abs(step)))
                if not np.isfinite(change) or change > 1e3:
                    return None
                if change < 1e-15 or (change < 1e-12 and change > 0.5 * before):
                    return at
        return None

    def carried(self, w: np.ndarray, at: np.ndarray, h: float, to: np.ndarray) -> np.ndarray:
        """Tangents at the stages (s, n, n + k): what the collocation's solution changes by."""
        every = self.field.slopes(at, self.field.tree.p, to)
        (s, n), matrix = at.shape, self.method.matrix
        left = np.repeat(w[None], s, 0)
        left[:, :, n:] += h * np.tensordot(matrix, every[:, :, n:], 1)
        system = _system(h, matrix, every[:, :, :n])
        return np.linalg.solve(system, left.reshape(s * n, -1)).reshape(s, n, -1)


def _system(h: float, matrix: np.ndarray, every: np.ndarray) -> np.ndarray:
    s, n = every.shape[:2]
    blocks = -h * matrix[:, None, :, None] * np.swapaxes(every, 0, 1)[None]
    return np.eye(s * n) + blocks.reshape(s * n, s * n)


def flow(
    tree: Tree,
    start: np.ndarray,
    duration: float,
    directions: np.ndarray,
    *,
    upright: int | None = None,
    stages: int = 7,
    resolution: float = 1e-10,
) -> Flow:
    """The motion from a start and its derivatives.

    Args:
        tree: the mechanism.
        start: root point, free angles, and their rates, (n,).
        duration: at most [s].
        directions: in its numbers, by which to differentiate, (k, P).
        upright: a foot, at the end of a leg of one body: the motion ends where that stands upright.
        stages: of the collocation, whose order is twice that less one.
        resolution: what its last Legendre mode may have of state and tangents.
    """
    method, y, n = radau(stages), np.array(start, float), len(start)
    w = np.eye(n, n + len(directions))
    field = Field(tree, pieces_at(tree, y))
    t, h, met, steps = 0.0, FIRST_STEP, [], []
    while t < duration:
        h = min(h, duration - t)
        step = Step(y, field, method)
        at = step.stages(h)
        size = np.inf if at is None else _unresolved(method.last, at)
        if at is None or size > resolution:
            h *= 0.5 if at is None else max(0.2, 0.9 * (resolution / size) ** (1.0 / stages))
            if h < 1e-16:
                raise RuntimeError(f"no step at {t} s")
            continue
        which, span = _first_crossing(step, at, h, upright)
        if which is not None and span < h:
            found = step.stages(span)
            assert found is not None
            at = found
        moved = step.carried(w, at, span, directions)
        rough = max(_unresolved(method.last, at), _unresolved(method.last, moved))
        if rough > resolution:
            h = span * max(0.2, 0.9 * (resolution / rough) ** (1.0 / stages))
            continue
        y, w, t = at[-1], moved[-1], t + span
        steps.append((step, span, y))
        room = (resolution / max(rough, 1e-30)) ** (1.0 / stages)
        h = span * min(GROWTH, max(0.2, 0.9 * room))
        if which is None:
            continue
        if which == END:
            break
        met.append((f"{KINDS[which % 5]} {which // 5}", t))
        after = Field(tree, beyond(tree, field.pieces, which, y))
        later = _delay(field, which, y, w, directions)
        w = w + np.outer(field(y, tree.p) - after(y, tree.p), later)
        field, h = after, FIRST_STEP
    return Flow(t, y, w, field(y, tree.p), met, steps)


def _delay(
    field: Field, which: int, y: np.ndarray, w: np.ndarray, directions: np.ndarray
) -> np.ndarray:
    """Derivative of the time at which a surface is met."""
    tree, n = field.tree, len(y)
    by_state = surfaces(tree, y + 1j * TINY * np.eye(n), tree.p + 0j)[:, which].imag / TINY
    moved = tree.p + 1j * TINY * directions
    by_number = surfaces(tree, y + 0j, moved)[:, which].imag / TINY if len(directions) else []
    speed = by_state @ field(y, tree.p)
    return -(by_state @ w + np.append(np.zeros(n), by_number)) / speed


def _unresolved(last: np.ndarray, stages: np.ndarray) -> float:
    """The last Legendre mode over a step, relative to 1 or the column's largest number."""
    size = np.maximum(1.0, np.max(np.abs(stages), axis=(0, 1) if stages.ndim == 3 else 0))
    return float(np.max(np.abs(np.tensordot(last, stages, 1)) / size))


def _first_crossing(
    step: Step, at: np.ndarray, h: float, upright: int | None
) -> tuple[int | None, float]:
    """The surface at which the piece ends within a step, and the step that ends there."""
    tree, pieces = step.field.tree, step.field.pieces
    motion = motion_of(tree, at, tree.p)
    values, rates = surfaces(tree, at, tree.p), leg_rates(tree, motion, tree.p)
    sinking = [each.sinking for each in contacts(tree, motion, tree.p)]
    found: list[tuple[float, int]] = []
    for which, side in sides(tree, pieces).items():
        k, kind = divmod(which, 5)
        past = side * values[:, which] < 0.0
        if kind == 0:
            past &= side * sinking[k] < 0.0
        if k < len(tree.feet) and tree.gated:
            turning_back = rates[tree.legs[k]] < 0.0
            deep = values[:, 5 * k] > 0.0
            if pieces.pressing[k] == FREE:
                if (deep & turning_back).any() and (deep & ~turning_back).any():
                    raise RuntimeError(f"the leg of foot {k} turns back while it is in the ground")
                past &= turning_back
            elif not turning_back.all():
                raise RuntimeError(f"the leg of foot {k} stops while it stands")
        if past.any():
            own = lambda y, which=which, side=side: side * surfaces(tree, y, tree.p)[which]  # noqa: E731
            found.append((_span(step, own, h * step.method.nodes[past.argmax()]), which))
    if upright is not None and pieces.pressing[upright] != FREE:
        place = 2 + tree.free.index(tree.feet[upright])
        past = at[:, place] < 0.0
        if past.any():
            high = h * step.method.nodes[past.argmax()]
            found.append((_span(step, lambda y: y[place], high), END))
    if not found:
        return None, h
    span, which = min(found)
    return which, span


def _span(step: Step, surface: Callable[[np.ndarray], float], high: float) -> float:
    """The step that ends on a surface which is crossed within `high`."""

    def value(span: float) -> float:
        at = step.stages(span)
        assert at is not None
        return float(surface(at[-1]))

    return float(scipy.optimize.brentq(value, 1e-6 * high, high, xtol=1e-22, rtol=1e-15))


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
