"""Continuation of a gait in a parameter of its scene, from the gait or on from a branch's point."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import (
    ArgumentError,
    check_choice,
    check_count,
    check_positive,
    check_type,
    check_unbatched,
    check_within,
)
from jaxbiped._progress import stage
from jaxbiped._types import as_float
from jaxbiped.continuation._bifurcations import BifurcationPoint, BranchEvent
from jaxbiped.continuation._branch import Branch
from jaxbiped.continuation._branch_point import (
    Axis,
    BranchPoint,
    CycleFootsteps,
    axis_of,
    branch_point,
    change_of,
    start_of,
)
from jaxbiped.continuation._cycle import Cycle, follow_cycle
from jaxbiped.continuation._trace import LIMITS, BranchStop, Trace, limit_cause, trace
from jaxbiped.dynamics._state import zero_state
from jaxbiped.gait._branch_along import state_at
from jaxbiped.gait._find_gait import find_gait
from jaxbiped.gait._fixed_point_search import FixedPointProblem, Search
from jaxbiped.gait._gait import Gait
from jaxbiped.gait._poincare_map import recurring_components
from jaxbiped.gait._pseudo_arclength import Attempt, Change, Curve, CurvePoint, correct
from jaxbiped.gait._return_map_spec import arrivals_of, return_map_spec
from jaxbiped.gait._search_provenance import BranchEnd, explain_search
from jaxbiped.gait._search_starts import default_guess, state_of_guess
from jaxbiped.hybrid._hybrid_system import MINIMAL_SCENES
from jaxbiped.hybrid._scales import recurring_sizes
from jaxbiped.hybrid._sections import AbstractSection, section_of
from jaxbiped.scene._parameter_access import with_parameters
from jaxbiped.scene._scene import AbstractMinimalScene, AbstractScene
from jaxbiped.scene._scene_checks import check_scene
from jaxbiped.scene._state_types import WalkerState
from jaxbiped.solve._accuracy import ACCURACIES, GAIT_ACCURACIES, precision_of

_TOLD_BY_CONTACT = (BranchEnd.BREAKS_OFF, BranchEnd.WALK_ENDS)
_CONVERGED = 3.0
"""Size of the last correction of a point, in units of the state's tolerance."""
_BEYOND = 5e-3
"""How far in s behind its end the walk beyond a branch is looked at."""


class ContinuationSetup(NamedTuple):
    """Gaits of a scene along an axis.

    Attributes:
        scene: the walker.
        axis: the parameter.
        arrivals: of a cycle at its section: of a mirrored walker one a footstep.
        accuracy: by name.
        problem: how cycles are followed.
    """

    scene: AbstractMinimalScene
    axis: Axis
    arrivals: int
    accuracy: str
    problem: FixedPointProblem

    @property
    def footsteps(self) -> int:
        each: int = self.scene.arrival_footsteps
        return self.arrivals * each

    @property
    def curve(self) -> Curve:
        """The gaits as a curve of zeros; each change carries the `Cycle` that was evaluated."""

        def change(point: np.ndarray, s: float) -> Change:
            return change_of(self.cycle(point, self.axis.value(s)), point, self.axis.slope(s))

        sizes = np.append(recurring_sizes(self.scene, self.problem.guess), 1.0)
        return Curve(change, sizes, _CONVERGED * float(self.problem.precision.rtol))

    def cycle(self, recurring: np.ndarray, value: float, arrivals: int | None = None) -> Cycle:
        """The cycle from these components at a value of the parameter."""
        count = self.arrivals if arrivals is None else arrivals
        return self.cycle_with(recurring, (self.axis.leaf,), [value], count)

    def cycle_with(
        self, recurring: np.ndarray, active: tuple[int, ...], values: list[float], arrivals: int
    ) -> Cycle:
        """The cycle from these components, parameters at positions `active` so changed."""
        return follow_cycle(self.problem._replace(active=active), recurring, values, arrivals)

    def at_value(self, recurring: np.ndarray, value: float) -> Attempt:
        """The gait near these components at a value of the parameter."""
        curve = self.curve
        return correct(curve, np.append(recurring, self.axis.place(value)) / curve.sizes)

    def recurring(self, state: WalkerState) -> np.ndarray:
        return np.asarray(recurring_components(self.problem.spec.system, state))

    def state_of(self, recurring: np.ndarray) -> WalkerState:
        return state_at(type(self.problem.guess), recurring)

    def point(self, found: CurvePoint) -> BranchPoint:
        return branch_point(self.curve, self.axis, found)

    def with_footsteps(self, point: BranchPoint) -> BranchPoint:
        """The same point with its cycle's footsteps, if these are several."""
        if self.arrivals == 1 or point.footsteps is not None:
            return point
        scene = with_parameters(self.scene, {self.axis.name: point.value})
        begins, rows, system = point.recurring, [], self.problem.spec.system
        for _ in range(self.arrivals):
            ahead = system.foot_ahead(scene, self.state_of(begins))
            if ahead is None:
                return point
            once = self.cycle(begins, point.value, 1)
            rows.append((begins, once.period[0], once.advance[0], once.peak[0], float(ahead)))
            begins = np.asarray(once.recurring[0])
        states, periods, advances, peaks, places = map(np.array, zip(*rows, strict=True))
        lengths = advances + np.roll(places, -1) - places
        return point._replace(footsteps=CycleFootsteps(states, periods, lengths, peaks))

    def trace(self, begin: CurvePoint, **options: Any) -> Trace:
        """The gaits onwards from a point of the curve; options are those of `trace`."""
        return trace(self.curve, self.axis, begin, **options)

    def with_cause(self, part: Trace) -> Trace:
        """A part of a branch whose end is told by touch and slip, where these tell it."""
        last = part.points[-1]
        if part.stop.end not in _TOLD_BY_CONTACT:
            return part
        away = _BEYOND * float(np.sign(last.tangent[-1]))

        def scene_at(share: float) -> AbstractScene:
            value = self.axis.value(float(last.place[-1]) + share * away)
            return with_parameters(self.scene, {self.axis.name: value})

        cause = limit_cause(self.scene, scene_at, self.state_of(last.recurring), last.period)
        return part if cause is None else part._replace(stop=part.stop._replace(cause=cause))

    def branch(self, before: Trace, after: Trace) -> Branch:
        """The branch of two parts, of which the later begins where the earlier ends."""
        events = (*before.bifurcations, *after.bifurcations)
        return Branch(
            scene=self.scene,
            points=tuple(map(self.with_footsteps, (*before.points, *after.points[1:]))),
            bifurcations=tuple(e._replace(point=self.with_footsteps(e.point)) for e in events),
            stops=(before.stop, after.stop),
            axis=self.axis,
            state_type=type(self.problem.guess),
            footsteps=self.footsteps,
            accuracy=self.accuracy,
            engine=self.problem.spec.engine,
            section=self.problem.spec.section,
        )


def continuation_setup(
    scene: AbstractMinimalScene,
    axis: Axis,
    *,
    footsteps: int | None,
    accuracy: str,
    engine: str,
    section: AbstractSection | None = None,
) -> ContinuationSetup:
    """The setup for a scene.

    Raises:
        ArgumentError: an engine that cannot, or footsteps that are no whole cycles.
    """
    scene = check_scene(scene, *MINIMAL_SCENES)
    arrivals = arrivals_of(scene, footsteps)
    like = zero_state(scene)
    # A branch may come to gaits that are costlier than those of a search.
    most = max(each.max_solver_steps for each in ACCURACIES.values())
    spec = return_map_spec(
        scene, like, section=section, solver=None, engine=engine, max_solver_steps=most
    )
    problem = FixedPointProblem(spec, scene, (), like, precision_of(accuracy, scene))
    return ContinuationSetup(scene, axis, arrivals, accuracy, problem)


def setup_of(branch: Branch, **others: Any) -> ContinuationSetup:
    """The setup by which a branch was followed, with other settings where these are given."""
    names = ("axis", "footsteps", "accuracy", "engine", "section")
    own = {name: getattr(branch, name) for name in names}
    return continuation_setup(branch.scene, **own | others)


def check_followed(scene: object) -> None:
    """Raises `ArgumentError` for what is no scene, or one in redundant coordinates."""
    if getattr(scene, "minimal", scene) is not scene:
        raise ArgumentError(
            "scene is not allowed in redundant coordinates: its gaits are those of scene.minimal, "
            "which can be followed."
        )
    check_scene(scene, *MINIMAL_SCENES)
    check_unbatched("scene", scene)


def continue_gait(
    scene: AbstractMinimalScene,
    along: str = "slope",
    *,
    bounds: tuple[float, float],
    guess: Gait | WalkerState | PyTree | None = None,
    footsteps: int | None = None,
    section: AbstractSection | None = None,
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
        scene: the walker, compliant (with bristles or without) or rigid, or a hybrid system.
        along: the parameter's name (see `parameter_names`).
        bounds: the range (from, to), SI units, at whose ends the branch stops.
        guess: a gait or a start near the gait to follow. Default: the gait that `find_gait` finds;
            a hybrid system needs one.
        footsteps: number of footsteps of a cycle, or of a hybrid system's arrivals. Default: one
            for a mirrored walker or a system, those of a stride for unequal legs.
        section: section on which cycles begin. Default: as of `find_gait`.
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
    check_positive("largest_step", largest_step, one=True)
    check_count("max_points", max_points)
    check_choice("accuracy", accuracy, GAIT_ACCURACIES)
    start = start_of(scene, axis)
    section = section_of(scene, section)
    near = state_of_guess(scene, guess)
    setup = continuation_setup(
        scene, axis, footsteps=footsteps, accuracy=accuracy, engine=engine, section=section
    )
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
        section=setup.problem.spec.section,
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
    check_type("branch", branch, Branch)
    check_choice("direction", direction, ("forward", "backward"))
    check_positive("largest_step", largest_step, one=True)
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
