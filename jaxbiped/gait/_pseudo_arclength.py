"""Pseudo-arclength: points along a curve of zeros, around its folds.

A search without a guess follows the seed's gait by it, and so does every continuation of gaits.
Keller, in Applications of Bifurcation Theory (1977); Seydel, Practical Bifurcation and Stability
Analysis (2010), chapter 4.
"""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

_MOST_CORRECTIONS, _PATIENT = 6, 20
"""Corrections allowed, and where they need not get smaller from the first on."""
_CONTRACTION = 0.6
"""Share of a correction that the next may have."""
_MOST_SECANTS = 24
_BESIDE = 1e-6
"""Share of an interval by which a search moves aside from where it fails."""
_ASIDES = (0.05, 0.1, 0.2)
"""Shares of an interval between the points from which a zero is interpolated."""
_ZERO = 1e-10
"""A test function as small as this has been located."""


class Change(NamedTuple):
    """By how much a map moves a point, and the derivatives of that.

    Attributes:
        value: shape (m,).
        by_point: derivatives with respect to the point, shape (m, m).
        by_s: with respect to the curve's parameter, shape (m,).
        code: 0, or what the map could not do instead.
        seen: what else the evaluation told.
    """

    value: np.ndarray
    by_point: np.ndarray
    by_s: np.ndarray
    code: int
    seen: Any = None


class Curve(NamedTuple):
    """The zeros of a map that changes with a parameter s.

    Attributes:
        change: of a point, shape (m,), and s.
        sizes: of the m components and, last, of s, in which arclength is measured, shape (m + 1,).
        converged: size of a correction that ends the corrector.
    """

    change: Callable[[np.ndarray, float], Change]
    sizes: np.ndarray
    converged: float


class CurvePoint(NamedTuple):
    """A zero.

    Attributes:
        place: point and s in their sizes, shape (m + 1,).
        tangent: unit tangent there, shape (m + 1,).
        change: what was evaluated there.
    """

    place: np.ndarray
    tangent: np.ndarray
    change: Change


class Attempt(NamedTuple):
    """What came of correcting a guess.

    Attributes:
        found: the zero, None where there was none.
        quick: whether few corrections led to it.
        code: what the map could not do, where that was the reason.
    """

    found: CurvePoint | None
    quick: bool = False
    code: int = 0


class StepControl(NamedTuple):
    """Arclengths of steps.

    Attributes:
        first: of the first.
        largest: at most.
        smallest: below which a curve is given up.
        least_cosine: of the angle between the tangents at the two ends of a step.
        aside: how far a point may lie from where the last tangent points, as a share of the step
            besides twice that angle: on one smooth curve it is about half the angle, and anywhere
            on another one.
    """

    first: float
    largest: float
    smallest: float
    least_cosine: float = 0.85
    aside: float = np.inf


def correct(
    curve: Curve,
    guess: np.ndarray,
    along: np.ndarray | None = None,
    *,
    holds_s: bool = False,
    patient: bool = False,
) -> Attempt:
    """The zero near `guess` in the plane normal to a direction, by Newton's method.

    The tangent there points on from that direction. Unless it is given the zero is sought at the
    guess's own s, as where that `holds_s`, and the tangent points towards larger s. Corrections
    that do not get smaller end the search, unless it is `patient`.
    """
    border = np.eye(len(guess))[-1] if along is None or holds_s else along
    point, last = guess, np.inf
    for k in range(_PATIENT if patient else _MOST_CORRECTIONS):
        here = curve.change(point[:-1] * curve.sizes[:-1], float(point[-1] * curve.sizes[-1]))
        if here.code != 0:
            return Attempt(None, code=here.code)
        slopes = _slopes(here, curve.sizes)
        right = np.append(-here.value / curve.sizes[:-1], 0.0)
        try:
            move = np.linalg.solve(np.vstack([slopes, border]), right)
        except np.linalg.LinAlgError:
            return Attempt(None)
        size = float(np.linalg.norm(move))
        if not (patient or size <= max(_CONTRACTION * last, curve.converged)):
            return Attempt(None)
        if size <= curve.converged:
            found = CurvePoint(point + move, _tangent(slopes, along), here)
            return Attempt(found, quick=k <= 2)
        point, last = point + move, size
    return Attempt(None)


def follow(
    curve: Curve,
    begin: CurvePoint,
    control: StepControl,
    *,
    low: float = -np.inf,
    high: float = np.inf,
    is_likely: Callable[[CurvePoint, CurvePoint], bool] = lambda here, there: True,
) -> Iterator[Attempt]:
    """The points of a curve onwards from one, the last of them exactly at a bound of s.

    Steps get shorter where they seem to lead to another curve, also by what `is_likely` says of
    their ends. Where they get too small, a failed attempt tells why at the end.
    """
    here, step = begin, control.first
    bounds = {True: high, False: low}
    while True:
        rise = here.tangent[-1]
        room = bounds[rise > 0.0] - here.place[-1] * curve.sizes[-1]
        length = step
        if abs(rise * curve.sizes[-1] * step) > abs(room):
            length = room / (rise * curve.sizes[-1])
        # The last step ends on the bound, the others where the tangent says.
        guess = here.place + length * here.tangent
        attempt = correct(curve, guess, here.tangent, holds_s=length < step)
        there, doubts = attempt.found, step > 50.0 * control.smallest
        jumps = there is not None and doubts and _jumps(here, there, length, control)
        if there is None or jumps or (doubts and not is_likely(here, there)):
            step *= 0.4
            if step < control.smallest:
                yield Attempt(None, code=attempt.code)
                return
            continue
        yield attempt
        if length < step:
            return
        here = there
        step = min(control.largest, step * (1.7 if attempt.quick else 1.1))


def _jumps(here: CurvePoint, there: CurvePoint, length: float, control: StepControl) -> bool:
    """Whether a step turned too far, or did not lead where a smooth curve would."""
    cosine = min(1.0, float(there.tangent @ here.tangent))
    off = float(np.linalg.norm(there.place - here.place - length * here.tangent))
    allowed = length * (2.0 * np.arccos(max(-1.0, cosine)) + control.aside)
    return cosine < control.least_cosine or off > allowed


def locate(
    curve: Curve, here: CurvePoint, there: CurvePoint, test: Callable[[CurvePoint], float]
) -> CurvePoint | None:
    """The point between two where a test function that has other signs there vanishes.

    By the secant rule with Illinois's halving. Where the curve is lost on the way, as where another
    crosses it, by interpolation between points on both sides, or as near as it came; None where
    there is no such point.
    """
    ends = [0.0, _advance(here, there)]
    values = [test(here), test(there)]
    best, least = None, np.inf
    for _ in range(_MOST_SECANTS):
        (a, b), (u, v) = ends, values
        length = (a * v - b * u) / (v - u)
        found = _at_length(curve, here, best or here, length)
        if found is None:  # where curves cross the plane of the search is no help: beside it
            length += _BESIDE * (b - a)
            found = _at_length(curve, here, best or here, length)
        if found is None:
            beside = (_interpolated(curve, here, there, length, test, aside) for aside in _ASIDES)
            return next((each for each in beside if each is not None), best)
        value = test(found)
        if abs(value) < least:
            best, least = found, abs(value)
        if abs(value) <= _ZERO or abs(b - a) < _ZERO**1.5:
            break
        if value * v < 0.0:
            ends, values = [b, length], [v, value]
        else:
            ends, values = [a, length], [0.5 * u, value]
    return best


def _interpolated(
    curve: Curve,
    here: CurvePoint,
    there: CurvePoint,
    length: float,
    test: Callable[[CurvePoint], float],
    aside: float,
) -> CurvePoint | None:
    """Where a test function vanishes near a length from `here`, by a cubic through four points.

    They lie `aside` and twice that, in units of the interval: Newton's method finds points about a
    crossing of two curves, but none at it.
    """
    whole = _advance(here, there)
    middle = float(np.clip(length, 2.0 * aside * whole, (1.0 - 2.0 * aside) * whole))
    nodes = middle + aside * whole * np.array([-2.0, -1.0, 1.0, 2.0])
    near = [here if at < 0.5 * whole else there for at in nodes]
    points = [_at_length(curve, here, a, float(at)) for a, at in zip(near, nodes, strict=True)]
    known = [point for point in points if point is not None]
    if len(known) < len(nodes):
        return None
    values = np.array([test(point) for point in known])
    scaled = (nodes - middle) / whole
    zeros = np.roots(np.polyfit(scaled, values, 3))
    zeros = zeros[np.abs(zeros.imag) < _BESIDE].real
    zeros = zeros[np.abs(zeros) <= 2.0 * aside]
    if not len(zeros):
        return None
    zero = zeros[np.argmin(np.abs(zeros))]
    place, tangent = (
        np.array([np.polyval(each, zero) for each in np.polyfit(scaled, np.stack(rows), 3).T])
        for rows in ([each.place for each in known], [each.tangent for each in known])
    )
    change = curve.change(place[:-1] * curve.sizes[:-1], float(place[-1] * curve.sizes[-1]))
    return None if change.code else CurvePoint(place, tangent / np.linalg.norm(tangent), change)


def _at_length(
    curve: Curve, here: CurvePoint, near: CurvePoint, length: float
) -> CurvePoint | None:
    """The point so far along the tangent of `here`, from a nearer one."""
    ahead = (length - _advance(here, near)) / (near.tangent @ here.tangent)
    return correct(curve, near.place + ahead * near.tangent, here.tangent).found


def _advance(here: CurvePoint, there: CurvePoint) -> float:
    """How far a point lies along the tangent of another."""
    return float((there.place - here.place) @ here.tangent)


def _slopes(here: Change, sizes: np.ndarray) -> np.ndarray:
    """Derivatives of the scaled change with respect to the scaled point and s, (m, m + 1)."""
    both = np.column_stack([here.by_point, here.by_s])
    return both * sizes / sizes[:-1, None]


def _tangent(slopes: np.ndarray, along: np.ndarray | None) -> np.ndarray:
    """Unit tangent of the curve, on in a direction, or towards larger s."""
    *_, rows = np.linalg.svd(slopes)
    forward = rows[-1][-1] if along is None else rows[-1] @ along
    return rows[-1] if forward >= 0.0 else -rows[-1]
