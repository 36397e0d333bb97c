"""Trace of a curve of gaits in one direction: its points, its bifurcations, and how it ends."""

import functools
from collections.abc import Callable, Collection, Sequence
from itertools import islice
from typing import Any, NamedTuple, cast

import numpy as np

from jaxbiped._ending import Ending
from jaxbiped.continuation._bifurcations import (
    BifurcationPoint,
    BranchEvent,
    bifurcations_between,
    explains,
    not_located,
)
from jaxbiped.continuation._branch_point import Axis, BranchPoint, branch_point
from jaxbiped.continuation._cycle import NO_WALK
from jaxbiped.dynamics._contacts import contacts
from jaxbiped.gait._pseudo_arclength import Curve, CurvePoint, StepControl, correct, follow
from jaxbiped.gait._search_provenance import BranchEnd
from jaxbiped.scene._scene import Scene
from jaxbiped.scene._state_types import State, WalkerState
from jaxbiped.simulate._simulate import simulate

NOT_SMOOTH = "grazing: the return map is not smooth"
OF_ENDINGS = {
    Ending.TIMED_OUT: "no touch: no footstep comes (timed out)",
    Ending.STUMBLED: "scuffing: the foot behind comes down (stumbled)",
}
"""Endings of the walk beyond a branch that are explained in more words."""
_UNLOADED = 1e-3
"""Share of the weight on the stance foot from which it carries nothing."""
_SLIDES = 1.5
"""Factor of the load that slips from which feet slide beyond a limit that they do not before."""
_LITTLE = 0.01
_CHORD_ASIDE = 0.1
"""Distance from a chord between two points, in its length, up to which the curve is asked."""
_SAME, _CORRECTIONS = 1e-7, 10.0
"""Distance of two gaits that are one, at least; and in units of the corrector's last step."""
_SMALLEST = 1e-6
_FIRST = 0.25
"""Of the largest step."""
_LEAST_COSINE, _ASIDE = 0.95, 0.02
_DIVERGED = 1e6
"""Multiplier by which the return map counts as not smooth: near grazing it grows as a root."""
_AT_BOUND = 1e-9
_SAME_WAY = 0.9
"""Cosine between the tangents where a branch passes its own beginning once more."""
LIMITS = (BranchEnd.WALK_ENDS, BranchEnd.BREAKS_OFF, BranchEnd.NO_WALK)
"""Ends that are limits of the model."""
BOUND = "the range ends"


@functools.singledispatch
def limit_cause(
    scene: Any, scene_at: Callable[[float], Any], state: WalkerState, period: float
) -> str | None:
    """What a limit of a scene's gaits comes from; None where neither touch nor slip tells.

    Args:
        scene: the scene that is followed.
        scene_at: the scene at the last gait for 0, and as far before the limit for −1 as behind it
            for 1; at the limit itself rounding decides whether feet slide.
        state: of the last gait, on the section.
        period: of its cycle [s].
    """
    return None


@limit_cause.register
def _(
    scene: Scene, scene_at: Callable[[float], Any], state: WalkerState, period: float
) -> str | None:
    here, before, beyond = map(scene_at, (0.0, -1.0, 1.0))
    if _load(here, state) < _UNLOADED:
        return "no touch: the stance foot carries nothing on the section"
    known, found = (_slipping_load(each, state, period) for each in (before, beyond))
    if slides(known, found):
        return "slip: beyond, a foot that lands slides on"
    return None


def slides(known: float, found: float) -> bool:
    """Whether feet slide under so much more of their load that they do beyond, not before."""
    return found > max(_SLIDES * known, known + _LITTLE)


def _load(scene: Scene, state: WalkerState) -> float:
    """Force on both feet, in units of the weight."""
    both = contacts(scene, cast(State, state)).forces
    weight = float(scene.mechanism.total_mass * scene.ground.g)
    return sum(float(force.normal) for force in both) / weight


def _slipping_load(scene: Scene, state: WalkerState, period: float) -> float:
    """Share of the load, summed over a cycle's time, on feet that slip faster than the speed over
    which friction builds up."""
    walk = simulate(scene, cast(State, state), duration=period)
    found = contacts(scene, walk.state)
    normal = np.stack([np.asarray(force.normal) for force in found.forces])
    slip = np.stack([np.abs(np.asarray(foot.slip_speed)) for foot in found.feet])
    name = getattr(scene.friction, "builds_up_over", None)
    slow = float(getattr(scene.friction, name)) if name is not None else 0.0
    load = normal[:, 1:] * np.diff(np.asarray(walk.t))
    return float(np.sum(load * (slip[:, 1:] > slow)) / max(float(np.sum(load)), 1e-300))


def passed_before(curve: Curve, passed: Sequence[BranchPoint], there: CurvePoint) -> float | None:
    """Whether a point lies on the curve through points that are passed, in their order.

    Returns:
        The cosine between the tangents there; None where it is another gait than all of them.
    """
    if len(passed) < 2:
        return None
    places, tangents = (
        np.stack([getattr(p, name) for p in passed]) for name in ("place", "tangent")
    )
    chords = np.diff(places, axis=0)
    lengths = np.linalg.norm(chords, axis=1)
    off = there.place - places[:-1]
    with np.errstate(invalid="ignore", divide="ignore"):
        shares = np.sum(off * chords, axis=1) / lengths**2
    aside = np.linalg.norm(off - shares[:, None] * chords, axis=1)
    near = (shares >= 0.0) & (shares <= 1.0) & (aside < _CHORD_ASIDE * lengths)
    for k in np.flatnonzero(near).tolist():
        # In the plane through the point normal to the chord, which is crossed once, also at a fold.
        t, along = shares[k], chords[k] / lengths[k]
        bend = lengths[k] * ((1.0 - t) * tangents[k] - t * tangents[k + 1])
        guess = places[k] + t * chords[k] + t * (1.0 - t) * (bend - (bend @ along) * along)
        known = correct(curve, guess, along).found
        if known is None:
            continue
        apart = np.linalg.norm(known.place - there.place)
        if apart < max(_SAME, _CORRECTIONS * curve.converged):
            return float(known.tangent @ there.tangent)
    return None


class BranchStop(NamedTuple):
    """Where and why a branch was followed no further.

    Attributes:
        end: how it ended.
        cause: in words: the `Ending` of the walk beyond, or what else comes there.
        value: of the parameter there, SI units; NaN where there is no point.
    """

    end: BranchEnd
    cause: str
    value: float


class Trace(NamedTuple):
    """A part of a branch that is followed in one direction.

    Attributes:
        points: in order, located bifurcations among them.
        bifurcations: those that were located, and a limit where one ends it.
        stop: how it ended.
    """

    points: list[BranchPoint]
    bifurcations: list[BifurcationPoint]
    stop: BranchStop

    def reversed(self) -> "Trace":
        """The same part in the other order."""
        points = [point._replace(tangent=-point.tangent) for point in reversed(self.points)]
        return Trace(points, self.bifurcations[::-1], self.stop)


def trace(
    curve: Curve,
    axis: Axis,
    begin: CurvePoint,
    *,
    largest_step: float,
    max_points: int,
    until: Collection[BranchEvent] = (),
    passed: Sequence[BranchPoint] = (),
    tell: Callable[[BranchPoint], object] = lambda point: None,
    interruptible: bool = False,
) -> Trace:
    """Follows a curve of gaits onwards along a point's tangent; that point is the first.

    Args:
        curve, axis: the gaits.
        begin: where to begin.
        largest_step: arclength of a step at most.
        max_points: points at most.
        until: kinds of bifurcations at the first of which to stop.
        passed: points of the same branch before the first, in their order.
        tell: is called with each point.
        interruptible: whether an interrupt ends the trace with its points so far; else it passes.
    """
    points = [branch_point(curve, axis, begin)]
    events: list[BifurcationPoint] = []
    here = begin

    def stopped(end: BranchEnd, cause: str) -> Trace:
        last = points[-1]
        if end in LIMITS:
            largest = complex(last.multipliers[0])
            error = float(last.multiplier_errors[0])
            events.append(BifurcationPoint(BranchEvent.LIMIT, last, largest, error))
        return Trace(points, events, BranchStop(end, cause, last.value))

    if leaves_range(begin):
        return stopped(BranchEnd.REACHED, BOUND)
    control = StepControl(_FIRST * largest_step, largest_step, _SMALLEST, _LEAST_COSINE, _ASIDE)

    def is_likely(here: CurvePoint, there: CurvePoint) -> bool:
        found = bifurcations_between(curve, axis, here, there)
        return explains(here, there, [event.kind for _, event in found])

    gaits = follow(curve, here, control, low=0.0, high=1.0, is_likely=is_likely)
    try:
        for attempt in islice(gaits, max_points):
            if attempt.found is None:
                return stopped(*reason_of(attempt.code))
            there = attempt.found
            closing = _closing(curve, begin, passed, points, there)
            if closing is not None:  # beyond its beginning everything is known
                there = closing
            elif (cosine := passed_before(curve, [*passed, *points], there)) is not None:
                if cosine > 0.0:
                    return stopped(BranchEnd.CLOSED, "the branch is closed")
                return stopped(
                    BranchEnd.JUMPED, "a step jumped to gaits that the branch had passed"
                )
            located = bifurcations_between(curve, axis, here, there)
            for place, event in located:
                points.append(branch_point(curve, axis, place))
                events.append(event)
                if event.kind in until:
                    return stopped(BranchEnd.UNFINISHED, f"stopped at the {event.kind}")
            points.append(branch_point(curve, axis, there))
            if not explains(here, there, [event.kind for _, event in located]):
                events.append(not_located(points[-1], axis.value(float(here.place[-1]))))
                if BranchEvent.NOT_LOCATED in until:
                    return stopped(BranchEnd.UNFINISHED, f"stopped at the {events[-1].kind}")
            tell(points[-1])
            if abs(points[-1].multipliers[0]) > _DIVERGED:
                return stopped(BranchEnd.BREAKS_OFF, NOT_SMOOTH)
            if is_bound(there):
                return stopped(BranchEnd.REACHED, BOUND)
            if closing is not None:
                return stopped(BranchEnd.CLOSED, "the branch is closed")
            here = there
    except KeyboardInterrupt:
        if not interruptible:
            raise
        return stopped(BranchEnd.INTERRUPTED, "interrupted by Ctrl-C")
    return stopped(BranchEnd.UNFINISHED, f"{max_points} points were followed")


def reason_of(code: int) -> tuple[BranchEnd, str]:
    """Why a curve could not be followed on, from the code of the last attempt."""
    if code == NO_WALK:
        return BranchEnd.NO_WALK, "no walk: a foot deep underground, a step uphill, or hardly any"
    if code:
        return BranchEnd.WALK_ENDS, OF_ENDINGS.get(Ending(code), str(Ending(code)))
    return BranchEnd.BREAKS_OFF, NOT_SMOOTH


def is_bound(point: CurvePoint) -> bool:
    return bool(min(abs(point.place[-1]), abs(point.place[-1] - 1.0)) < _AT_BOUND)


def leaves_range(point: CurvePoint) -> bool:
    """Whether a point lies on the end of the range and the branch leads out of it."""
    return is_bound(point) and bool((point.place[-1] > 0.5) == (point.tangent[-1] > 0.0))


def _closing(
    curve: Curve,
    begin: CurvePoint,
    passed: Sequence[BranchPoint],
    points: Sequence[BranchPoint],
    there: CurvePoint,
) -> CurvePoint | None:
    """The first gait of a branch if the step from the last of its points passes it, else None."""
    if len(passed) + len(points) <= 3:
        return None
    first = passed[0] if passed else begin
    if not _closes(first, points[-1], there):
        return None
    return correct(curve, first.place, first.tangent).found if passed else begin


def _closes(
    first: CurvePoint | BranchPoint, here: CurvePoint | BranchPoint, there: CurvePoint
) -> bool:
    """Whether a branch passes its first gait between two points."""
    step, back = there.place - here.place, first.place - here.place
    share = float(back @ step / (step @ step))
    aside = np.linalg.norm(back - share * step)
    near = 0.0 < share <= 1.0 and aside < 0.1 * np.linalg.norm(step)
    return bool(near and first.tangent @ there.tangent > _SAME_WAY)
