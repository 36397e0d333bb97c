"""Convergence test: what arrivals so far tell of a walk, and when its label is certain."""

import functools
import operator
from typing import NamedTuple

import jax.numpy as jnp

from jaxbiped._types import Scalar
from jaxbiped.basins._label import Label
from jaxbiped.sweep._goals import NO_GAIT, Goals

DEPTH = 4
"""Longest cycle [footsteps] that is recognised where no gait is known."""
_AGAIN = 3
"""Arrivals in a row that must each be near the one a cycle before."""
_NEARING = 0.999
"""Share of the distance from a known gait, a cycle ago, below which it may be where this ends."""
UNDECIDED = int(Label.PENDING)


class ArrivalHistory(NamedTuple):
    """What is remembered; scalars, but for tuples of them.

    Attributes:
        recent: states at the last `DEPTH` of them, the latest first, without hip_x.
        distances: of each gait's point, at as many of the last ones as its cycle has.
        closest: smallest distance of any.
        rate: share of the distance that is left after a footstep, from the last cycle; NaN before.
        repeats: for cycles of 1, 2, … footsteps, how many arrivals in a row repeated one.
        verdict: code of the `Label` that is certain, `UNDECIDED` before.
        goal: position of the gait that it converges to, −1 for none.
        cycle_footsteps: footsteps in the cycle that it converges to, 0 for none.
    """

    recent: tuple[tuple[Scalar, ...], ...]
    distances: tuple[tuple[Scalar, ...], ...]
    closest: Scalar
    rate: Scalar
    repeats: tuple[Scalar, ...]
    verdict: Scalar
    goal: Scalar
    cycle_footsteps: Scalar


def empty_history(zero: Scalar, size: int, cycles: tuple[int, ...]) -> ArrivalHistory:
    """Before the first arrival; states have `size` components, the gaits' cycles these lengths."""
    none = jnp.zeros((), dtype=jnp.int64)
    far = zero + jnp.inf
    return ArrivalHistory(
        recent=tuple([tuple([far] * size)] * DEPTH),
        distances=tuple(tuple([far] * length) for length in cycles),
        closest=far,
        rate=zero + jnp.nan,
        repeats=tuple([none] * DEPTH),
        verdict=none + UNDECIDED,
        goal=none - 1,
        cycle_footsteps=none,
    )


def after_arrival(
    trace: ArrivalHistory,
    state: tuple[Scalar, ...],
    goals: Goals,
    cycles: tuple[int, ...],
    gap: Scalar,
) -> ArrivalHistory:
    """After an arrival in this state.

    It converges to a known gait where it lies within that gait's radius, and nearer than a cycle
    before, or within `gap` of the state then: at the gait itself rounding decides which is nearer.
    Where each of several arrivals in a row differs from the one a cycle before by less
    than `gap` (in units of the scales, root mean square), and no known gait comes nearer, it
    converges to some other one: the verdict is then "unresolved", with the cycle's footsteps.
    """
    repeats = _repeats(trace, state, goals, gap)
    distances, certain, rates = [], [], []
    nearing = jnp.asarray(False)
    for g, length in enumerate(cycles):
        distance = _distance(goals, g, state)
        before = trace.distances[g][-1]
        nearer = distance < before
        nearing |= jnp.isfinite(before) & (distance < _NEARING * before)
        # Of a longer cycle only the arrivals tell that are near the point itself.
        for other in trace.distances[g][:-1]:
            nearing |= other < _NEARING * distance
        if length <= DEPTH:
            nearer |= repeats[length - 1] > 0
        certain.append((distance <= goals.radii[g]) & jnp.isfinite(before) & nearer)
        rates.append((distance / before) ** (1.0 / length))
        distances.append((distance, *trace.distances[g][:-1]))
    verdict, cycle, goal = trace.verdict, trace.cycle_footsteps, trace.goal
    for length in range(DEPTH, 0, -1):
        again = (repeats[length - 1] >= _AGAIN) & ~nearing
        verdict = jnp.where(again, int(Label.UNRESOLVED), verdict)
        cycle = jnp.where(again, length, cycle)
    nearest, rate = jnp.full_like(trace.closest, jnp.inf), trace.rate
    for g in range(len(cycles)):
        nearer = distances[g][0] < nearest
        # Far from every gait the nearest one tells the rate.
        known = jnp.isfinite(trace.distances[g][-1]) & jnp.isfinite(rates[g])
        rate = jnp.where(nearer & known, rates[g], rate)
        nearest = jnp.minimum(nearest, distances[g][0])
    for g, length in reversed(list(enumerate(cycles))):
        verdict = jnp.where(certain[g], int(Label.WALKING), verdict)
        cycle = jnp.where(certain[g], length, cycle)
        goal = jnp.where(certain[g], g, goal)
        # Where nothing but rounding is left of the distance it says nothing.
        left = jnp.where(distances[g][0] < trace.distances[g][-1], rates[g], jnp.nan)
        rate = jnp.where(certain[g], left, rate)
    return ArrivalHistory(
        recent=(state, *trace.recent[:-1]),
        distances=tuple(distances),
        closest=jnp.minimum(trace.closest, nearest),
        rate=rate,
        repeats=repeats,
        verdict=verdict,
        goal=goal,
        cycle_footsteps=cycle,
    )


def _distance(goals: Goals, g: int, state: tuple[Scalar, ...]) -> Scalar:
    """From a gait's point, in its metric; infinite where there is no such gait."""
    off = [x - goals.points[g, i] for i, x in enumerate(state)]
    rows = range(goals.metrics.shape[1])
    parts = [_sum([goals.metrics[g, j, i] * e for i, e in enumerate(off)]) for j in rows]
    distance = jnp.sqrt(_sum([part * part for part in parts]))
    return jnp.where(goals.radii[g] == NO_GAIT, jnp.inf, distance)


def _repeats(
    trace: ArrivalHistory, state: tuple[Scalar, ...], goals: Goals, gap: Scalar
) -> tuple[Scalar, ...]:
    counts = []
    for old, count in zip(trace.recent, trace.repeats, strict=True):
        parts = [(x - y) / goals.scales[i] for i, (x, y) in enumerate(zip(state, old, strict=True))]
        off = jnp.sqrt(_sum([part * part for part in parts]) / len(parts))
        counts.append(jnp.where(off < gap, count + 1, 0))
    return tuple(counts)


def _sum(terms: list[Scalar]) -> Scalar:
    return functools.reduce(operator.add, terms)
