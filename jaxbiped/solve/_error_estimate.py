"""Error estimate of a result: its error bars, and what was done to have them."""

from collections.abc import Callable, Iterable
from typing import TypeVar

import equinox as eqx
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_positive, warn
from jaxbiped._types import JsonObject, is_traced

LOOSER = 10.0
"""How many times looser a tolerance the first witness of an error takes."""
_AIM = 0.3
"""Share of the error wanted that the next tolerance aims at."""
_LEAST, _MOST = 1e-3, 0.3
"""Bounds of the factor from one tolerance to the next."""
_GAIN = 0.7
"""Error left by a tolerance at most 0.3 times the last, from which rounding has taken over."""
_ROUNDS = 6
_ROUNDINGS = 32.0
"""Finest relative tolerance, in roundings of the precision."""


class ErrorEstimate(eqx.Module):
    """Estimated errors of a result that was asked for by a number.

    An error bar comes from two changes of the result: under a ten times looser tolerance, and under
    another method of steps. A walk's is the larger of both, the other method's counted twice where
    that is as fine; a gait's is a weighted sum of both.

    Attributes:
        bars: error bars, shaped and named like what they belong to, SI units.
        relative: relative error reached, the largest over everything returned; infinite where the
            outcome itself, or an error, is in doubt.
        wanted: relative error asked for.
        rtol: relative tolerance of the state that was used at last.
        rounds: how many tolerances were tried.
        met: whether `relative` is at most `wanted`.
        reason: one sentence on why not; "" where it is.
    """

    bars: PyTree
    relative: float = eqx.field(static=True)
    wanted: float = eqx.field(static=True)
    rtol: float = eqx.field(static=True)
    rounds: int = eqx.field(static=True)
    met: bool = eqx.field(static=True)
    reason: str = eqx.field(static=True)


Result = TypeVar("Result")
Judged = tuple[PyTree, float, str]
"""Error bars, the largest relative error, and a sentence where a finer solve is of no use."""


def check_wanted(accuracy: object, **replaced: object) -> None:
    """Raises `ArgumentError` unless a number may be asked for beside what else is given."""
    check_positive("accuracy", accuracy)
    if np.asarray(accuracy).ndim:
        raise ArgumentError("accuracy has several entries: give one number.")
    for name, value in replaced.items():
        if value is not None:
            raise ArgumentError(
                f"{name} = {value!r} is not allowed beside accuracy = {accuracy!r}: a number "
                "chooses the tolerances itself."
            )


def check_untraced(accuracy: float, given: PyTree, names: Iterable[str]) -> None:
    """Raises `ArgumentError` for a number, unlike a name, where what is given is traced."""
    if is_traced(given):
        raise ArgumentError(
            f"accuracy = {accuracy:g} is not allowed under jit, vmap or differentiation: name one "
            f"of {', '.join(names)} there."
        )


def refine(
    attempt: Callable[[float], tuple[Result, Judged]],
    wanted: float,
    *,
    first: float,
    dtype: np.dtype,
    finest: float = 1e-12,
) -> tuple[Result, ErrorEstimate]:
    """Tightens the tolerance until the estimated error is what is wanted, or nothing is gained.

    `attempt` gives a result at a relative tolerance, with its judged error; the first tolerance is
    `first`, and `finest` the finest one of 64 bits.

    Returns:
        The result of the least error, and its estimate; where that is too large a
        `RuntimeWarning` is issued.
    """
    floor = max(finest, _ROUNDINGS * float(np.finfo(dtype).eps))
    tolerance, best, reason = max(first, floor), None, ""
    rounds = 0
    while rounds < _ROUNDS:
        rounds += 1
        result, (bars, relative, hopeless) = attempt(tolerance)
        before = np.inf if best is None else best[2]
        if best is None or relative < before:
            best = (result, bars, relative, tolerance)
        stalled = np.isfinite(before) and relative > _GAIN * before
        if relative <= wanted or hopeless or stalled or tolerance <= floor:
            ended = f"rounding of {dtype}: finer steps gain nothing" if stalled else ""
            reason = hopeless or ended or f"{floor:.0e} is the finest tolerance"
            break
        reason = f"{_ROUNDS} tolerances were tried"
        known = np.isfinite(relative)
        factor = float(np.clip(_AIM * wanted / relative, _LEAST, _MOST)) if known else 0.1
        tolerance = max(factor * tolerance, floor)
    assert best is not None
    result, bars, relative, tolerance = best
    met = relative <= wanted
    error = ErrorEstimate(
        bars, float(relative), float(wanted), float(tolerance), rounds, met, "" if met else reason
    )
    if not met:
        warn(shortfall(error))
    return result, error


def shortfall(error: ErrorEstimate) -> str:
    """One sentence on an accuracy that was not kept."""
    return (
        f"accuracy = {error.wanted:g} is not met: the estimated relative error is "
        f"{error.relative:.2g} ({error.reason})."
    )


def error_numbers(error: ErrorEstimate) -> JsonObject:
    """What is known of an error but its bars, ready for JSON."""
    others = {name: getattr(error, name) for name in ("wanted", "rtol", "rounds", "met", "reason")}
    return {"relative": error.relative if np.isfinite(error.relative) else None, **others}


def error_sentence(error: ErrorEstimate) -> str:
    """One sentence on the estimated error, for people."""
    if not error.met:
        return f"WARNING: {shortfall(error)}"
    return (
        f"estimated relative error {error.relative:.1e}, of {error.wanted:g} allowed "
        f"(tolerance {error.rtol:.1e}, {error.rounds} rounds)"
    )
