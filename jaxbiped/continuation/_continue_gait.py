"""Continuation of a gait in a parameter of its scene, from the gait or on from a branch's point."""

from collections.abc import Sequence
from typing import Any

import jax.tree_util as jtu
import numpy as np

from jaxbiped._checks import ArgumentError, check_choice, check_count, check_positive, check_within
from jaxbiped._progress import stage
from jaxbiped._types import as_float
from jaxbiped.continuation._bifurcations import BifurcationPoint, BranchEvent
from jaxbiped.continuation._branch import Branch
from jaxbiped.continuation._branch_point import Axis, BranchPoint, axis_of, start_of
from jaxbiped.continuation._continuation_setup import (
    ContinuationSetup,
    check_followed,
    continuation_setup,
    setup_of,
)
from jaxbiped.continuation._trace import LIMITS, BranchStop, Trace
from jaxbiped.gait._find_gait import find_gait
from jaxbiped.gait._fixed_point_search import Search
from jaxbiped.gait._gait import Gait
from jaxbiped.gait._pseudo_arclength import CurvePoint, correct
from jaxbiped.gait._search_provenance import BranchEnd, explain_search
from jaxbiped.gait._search_starts import default_guess, state_of_guess
from jaxbiped.scene._parameter_access import with_parameters
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.scene._state_types import WalkerState
from jaxbiped.solve._accuracy import GAIT_ACCURACIES


def continue_gait(
    scene: Scene | RigidScene,
    along: str = "slope",
    *,
    bounds: tuple[float, float],
    guess: Gait | WalkerState | None = None,
    footsteps: int | None = None,
    log: bool | None = None,
    largest_step: float = 0.02,
    max_points: int = 200,
    accuracy: str = "balanced",
    engine: str = "auto",
    progress: bool | None = None,
) -> Branch:
    """Follows a periodic gait along a parameter, in both directions and around folds.

    Pseudo-arclength continuation begins at the gait at the scene's own value of the parameter, or
    at the nearest value within the bounds. If a multiplier crosses the unit circle between two
    points, the bifurcation is located by root finding and becomes a point of the branch.

    Args:
        scene: the walker, compliant (with bristles or without) or rigid.
        along: the parameter's name (see `parameter_names`).
        bounds: the range (from, to), SI units, at whose ends the branch stops.
        guess: a gait or a start near the gait to follow. Default: the gait that `find_gait` finds.
        footsteps: number of footsteps of a cycle. Default: one for a mirrored walker, those of a
            stride for unequal legs.
        log: whether equal steps are equal factors (if omitted: on if a positive range spans two
            decades).
        largest_step: maximum arclength of a step. In the arclength, the parameter is scaled by the
            width of its range, angles by 1 rad, lengths by l, velocities by √(g l) and rates by
            √(g/l).
        max_points: maximum number of points in each direction.
        accuracy: "balanced" or "tight".
        engine: "xla", "lanes" or "auto" (see `ENGINES`).
        progress: whether to show on stderr what is being done, how far it is and what was found; by
            default (None) after two seconds, in a terminal, a notebook or a command.

    Returns:
        The branch. If no gait was found, it has no points, and its `stops` give the reason. An
        interrupt (Ctrl-C) ends it as "interrupted", with the points so far. The branch contains no
        gait twice: if it returns to an earlier gait, it ends as "closed", or as "jumped" if a step
        led back to it. Between two points with different numbers of multipliers outside the unit
        circle there is always an entry, "not-located" if the bifurcation was not found.

    Raises:
        ArgumentError: an argument is not allowed; raised before anything is compiled.

    Examples:
        >>> import jaxbiped as jb
        >>> branch = jb.continue_gait(jb.ladder()["rigid"], "slope", bounds=(0.01, 0.11))
        >>> [f"{each.kind} at {each.value:.4f}" for each in branch.bifurcations]
        ['period-doubling at 0.1004']
    """
    check_followed(scene)
    axis = axis_of(scene, along, bounds, log)
    check_positive("largest_step", largest_step)
    check_count("max_points", max_points)
    check_choice("accuracy", accuracy, GAIT_ACCURACIES)
    start = start_of(scene, axis)
    near = state_of_guess(scene, guess)
    setup = continuation_setup(scene, axis, footsteps=footsteps, accuracy=accuracy, engine=engine)
    with stage(f"following the gait along {along}", unit="gaits", show=progress) as now:
        begin = first_gait(setup, start, near, engine)
        if isinstance(begin, str):
            none = BranchStop(BranchEnd.NO_BEGINNING, begin, float("nan"))
            return setup.branch(Trace([], [], none), Trace([], [], none))

        def tell(point: BranchPoint) -> None:
            radius = abs(point.multipliers[0])
            now.update(found=f"radius {radius:.4g} at {along} = {point.value:.6g}")

        before, after = traces_from(
            setup,
            begin,
            largest_step=float(largest_step),
            max_points=int(max_points),
            tell=tell,
            interruptible=True,
        )
    before, after = map(setup.with_cause, (before, after))
    return setup.branch(before.reversed(), after)


def traces_from(setup: ContinuationSetup, begin: CurvePoint, **options: Any) -> tuple[Trace, Trace]:
    """What lies to both sides of a gait, each part in its order away from there.

    First that towards smaller values of the parameter; `options` are those of `trace`.
    """
    before = setup.trace(begin._replace(tangent=-begin.tangent), **options)
    known = before.reversed()
    if before.stop.end in (BranchEnd.CLOSED, BranchEnd.INTERRUPTED):
        # The other end is the first gait: a closed branch ends where it began.
        stop = before.stop._replace(value=known.points[-1].value)
        return before, Trace(known.points[-1:], [], stop)
    return before, setup.trace(begin, passed=known.points[:-1], **options)


def first_gait(
    setup: ContinuationSetup, value: float, guess: WalkerState | None, engine: str
) -> CurvePoint | str:
    """The gait at a value of the parameter near a guess, or the one that a search finds.

    A sentence where there is none. Newton's method from the guess is tried first, with the
    continuation's own evaluation: a search compiles programs of its own.
    """
    scene = with_parameters(setup.scene, {setup.axis.name: value})
    start = default_guess(scene) if guess is None else guess
    with stage("compiling the continuation (first time for this kind of scene)"):
        seen = setup.cycle(setup.recurring(start), value, 1)
    if int(seen.code[0]) == 0:
        near = setup.recurring(start) if guess is not None else np.asarray(seen.recurring[0])
        found = setup.at_value(near, value).found
        if found is not None and (guess is not None or setup.point(found).stable):
            return found
    gait = find_gait(
        jtu.tree_map(as_float, scene),
        guess,
        footsteps=setup.footsteps,
        parameters=(),
        accuracy=setup.accuracy,
        engine=engine,
    )
    if gait.outcome is Search.FOUND:
        found = setup.at_value(setup.recurring(gait.measures.state), value).found
        if found is not None:
            return found
        return (
            f"no gait to begin from: what the search finds at {setup.axis.name} = {value:.6g} is "
            "lost when it is corrected"
        )
    return explain_search(scene, gait)


def resume_branch(
    branch: Branch,
    at: int = -1,
    *,
    direction: str = "forward",
    bounds: tuple[float, float] | None = None,
    largest_step: float = 0.02,
    max_points: int = 200,
) -> Branch:
    """Continues a branch from one of its points; later points are replaced.

    Args:
        branch: from `continue_gait` or `open_branch`.
        at: number of the point. Default: the last.
        direction: "forward" or "backward" in the order of its points.
        bounds: another range (from, to), SI units. Default: the branch's own range.
        largest_step: largest arclength of a step (see `continue_gait`).
        max_points: points followed at most.

    Returns:
        The branch up to the point, and the gaits beyond it.

    Raises:
        ArgumentError: an argument is not allowed, or the gait at the point does not return.
    """
    check_choice("direction", direction, ("forward", "backward"))
    check_positive("largest_step", largest_step)
    check_count("max_points", max_points)
    if not -len(branch) <= at < len(branch):
        raise ArgumentError(f"at = {at} is not allowed: the branch has {len(branch)} points.")
    at, old = at % len(branch), branch.axis
    limits = (old.first, old.last) if bounds is None else bounds
    axis = axis_of(branch.scene, old.name, limits, old.log)
    check_within(f"{old.name} at {at}", branch.points[at].value, axis.first, axis.last)
    setup = setup_of(branch, axis=axis)
    forward = direction == "forward"
    kept = branch.points[: at + 1] if forward else branch.points[at:]
    points = [_point_on_axis(point, old, axis) for point in kept]
    last = points[-1 if forward else 0]
    along = last.tangent if forward else -last.tangent
    begin = correct(setup.curve, last.place, along)
    if begin.found is None:
        raise ArgumentError(f"at = {at} is not allowed: from there the walk does not return.")
    events = _events_at(branch, kept, forward=forward)
    known = Trace(points, events, branch.stops[0 if forward else 1])
    passed = (known if forward else known.reversed()).points[:-1]
    beyond = setup.trace(
        begin.found,
        largest_step=largest_step,
        max_points=max_points,
        passed=passed,
        interruptible=True,
    )
    return setup.branch(known, beyond) if forward else setup.branch(beyond.reversed(), known)


def _point_on_axis(point: BranchPoint, old: Axis, new: Axis) -> BranchPoint:
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
