"""Distance of a gait to its nearest fold or period doubling in a parameter, differentiable.

Its derivatives are those of the bifurcation's value, at a fold as `bifurcation_sensitivities` has
them; at a doubling the modulus that is 1 is held, whichever it is among the leading ones.
"""

import enum
import functools
from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax.tree_util as jtu
import numpy as np

from jaxbiped._checks import check_choice, check_type
from jaxbiped._types import as_float
from jaxbiped.continuation._bifurcations import BifurcationPoint, BranchEvent, advance, locate_near
from jaxbiped.continuation._branch_point import Axis, axis_of, start_of
from jaxbiped.continuation._continue_gait import ContinuationSetup, continuation_setup, traces_from
from jaxbiped.continuation._critical_values import STEPS, fold_forcing, range_of
from jaxbiped.continuation._trace import LIMITS, Trace
from jaxbiped.gait._fixed_point_search import looser
from jaxbiped.gait._gait import Gait
from jaxbiped.gait._pseudo_arclength import CurvePoint
from jaxbiped.gait._search_provenance import BranchEnd
from jaxbiped.optimise._cycle_functionals import Functional
from jaxbiped.optimise._jacobian_functionals import MODULI, jacobian_functionals
from jaxbiped.scene._parameter_access import parameter_names, parameter_values, with_parameters
from jaxbiped.scene._scene import WALKER_SCENES, WalkerScene
from jaxbiped.solve._accuracy import GAIT_ACCURACIES

KINDS = (BranchEvent.FOLD, BranchEvent.PERIOD_DOUBLING)
"""Bifurcations whose distance is told."""
_ENDS = (*LIMITS, BranchEnd.REACHED, BranchEnd.CLOSED)
"""Ends of a branch that was followed as far as it goes, or to the end of the range."""


class Sought(enum.StrEnum):
    """Outcome of following a gait's branch to a bifurcation.

    - met: the bifurcation lies in the range that is followed.
    - none in range: the branch was followed to the ends of the range, or ended before them.
    - unknown: the gait or the bifurcation was not found again, or the maximum number of points was
      reached.
    """

    MET = "met"
    NONE_IN_RANGE = "none in range"
    UNKNOWN = "unknown"


class BifurcationDistance(NamedTuple):
    """A gait's distance from a bifurcation along a parameter; the scene has p parameters.

    Attributes:
        along: name of the parameter.
        outcome: whether a bifurcation was met; values that are not known are NaN.
        value: value of the parameter at the bifurcation, SI units.
        distance: distance of that value from the gait's own, never negative; the smaller of both
            directions. If no bifurcation lies in the range, that of the farther end of the range,
            without derivatives.
        error: estimated error of value and distance.
        value_slopes: derivatives of `value` with respect to the parameters, shape (p,).
        slopes: derivatives of `distance`, shape (p,).
        slope_errors: estimated errors of both derivatives, shape (p,).
        bounds: the range to follow, (low, high), SI units.
    """

    along: str
    outcome: Sought
    value: float
    distance: float
    error: float
    value_slopes: np.ndarray
    slopes: np.ndarray
    slope_errors: np.ndarray
    bounds: tuple[float, float]


def bifurcation_distance(
    scene: WalkerScene,
    gait: Gait,
    kind: BranchEvent | str = BranchEvent.FOLD,
    along: str = "slope",
    *,
    accuracy: str = "balanced",
) -> BifurcationDistance:
    """Follows a gait both ways to its first fold or doubling, and differentiates its place.

    Args:
        scene: the scene of the gait.
        gait: gait at which to begin.
        kind: "fold" or "period-doubling".
        along: the parameter's name (see `parameter_names`). It is followed from an eighth to eight
            times its own value, as far as the walker allows; on level ground, by 0.1 rad of slope
            to both sides.
        accuracy: "balanced" or "tight".

    Returns:
        The distance from the nearer of both, with derivatives with respect to all parameters in the
        order of `parameter_names`. Errors are the changes due to solves at tolerances ten times
        looser. The `outcome` reports whether there is a bifurcation.

    Raises:
        ArgumentError: an argument is not allowed, or a parameter other than the slope is zero,
            which no factor changes; raised before anything is compiled.
    """
    check_type("scene", scene, *WALKER_SCENES)
    check_choice("kind", kind, KINDS)
    check_choice("along", along, parameter_names(scene))
    check_choice("accuracy", accuracy, GAIT_ACCURACIES)
    kind, axis = BranchEvent(kind), axis_of(scene, along, range_of(scene, along), None)
    steps = int(gait.step_lengths.shape[0])
    setup = continuation_setup(scene, axis, footsteps=steps, accuracy=accuracy, engine=gait.engine)
    located = _located_fold if kind is BranchEvent.FOLD else _located_doubling
    parts = _both_ways(setup, gait, kind)
    return _distance_along(axis, scene, kind, parts, functools.partial(located, setup))


def _distance_along(
    axis: Axis,
    scene: WalkerScene,
    kind: BranchEvent,
    parts: Sequence[Trace],
    locate: Callable[[BifurcationPoint], Functional | None],
) -> BifurcationDistance:
    """The distance to the nearest event of a kind on traces that begin at the scene."""
    along, names, bounds = axis.name, parameter_names(scene), (axis.first, axis.last)
    own = float(parameter_values(scene)[along])
    seen = [each for part in parts for each in part.bifurcations]
    event = min(
        (each for each in seen if each.kind is kind),
        key=lambda each: abs(each.value - own),
        default=None,
    )
    located = None if event is None else locate(event)
    if located is None:
        none, nowhere = np.nan, np.full(len(names), np.nan)
        outcome, distance = Sought.UNKNOWN, none
        known = all(each.kind is not BranchEvent.NOT_LOCATED for each in seen)
        if event is None and parts and known and all(part.stop.end in _ENDS for part in parts):
            outcome, distance = Sought.NONE_IN_RANGE, max(abs(end - own) for end in bounds)
        return BifurcationDistance(
            along, outcome, none, distance, none, nowhere, nowhere, nowhere, bounds
        )
    way = 1.0 if located.value > own else -1.0
    slopes = way * located.slopes
    slopes[names.index(along)] -= way
    return BifurcationDistance(
        along=along,
        outcome=Sought.MET,
        value=located.value,
        distance=abs(located.value - own),
        error=located.error,
        value_slopes=located.slopes,
        slopes=slopes,
        slope_errors=located.slope_errors,
        bounds=bounds,
    )


def _both_ways(setup: ContinuationSetup, gait: Gait, kind: BranchEvent) -> tuple[Trace, ...]:
    """The branch down and up to its first bifurcation of a kind; empty where the gait is lost."""
    own = start_of(setup.scene, setup.axis)
    begin = setup.at_value(setup.recurring(gait.measures.state), own).found
    if begin is None:
        return ()
    return traces_from(setup, begin, until=(kind,), **STEPS)


def _located_fold(setup: ContinuationSetup, event: BifurcationPoint) -> Functional | None:
    """By the return map itself, and by a looser one."""
    told = []
    problem = setup.problem
    for precision in (problem.precision, looser(problem.precision)):
        other = setup._replace(problem=problem._replace(precision=precision))
        fold = locate_near(other.curve, event.point.place, event.point.tangent, advance)
        slopes_there = None if fold is None else _fold_slopes(other, fold)
        if slopes_there is None:
            return None
        told.append(slopes_there)
    (value, slopes), (loose_value, loose_slopes) = told
    return Functional(value, abs(value - loose_value), slopes, np.abs(slopes - loose_slopes))


def _fold_slopes(setup: ContinuationSetup, fold: CurvePoint) -> tuple[float, np.ndarray] | None:
    """Value of the parameter at a fold, and its derivatives with respect to all, shape (p,)."""
    axis, point = setup.axis, fold.place[:-1] * setup.curve.sizes[:-1]
    value, names = axis.value(float(fold.place[-1])), parameter_names(setup.scene)
    forced = fold_forcing(setup, point, value, names)
    if forced is None:
        return None
    slopes = -forced[0] / forced[0][names.index(axis.name)]
    slopes[names.index(axis.name)] = 0.0
    return value, slopes


def _located_doubling(setup: ContinuationSetup, event: BifurcationPoint) -> Functional | None:
    """By the modulus that is 1 there."""
    along = setup.axis.name
    scene = jtu.tree_map(as_float, with_parameters(setup.scene, {along: event.value}))
    told = jacobian_functionals(
        scene,
        setup.state_of(event.point.recurring),
        MODULI,
        arrivals=setup.arrivals,
        accuracy=setup.accuracy,
        engine=setup.problem.spec.engine,
    )
    rows = [np.asarray(each) for each in told[:4]]
    return _moved_to_one(rows, event.value, parameter_names(scene).index(along))


def _moved_to_one(moduli: Sequence[np.ndarray], value: float, place: int) -> Functional:
    """Where the modulus nearest to 1 is 1, in the parameter at a place that has a value.

    `moduli` are values, errors, slopes and their errors.
    """
    values, errors, slopes, slope_errors = moduli
    which = int(np.nanargmin(np.abs(values - 1.0)))
    rate, rate_error = slopes[which][place], slope_errors[which][place]
    by_all = -slopes[which] / rate
    off = (slope_errors[which] + np.abs(by_all) * rate_error) / abs(rate)
    by_all[place] = off[place] = 0.0
    move = -(values[which] - 1.0) / rate
    error = (errors[which] + abs(move) * rate_error) / abs(rate)
    return Functional(float(value + move), float(error), by_all, off)
