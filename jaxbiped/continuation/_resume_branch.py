"""Resumption of a branch from any of its points, in either direction."""

from collections.abc import Sequence

import numpy as np

from jaxbiped._checks import (
    ArgumentError,
    check_choice,
    check_count,
    check_positive,
    check_within,
)
from jaxbiped.continuation._axis import Axis, axis_of
from jaxbiped.continuation._bifurcations import BifurcationPoint, BranchEvent
from jaxbiped.continuation._branch import Branch
from jaxbiped.continuation._branch_point import BranchPoint
from jaxbiped.continuation._continuation_setup import continuation_setup
from jaxbiped.continuation._trace import LIMITS, Trace, trace
from jaxbiped.gait._pseudo_arclength import correct

_WAYS = ("forward", "backward")


def resume_branch(
    branch: Branch,
    at: int = -1,
    *,
    direction: str = "forward",
    bounds: tuple[float, float] | None = None,
    largest_step: float = 0.02,
    max_points: int = 200,
) -> Branch:
    """Follows a branch on from one of its points; what it had beyond is replaced.

    Args:
        branch: from `continue_gait` or `open_branch`.
        at: number of the point, the last unless given.
        direction: "forward" or "backward" in the order of its points.
        bounds: another range (from, to), SI units; its own unless given.
        largest_step: largest arclength of a step (see `continue_gait`).
        max_points: points followed at most.

    Returns:
        The branch up to the point, and the gaits beyond it.

    Raises:
        ArgumentError: an argument that is not allowed, or a gait that does not return.
    """
    check_choice("direction", direction, _WAYS)
    check_positive("largest_step", largest_step)
    check_count("max_points", max_points)
    if not -len(branch) <= at < len(branch):
        raise ArgumentError(f"at = {at} is not allowed: the branch has {len(branch)} points.")
    at, old = at % len(branch), branch.axis
    limits = (old.first, old.last) if bounds is None else bounds
    axis = axis_of(branch.scene, old.name, limits, old.log)
    check_within(f"{old.name} at {at}", branch.points[at].value, axis.first, axis.last)
    setup = continuation_setup(
        branch.scene,
        axis,
        footsteps=branch.footsteps,
        accuracy=branch.accuracy,
        engine=branch.engine,
    )
    forward = direction == "forward"
    kept = branch.points[: at + 1] if forward else branch.points[at:]
    points = [_rescaled(point, old, axis) for point in kept]
    last = points[-1 if forward else 0]
    along = last.tangent if forward else -last.tangent
    begin = correct(setup.curve, last.place, along, along)
    if begin.found is None:
        raise ArgumentError(f"at = {at} is not allowed: from there the walk does not return.")
    events = _events_at(branch, kept, forward=forward)
    known = Trace(points, events, branch.stops[0 if forward else 1])
    beyond = trace(
        setup.curve,
        axis,
        begin.found,
        largest_step=largest_step,
        max_points=max_points,
        passed=(known if forward else known.reversed()).points[:-1],
    )
    return setup.branch(known, beyond) if forward else setup.branch(beyond.reversed(), known)


def _rescaled(point: BranchPoint, old: Axis, new: Axis) -> BranchPoint:
    """The point in the sizes of another range of the same parameter."""
    place, tangent = point.place.copy(), point.tangent.copy()
    place[-1] = new.place(point.value)
    tangent[-1] *= old.slope(point.place[-1]) / new.slope(place[-1])
    return point._replace(place=place, tangent=tangent / np.linalg.norm(tangent))


def _events_at(
    branch: Branch, kept: Sequence[BranchPoint], *, forward: bool
) -> list[BifurcationPoint]:
    """Special points among those that are kept; a limit at the end that goes on is none."""
    events = list(branch.bifurcations)
    end = -1 if forward else 0
    if events and events[end].kind is BranchEvent.LIMIT and branch.stops[end].end in LIMITS:
        events.pop(end)
    places = [point.place for point in kept]
    return [each for each in events if any(np.array_equal(each.point.place, p) for p in places)]
