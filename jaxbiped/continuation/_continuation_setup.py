"""Setup of a continuation: whose gaits are followed along which axis, and how exactly."""

from typing import Any, NamedTuple

import numpy as np

from jaxbiped._checks import ArgumentError, check_unbatched
from jaxbiped.continuation._branch import Branch
from jaxbiped.continuation._branch_point import (
    Axis,
    BranchPoint,
    CycleFootsteps,
    branch_point,
    change_of,
)
from jaxbiped.continuation._cycle import Cycle, CycleProblem
from jaxbiped.continuation._trace import Trace, limit_cause, trace
from jaxbiped.dynamics._surfaces import foot_ahead
from jaxbiped.gait._branch_along import state_at
from jaxbiped.gait._poincare_map import recurring_components
from jaxbiped.gait._pseudo_arclength import Attempt, Change, Curve, CurvePoint, correct
from jaxbiped.gait._return_map_spec import arrivals_of, return_map_spec
from jaxbiped.gait._search_provenance import BranchEnd
from jaxbiped.gait._search_starts import default_guess
from jaxbiped.scene._parameter_access import with_parameters
from jaxbiped.scene._scene import RedundantScene, RigidScene, Scene
from jaxbiped.scene._scene_checks import check_scene
from jaxbiped.scene._state_types import WalkerState
from jaxbiped.solve._accuracy import ACCURACIES, precision_of, recurring_sizes

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

    scene: Scene | RigidScene
    axis: Axis
    arrivals: int
    accuracy: str
    problem: CycleProblem

    @property
    def footsteps(self) -> int:
        each: int = self.scene.arrival_footsteps
        return self.arrivals * each

    @property
    def curve(self) -> Curve:
        """The gaits as a curve of zeros; each change carries the `Cycle` that was evaluated."""

        def change(point: np.ndarray, s: float) -> Change:
            return change_of(self.cycle(point, self.axis.value(s)), point, self.axis.slope(s))

        sizes = np.append(recurring_sizes(self.scene, self.problem.like), 1.0)
        return Curve(change, sizes, _CONVERGED * float(self.problem.precision.rtol))

    def cycle(self, recurring: np.ndarray, value: float, arrivals: int | None = None) -> Cycle:
        """The cycle from these components at a value of the parameter."""
        count = self.arrivals if arrivals is None else arrivals
        return self.problem.cycle(recurring, (self.axis.leaf,), [value], count)

    def at_value(self, recurring: np.ndarray, value: float) -> Attempt:
        """The gait near these components at a value of the parameter."""
        curve = self.curve
        return correct(curve, np.append(recurring, self.axis.place(value)) / curve.sizes)

    def recurring(self, state: WalkerState) -> np.ndarray:
        return np.asarray(recurring_components(self.problem.spec.system, state))

    def state_of(self, recurring: np.ndarray) -> WalkerState:
        return state_at(type(self.problem.like), recurring)

    def point(self, found: CurvePoint) -> BranchPoint:
        return branch_point(self.curve, self.axis, found)

    def with_footsteps(self, point: BranchPoint) -> BranchPoint:
        """The same point with its cycle's footsteps, if these are several."""
        if self.arrivals == 1 or point.footsteps is not None:
            return point
        scene = with_parameters(self.scene, {self.axis.name: point.value})
        begins, rows = point.recurring, []
        for _ in range(self.arrivals):
            once = self.cycle(begins, point.value, 1)
            ahead = float(foot_ahead(scene, self.state_of(begins)))
            rows.append((begins, once.period[0], once.advance[0], once.peak[0], ahead))
            begins = np.asarray(once.recurring[0])
        states, periods, advances, peaks, places = map(np.array, zip(*rows, strict=True))
        lengths = advances + np.roll(places, -1) - places
        return point._replace(footsteps=CycleFootsteps(states, periods, lengths, peaks))

    def trace(self, begin: CurvePoint, **options: Any) -> Trace:
        """The gaits onwards from a point of the curve; options are those of `trace`."""
        return trace(self.curve, self.axis, begin, **options)

    def with_cause(self, part: Trace) -> Trace:
        """A part of a branch whose end is told by touch and slip, where these tell it."""
        last, scene = part.points[-1], self.scene
        if not isinstance(scene, Scene) or part.stop.end not in _TOLD_BY_CONTACT:
            return part
        away = _BEYOND * float(np.sign(last.tangent[-1]))
        here, before, beyond = (
            with_parameters(scene, {self.axis.name: self.axis.value(float(last.place[-1]) + moved)})
            for moved in (0.0, -away, away)
        )
        state = self.state_of(last.recurring)
        cause = limit_cause(here, before, beyond, state, last.period)
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
            state_type=type(self.problem.like),
            footsteps=self.footsteps,
            accuracy=self.accuracy,
            engine=self.problem.spec.engine,
        )


def continuation_setup(
    scene: Scene | RigidScene, axis: Axis, *, footsteps: int | None, accuracy: str, engine: str
) -> ContinuationSetup:
    """The setup for a scene.

    Raises:
        ArgumentError: an engine that cannot, or footsteps that are no whole cycles.
    """
    scene = check_scene(scene, Scene, RigidScene)
    arrivals = arrivals_of(scene, footsteps)
    like = default_guess(scene)
    # A branch may come to gaits that are costlier than those of a search.
    most = max(each.max_solver_steps for each in ACCURACIES.values())
    spec = return_map_spec(scene, like, solver=None, engine=engine, max_solver_steps=most)
    problem = CycleProblem(spec, scene, like, precision_of(accuracy, scene))
    return ContinuationSetup(scene, axis, arrivals, accuracy, problem)


def setup_of(branch: Branch, **others: Any) -> ContinuationSetup:
    """The setup by which a branch was followed, with other settings where these are given."""
    own = {name: getattr(branch, name) for name in ("axis", "footsteps", "accuracy", "engine")}
    return continuation_setup(branch.scene, **own | others)


def check_followed(scene: object) -> None:
    """Raises `ArgumentError` for what is no scene, or one in redundant coordinates."""
    if isinstance(scene, RedundantScene):
        raise ArgumentError(
            "scene is not allowed in redundant coordinates: its gaits are those of scene.minimal, "
            "which can be followed."
        )
    check_scene(scene, Scene, RigidScene)
    check_unbatched("scene", scene)
