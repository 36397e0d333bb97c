"""Convergence test: what arrivals so far tell of a walk, and when its label is certain."""

import functools
import math
import operator
from typing import NamedTuple

import jax.numpy as jnp

from jaxbiped._types import Numbers, Scalar
from jaxbiped.basins._labels import Label
from jaxbiped.dynamics._state import Periods, turned_difference

NO_GAIT = -math.inf
"""Radius of a place for a gait that holds none."""
DEPTH = 4
"""Longest cycle [footsteps] that is recognised where no gait is known."""
_AGAIN = 3
"""Arrivals in a row that must each be near the one a cycle before."""
_IN_A_ROW, _OFF, _NOISE = 4, 0.1, 10.0
"""Cycles in a row for which a walk must do what a gait's linear model says; how far it may be off
as a share of the distance, and besides in units of the solver's tolerance."""
_CYCLE = 1e-2
"""Share of the change within a cycle that may be left after it, where it repeats itself."""
_NEARING = 0.999
"""Share of the distance from a known gait, a cycle ago, below which it may be where this ends."""
UNDECIDED = int(Label.PENDING)


class Goals(NamedTuple):
    """G gaits of a scene, their states without `ROOT_x` having m components.

    Attributes:
        points, metrics, models, slowest, contractions, radii: of each `Attractor`, with a first
            axis of length G. A place that holds no gait has the radius `NO_GAIT`.
        scales: size of each component, by which recurrences are measured; shape (m,).
    """

    points: Numbers
    metrics: Numbers
    models: Numbers
    slowest: Numbers
    contractions: Numbers
    radii: Numbers
    scales: Numbers


class ArrivalHistory(NamedTuple):
    """What is remembered; scalars, but for tuples of them.

    Attributes:
        recent: states at the last `DEPTH` of them, the latest first, without `ROOT_x`.
        distances: of each gait's point, at as many of the last ones as its cycle has.
        slow: offsets from it in its slowest direction, at as many as two of its cycles have.
        steady: for each gait, at as many of the last ones as its cycle has, how many arrivals a
            cycle apart did what its linear model says.
        closest: smallest distance of any.
        rate: share of the distance that is left after a footstep, from the last cycle; NaN before.
        repeats: for cycles of 1, 2, … footsteps, how many arrivals in a row repeated one.
        verdict: code of the `Label` that is certain, `UNDECIDED` before.
        goal: position of the gait that it converges to, −1 for none.
        cycle_footsteps: footsteps in the cycle that it converges to, 0 for none.
    """

    recent: tuple[tuple[Scalar, ...], ...]
    distances: tuple[tuple[Scalar, ...], ...]
    slow: tuple[tuple[Scalar, ...], ...]
    steady: tuple[tuple[Scalar, ...], ...]
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
        slow=tuple(tuple([far] * (2 * length)) for length in cycles),
        steady=tuple(tuple([none] * length) for length in cycles),
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
    rtol: Scalar,
    periods: Periods = (),
    lasting: tuple[Scalar, ...] | None = None,
) -> ArrivalHistory:
    """After an arrival in this state; `rtol` is the solver's tolerance.

    Differences of components with a period are those modulo it; () if no component has one.
    `lasting` tells for cycles of 1, 2, … arrivals whether the last one took as long as the one
    before, without which none is taken for repeated; None: durations are not asked.

    It converges to a known gait where it lies within that gait's radius, and nearer than a cycle
    before, or within `gap` of the state then: at the gait itself rounding decides which is nearer.
    Also where for several cycles it does what that gait's linear model says: the offset in the
    slowest direction shrinks as its multiplier promises, or that much is hidden by the tolerance.
    Slow gaits are recognised by that.
    Where each of several arrivals in a row differs from the one a cycle before by less
    than `gap` (in units of the scales, root mean square), and no known gait comes nearer, it
    converges to some other one: the verdict is then "unresolved", with the cycle's footsteps.
    """
    repeats = _repeats(trace, state, goals, gap, periods, lasting)
    distances, slows, steadies, certain, rates = [], [], [], [], []
    nearing = jnp.asarray(False)
    for g, length in enumerate(cycles):
        off = _off(goals, g, state, periods)
        distance = _distance(goals, g, off)
        before = trace.distances[g][-1]
        nearer = distance < before
        nearing |= jnp.isfinite(before) & (distance < _NEARING * before)
        # Of a longer cycle only the arrivals tell that are near the point itself.
        for other in trace.distances[g][:-1]:
            nearing |= other < _NEARING * distance
        slow = _size(_times(goals.slowest[g], off))
        steady = jnp.zeros_like(trace.goal)
        if length <= DEPTH:
            nearer |= repeats[length - 1] > 0
            does = _does_as_predicted(trace, off, goals, g, slow, length, rtol, periods)
            steady = jnp.where(does & jnp.isfinite(distance), trace.steady[g][-1] + 1, 0)
        nearing |= steady > 0
        inside = (distance <= goals.radii[g]) & jnp.isfinite(before) & nearer
        certain.append(inside | (steady >= _IN_A_ROW))
        steadies.append((steady, *trace.steady[g][:-1]))
        rates.append((distance / before) ** (1.0 / length))
        distances.append((distance, *trace.distances[g][:-1]))
        slows.append((slow, *trace.slow[g][:-1]))
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
        slow=tuple(slows),
        steady=tuple(steadies),
        closest=jnp.minimum(trace.closest, nearest),
        rate=rate,
        repeats=repeats,
        verdict=verdict,
        goal=goal,
        cycle_footsteps=cycle,
    )


def _distance(goals: Goals, g: int, off: list[Scalar]) -> Scalar:
    """From a gait's point, in its metric; infinite where there is no such gait."""
    distance = _size(_times(goals.metrics[g], off))
    return jnp.where(goals.radii[g] == NO_GAIT, jnp.inf, distance)


def _does_as_predicted(
    trace: ArrivalHistory,
    here: list[Scalar],
    goals: Goals,
    g: int,
    slow: Scalar,
    length: int,
    rtol: Scalar,
    periods: Periods,
) -> Scalar:
    """Whether the last cycles were those of the gait's linear model.

    It may be off by a tenth of the offset, over one cycle or, as near a multiplier of −1 it is
    right over two from farther away, over both. In the slowest direction it must have led nearer
    in these two by half of what the multiplier promises: what is left out of the model then turns
    nothing back on the way to the gait, and what lies beyond an unstable cycle does not pass for
    drawn in.
    Where the tolerance hides how much that is, it must be as near as before and the model hold.
    """
    now, holds = _times(goals.metrics[g], here), []
    noise = _NOISE * rtol
    for cycles in range(1, DEPTH // length + 1)[:2]:
        before = trace.recent[cycles * length - 1]
        then = predicted = _times(goals.metrics[g], _off(goals, g, before, periods))
        for _ in range(cycles):
            predicted = _times(goals.models[g], predicted)
        off = _size([a - b for a, b in zip(now, predicted, strict=True)])
        holds.append(off <= _OFF * _size(then) + noise)
    earlier, rho = trace.slow[g][-1], 2.0 * goals.contractions[g] - 1.0
    drawn = slow <= 0.5 * (1.0 + rho * rho) * earlier
    hidden = ((1.0 - rho) * slow < noise) & (slow < earlier + noise) & holds[0]
    either = functools.reduce(operator.or_, holds)
    return jnp.isfinite(earlier) & ((either & drawn) | hidden)


def _off(goals: Goals, g: int, state: tuple[Scalar, ...], periods: Periods) -> list[Scalar]:
    return [_change(x, goals.points[g, i], periods, i) for i, x in enumerate(state)]


def _change(x: Scalar, y: Scalar, periods: Periods, i: int) -> Scalar:
    change: Scalar = x - y
    return turned_difference(change, periods[i]) if periods else change


def _times(matrix: Scalar, vector: list[Scalar]) -> list[Scalar]:
    rows = range(matrix.shape[0])
    return [_sum([matrix[j, i] * each for i, each in enumerate(vector)]) for j in rows]


def _size(parts: list[Scalar]) -> Scalar:
    return jnp.sqrt(_sum([part * part for part in parts]))


def _repeats(
    trace: ArrivalHistory,
    state: tuple[Scalar, ...],
    goals: Goals,
    gap: Scalar,
    periods: Periods,
    lasting: tuple[Scalar, ...] | None,
) -> tuple[Scalar, ...]:
    offs: list[Scalar] = []
    for old in trace.recent:
        parts = [
            _change(x, y, periods, i) / goals.scales[i]
            for i, (x, y) in enumerate(zip(state, old, strict=True))
        ]
        offs.append(_size(parts) / math.sqrt(len(parts)))
    counts = []
    for length, (off, count) in enumerate(zip(offs, trace.repeats, strict=True), 1):
        again = off < gap
        if lasting is not None:
            again &= lasting[length - 1]
        for shorter in (k for k in range(1, length) if length % k == 0):
            # A slow transient about a shorter cycle comes back as well, but less far each time.
            again &= off < jnp.maximum(_CYCLE * offs[shorter - 1], _CYCLE * gap)
        counts.append(jnp.where(again, count + 1, 0))
    return tuple(counts)


def _sum(terms: list[Scalar]) -> Scalar:
    return functools.reduce(operator.add, terms)
