"""Precise solves of the compliant walker: Radau IIA collocation in multiple precision.

For motions that leave SciPy's solves in doubt, by rounding above all. The equations are those of
`compliant`, run on mpmath's numbers; only Newton's corrections are of double precision.
"""

import functools
import importlib
import importlib.util
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from . import compliant
from .collocation import Radau, precise_radau

_DIGITS, _STAGES = 40, 7
_FINE, _COARSE = 1e-17, 1e-14
"""Defects of a step, in units of the walker, of the solve and of the second that it is held
against; where steps are smooth their errors are far below."""
_FIRST = 1e-8
"""First step, as a share of the time."""
_MOST_STEPS, _MOST_CORRECTIONS = 30000, 40
_GROWTH, _AGAIN, _SHRINKAGE = 6.0, 1.5, 0.1
"""Most by which a step grows, where none was rejected and where one was, and shrinks."""
_CHANGE = 2.0**-70
"""Differences of Jacobians [SI]."""
_ROUGH = 1e-10
"""Defect that double precision tells for certain."""


class Precise(NamedTuple):
    """A motion's end.

    Attributes:
        state: shape (8,) or (10,) with bristles [SI].
        doubt: largest difference to a coarser solve's, in units of the walker; infinite where one
            of the two fails.
        lowest: least height of the hip before the last hundredth of the time [m].
    """

    state: np.ndarray
    doubt: float
    lowest: float


def can_be_precise() -> bool:
    """Whether mpmath is installed."""
    return importlib.util.find_spec("mpmath") is not None


def precise_motion(start: np.ndarray, p: np.ndarray, duration: float, units: np.ndarray) -> Precise:
    """The motion from a start, whose numbers count as exact.

    Args:
        start: shape (8,), or (10,) with bristles, SI units.
        p: the numbers of the scene, see `compliant`.
        duration: simulated time [s].
        units: of the state's numbers.
    """
    fine, coarse = (_end(start, p, duration, units, defect) for defect in (_FINE, _COARSE))
    if fine is None or coarse is None:
        return Precise(np.full(start.size, np.nan), np.inf, np.nan)
    apart = np.max(np.abs((fine[0] - coarse[0]).astype(float)) / units)
    return Precise(fine[0].astype(float), float(apart), fine[1])


@functools.cache
def _context() -> Any:
    """Numbers of 40 digits, of a context that nobody else changes."""
    context = importlib.import_module("mpmath").mp.clone()
    context.dps = _DIGITS
    return context


def _method() -> Radau:
    return precise_radau(_STAGES, _context())


@functools.cache
def _equations() -> Callable[[Any, np.ndarray, np.ndarray], np.ndarray]:
    """The time derivative of `compliant`, its code run on numbers of 40 digits."""
    context = _context()

    def zeros(shape: Any) -> np.ndarray:
        return np.full(shape, context.mpf(0), object)

    functions = ("sin", "cos", "exp", "sqrt", "tanh")
    return compliant.on_numbers(
        zeros=zeros,
        copysign=lambda size, sign: size if sign >= 0 else -size,
        **{name: getattr(context, name) for name in functions},
    )["derivative"]


def _end(
    start: np.ndarray, p: np.ndarray, duration: float, units: np.ndarray, defect: float
) -> tuple[np.ndarray, float] | None:
    """State at the end and least height of the hip, or None where steps come to nothing."""
    number = _context().mpf
    y = np.array([number(float(each)) for each in start], object)
    exact = np.array([number(float(each)) for each in p], object)
    t, end, step = number(0), number(duration), number(_FIRST * duration)
    lowest, rates = math.inf, _equations()(0, y, exact)
    slopes, growth = _jacobian(y, rates, exact), _GROWTH
    for _ in range(_MOST_STEPS):
        step = min(step, end - t)
        found = _stepped(y, rates, slopes, step, p, exact, units, defect)
        if found is None:
            step, growth = 0.25 * step, _AGAIN
            if t + step * number(1e-6) == t or step < 1e-22 * duration:
                return None
            continue
        after, rates_after, size = found
        change = 0.9 * (defect / max(size, 1e-300)) ** (1.0 / (_STAGES + 1))
        if size > defect:
            step, growth = step * max(_SHRINKAGE, change), _AGAIN
            continue
        t, y, rates = t + step, after, rates_after
        if t >= end:
            return y, lowest
        if t < 0.99 * duration:
            lowest = min(lowest, float(y[1]))
        step *= min(growth, max(_SHRINKAGE, change))
        slopes, growth = _jacobian(y, rates, exact), _GROWTH
    return None


def _stepped(
    y: np.ndarray,
    rates: np.ndarray,
    slopes: np.ndarray,
    step: Any,
    p: np.ndarray,
    exact: np.ndarray,
    units: np.ndarray,
    defect: float,
) -> tuple[np.ndarray, np.ndarray, float] | None:
    """State after a step, its rates and the step's defect; None where no correction converges."""
    nodes, matrix, before, _ = _method()
    derivative, h, rough = _equations(), float(step), y.astype(float)
    coarse = matrix.astype(float)
    inverse = np.linalg.inv(np.eye(_STAGES * y.size) - h * np.kron(coarse, slopes))

    def unresolved(early: np.ndarray) -> float:
        """The polynomial through the stages' rates need not have those of the step's beginning."""
        early = np.linalg.solve(np.eye(y.size) - h * _real_eigenvalue() * slopes, early)
        return float(np.max(np.abs(early) / units))

    # First in double precision, which costs next to nothing.
    begun = _corrected(
        lambda z: compliant.derivative(0.0, rough + z, p),
        h * np.outer(nodes.astype(float), rates.astype(float)),
        h * coarse, inverse, units, 1e-13, 1e-7,
    )  # fmt: skip
    if begun is None:
        return None
    size = unresolved(h * (before.astype(float) @ begun[1] - rates.astype(float)))
    if size > max(1e3 * defect, _ROUGH):
        return y, rates, size
    found = _corrected(
        lambda z: derivative(0, y + z, exact),
        np.vectorize(_context().mpf, otypes=[object])(begun[0]),
        step * matrix, inverse, units, 1e-4 * defect, 0.0,
    )  # fmt: skip
    if found is None:
        return None
    moved, every = found
    after = y + moved[-1]
    size = unresolved((step * (np.dot(before, every) - rates)).astype(float))
    return after, derivative(0, after, exact), size


def _corrected(
    derivative: Callable[[np.ndarray], np.ndarray],
    moved: np.ndarray,
    weights: np.ndarray,
    inverse: np.ndarray,
    units: np.ndarray,
    enough: float,
    stalled: float,
) -> tuple[np.ndarray, np.ndarray] | None:
    """Changes of the state at the stages and the rates there, by simplified Newton's method.

    Corrections end where they are small `enough`, or where rounding lets them shrink no more once
    they are below `stalled`; None where they do not shrink before.
    """
    last = math.inf
    for _ in range(_MOST_CORRECTIONS):
        every = np.stack([derivative(each) for each in moved])
        residual = (np.dot(weights, every) - moved).astype(float)
        correction = (inverse @ residual.ravel()).reshape(moved.shape)
        size = float(np.max(np.abs(correction) / units))
        moved = moved + correction
        if size <= enough:
            return moved, every
        if not size < 0.7 * last:
            return (moved, every) if size <= stalled else None
        last = size
    return None


def _jacobian(y: np.ndarray, rates: np.ndarray, exact: np.ndarray) -> np.ndarray:
    """Derivatives of the rates with respect to y, shape (n, n), by differences that cross nothing.

    A light walker's load may come near zero where it is the difference of two large forces.
    """
    columns = []
    for k in range(y.size):
        moved = y.copy()
        moved[k] += _CHANGE
        columns.append((_equations()(0, moved, exact) - rates) / _CHANGE)
    return np.stack(columns, axis=1).astype(float)


@functools.cache
def _real_eigenvalue() -> float:
    """Of the collocation's matrix, which has one for an odd number of stages."""
    values = np.linalg.eigvals(_method().matrix.astype(float))
    return float(values[np.argmin(np.abs(values.imag))].real)
