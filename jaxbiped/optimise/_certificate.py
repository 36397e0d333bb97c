"""Certificate of an optimum: what speaks for it besides the optimiser's word."""

import functools
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np

from jaxbiped._checks import check_choice, check_not_negative, check_positive, check_type
from jaxbiped._progress import Stage, stage
from jaxbiped._types import as_float
from jaxbiped.basins._label_statistics import Fraction, wilson_interval
from jaxbiped.basins._labels import Label
from jaxbiped.basins._minimal_fatal_shock import FatalShock
from jaxbiped.continuation._critical_values import (
    NearestBifurcation,
    nearest_bifurcation,
    range_of,
)
from jaxbiped.dynamics._state import recurring_leaves, unit_of
from jaxbiped.dynamics._surfaces import rate_unit
from jaxbiped.gait._find_gait import find_gait
from jaxbiped.gait._fixed_point_search import Search
from jaxbiped.gait._gait import Gait
from jaxbiped.hybrid._admissible_directions import independent_names
from jaxbiped.hybrid._sections import HeelStrike
from jaxbiped.optimise._jacobian_functionals import jacobian_functionals
from jaxbiped.optimise._optimality import Optimality
from jaxbiped.optimise._optimum import Optimum
from jaxbiped.scene._parameter_access import parameter_names
from jaxbiped.scene._scene import WalkerScene
from jaxbiped.scene._state_types import WalkerState
from jaxbiped.simulate._simulate import simulate
from jaxbiped.simulate._trajectory import Trajectory
from jaxbiped.solve._engine_names import ENGINES
from jaxbiped.sweep._labelling import Labelling
from jaxbiped.sweep._labelling_preparation import labelling
from jaxbiped.sweep._nearest_failure import nearest_failure
from jaxbiped.sweep.starts._starts import sample

_SETTLED = 1e-4
"""Relative difference between a walk's last footstep and the gait's that counts as none."""
_FATAL = 1e-4
"""Scaled distance to which the smallest fatal push is bisected."""
_Found = TypeVar("_Found")


class PushedWalk(NamedTuple):
    """A walk from a pushed start.

    Attributes:
        push: relative change of all velocities of the gait's state.
        footsteps: how many were walked; `asked` for how many.
        period_difference: relative difference of the last cycle's duration from the gait's.
        returned: whether it walked to the end, and to the gait.
    """

    push: float
    footsteps: int
    asked: int
    period_difference: float
    returned: bool


class OtherEngine(NamedTuple):
    """The same gait by the other engine: relative differences, and that of the radii."""

    engine: str
    found: bool
    period_difference: float
    length_difference: float
    radius_difference: float


class Certificate(NamedTuple):
    """Results of the tests of an optimum; None for parts that were not requested.

    Attributes:
        optimality: Karush–Kuhn–Tucker conditions: residual, multipliers and their errors.
        multipliers: Floquet multipliers, largest first, complex.
        multiplier_errors: estimated errors of the Floquet multipliers.
        unit_multiplier_error: distance from 1 of the multiplier that must be 1.
        stable: whether all multipliers lie inside the unit circle; None if an error bar crosses it.
        sensitivity_norm: gait sensitivity norm (see `OBJECTIVES`) with its error; infinite if the
            gait is not stable.
        basin: fraction of the starts within `scatter` of the gait that return to it.
        fatal_push: the smallest fatal push that was found, in the scales of `nearest_failure`; a
            smaller one may exist.
        walk: a walk from a pushed start.
        other_engine: the gait computed with the other engine.
        nearest_bifurcations: the first bifurcation or limit along each requested parameter.
        failed: reasons why requested parts are not known, by name.
    """

    optimality: Optimality
    multipliers: np.ndarray
    multiplier_errors: np.ndarray
    unit_multiplier_error: float
    stable: bool | None
    sensitivity_norm: tuple[float, float]
    basin: Fraction | None
    fatal_push: FatalShock | None
    walk: PushedWalk | None
    other_engine: OtherEngine | None
    nearest_bifurcations: tuple[NearestBifurcation, ...]
    failed: dict[str, str]


def certify(
    optimum: Optimum,
    *,
    starts: int = 1024,
    scatter: float = 0.05,
    footsteps: int = 200,
    push: float = 0.01,
    fatal_push: bool = False,
    other_engine: bool = False,
    bifurcations_along: Sequence[str] = ("slope",),
    seed: int = 0,
    progress: bool | None = None,
) -> Certificate:
    """Tests an optimum with information that its search did not use.

    Args:
        optimum: an optimum from `optimise_gait`, whose gait has the shortest cycle.
        starts: number of starts around the gait that are labelled for its basin; 0 for none.
        scatter: half-width of the scatter of all bodies' angles [rad], and of their rates in units
            of √(g/l), where l is the walker's height.
        footsteps: number of footsteps of the walk from a pushed start; 0 for none.
        push: relative change of all velocities of that start.
        fatal_push: whether to search for the smallest fatal push, which labels some thousands of
            starts.
        other_engine: whether to find the gait with the other engine too, which compiles for
            minutes if that engine is XLA.
        bifurcations_along: parameters in each of which the gait is followed to its nearest
            bifurcation, from an eighth to eight times the value, as far as the walker allows (from
            level ground by 0.1 rad to both sides); each compiles a program.
        seed: random seed of the starts.
        progress: whether to show on stderr the current part; by default (None) after two
            seconds, in a terminal, a notebook or a command.

    Returns:
        The certificate. A part that fails or is interrupted (Ctrl-C) is named in `failed`; the
        other parts are kept.

    Raises:
        ArgumentError: an argument is not allowed; raised before anything is tested.
    """
    check_type("optimum", optimum, Optimum)
    check_not_negative("starts", starts)
    check_not_negative("footsteps", footsteps)
    check_positive("scatter", scatter)
    scene, gait = optimum.scene, optimum.gait
    own = scene.mechanism.structure.cycle_footsteps
    check_choice("footsteps of the gait", gait.step_lengths.shape[0], (own,))
    for name in bifurcations_along:
        check_choice("bifurcations_along", name, parameter_names(scene))
        range_of(scene, name)  # refused where it has none
    sizes, errors = np.abs(np.asarray(gait.multipliers)), np.asarray(gait.multiplier_errors)
    undecided = bool(np.any(np.abs(sizes - 1.0) <= errors))
    labels = bool(starts or fatal_push)
    wanted = (True, labels, starts, fatal_push, footsteps, other_engine, *bifurcations_along)
    total = sum(map(bool, wanted))
    with stage("certifying the optimum", total=total, unit="parts", show=progress) as now:
        parts = _Parts(now)
        norm = parts.find(
            "gait sensitivity norm",
            lambda: jacobian_functionals(
                scene, gait.measures.state, ("sensitivity_norm",), engine=gait.engine
            ),
        )
        knows = basin = push_found = walk = other = None
        if labels:
            knows = parts.find("gaits that starts may come to", lambda: _labelling(scene, gait))
        if knows is not None and starts:
            basin = parts.find(
                f"basin of {starts} starts", lambda: _basin(knows, gait, int(starts), scatter, seed)
            )
        if knows is not None and fatal_push:
            # The simulator's derivatives would compile for as long as all the rest.
            how: dict[str, Any] = dict(gradients=False, tolerance=_FATAL)
            push_found = parts.find("smallest fatal push", lambda: nearest_failure(knows, **how))
        if footsteps:
            walk = parts.find(
                f"walk of {footsteps} footsteps", lambda: _walk(scene, gait, int(footsteps), push)
            )
        if other_engine:
            other = parts.find("gait by the other engine", lambda: _by_other(scene, gait))
        nearest = [
            parts.find(
                f"nearest bifurcation along {name}",
                functools.partial(nearest_bifurcation, scene, gait, name),
            )
            for name in bifurcations_along
        ]
    return Certificate(
        optimality=optimum.optimality,
        multipliers=np.asarray(gait.multipliers),
        multiplier_errors=errors,
        unit_multiplier_error=float(gait.unit_multiplier_error),
        stable=None if undecided else bool(np.all(sizes < 1.0)),
        sensitivity_norm=(math.nan, math.nan)
        if norm is None
        else (np.asarray(norm.values).item(), np.asarray(norm.errors).item()),
        basin=basin,
        fatal_push=push_found,
        walk=walk,
        other_engine=other,
        nearest_bifurcations=tuple(each for each in nearest if each is not None),
        failed=parts.failed,
    )


class _Parts:
    """Parts of a certificate, which are named while they last; each fails by itself."""

    def __init__(self, now: Stage) -> None:
        self.now, self.failed, self.interrupted = now, dict[str, str](), False

    def find(self, name: str, part: Callable[[], _Found]) -> _Found | None:
        """What is found, or None where that fails, or the user has had enough."""
        found = None
        try:
            if not self.interrupted:
                with stage(name):
                    found = part()
        except KeyboardInterrupt:
            self.interrupted = True
        except Exception as error:  # whatever it is, the optimum is not lost for it
            self.failed[name] = f"{type(error).__name__}: {error}"
        if self.interrupted:
            self.failed[name] = "interrupted"
        self.now.update()
        return found


def _labelling(scene: WalkerScene, gait: Gait) -> Labelling | None:
    """What labels starts by the gait; None where a search from its state does not find it."""
    knows = labelling(scene, guess=gait.measures.state)
    return knows if knows.family.rows[0] else None


def _basin(knows: Labelling, gait: Gait, count: int, scatter: float, seed: int) -> Fraction:
    """The fraction that comes back of starts about the gait: on the ground, and beyond no stop."""
    scene: Any = knows.scene
    free = independent_names(scene, gait.measures.state)
    halves = {"rad": scatter, "rad/s": scatter * float(rate_unit(scene))}
    bounds = {
        name: (float(centre) - halves[unit], float(centre) + halves[unit])
        for name, centre in gait.measures.state._asdict().items()
        if (unit := unit_of(name)) in halves and name in free
    }
    batch = sample(scene, bounds, count, seed=seed, place=True).at(knows, np.arange(count))
    labels, places = knows(batch.states).label, recurring_leaves(batch.states)
    possible, walking = np.isfinite(places).all(axis=0).sum(), np.sum(labels == int(Label.WALKING))
    low, high = wilson_interval(walking, possible)
    return Fraction(float(walking / max(possible, 1)), float(low), float(high), int(walking))


def _walk(scene: WalkerScene, gait: Gait, count: int, push: float) -> PushedWalk:
    walk: Trajectory[Any] = simulate(
        scene,
        _pushed(gait.measures.state, push),
        footsteps=count,
        save=HeelStrike(),
        max_arrivals=count,
        max_solver_steps=max(65536, 1024 * count),
    )
    assert walk.arrivals is not None
    footsteps = scene.mechanism.structure.cycle_footsteps, scene.arrival_footsteps
    period = float(gait.measures.period)
    return _judged(np.asarray(walk.arrivals.t), period, count, push, *footsteps)


def _pushed(state: WalkerState, push: float) -> WalkerState:
    """The state with all its speeds so much larger, relative to themselves."""
    fast = [name for name in state._fields if unit_of(name) in ("m/s", "rad/s")]
    faster = {name: as_float(float(getattr(state, name)) * (1.0 + push)) for name in fast}
    return state._replace(**faster)


def _judged(
    times: np.ndarray, period: float, count: int, push: float, own: int, each: int
) -> PushedWalk:
    """By the times of arrivals, `each` of so many footsteps, of which a cycle has `own`."""
    times, cycle = times[np.isfinite(times)], own // each
    last = float(times[-1] - times[-1 - cycle]) if len(times) > cycle else np.nan
    difference = abs(last / period - 1.0)
    done = each * len(times)
    return PushedWalk(push, done, count, difference, done >= count - own and difference < _SETTLED)


def _other_than(engine: str) -> str:
    return next(name for name in ENGINES if name not in ("auto", engine))


def _by_other(scene: WalkerScene, gait: Gait) -> OtherEngine:
    other = _other_than(gait.engine)
    again = find_gait(scene, gait.measures.state, parameters=(), engine=other)
    return _compared(again, gait, other)


def _compared(again: Gait, gait: Gait, other: str) -> OtherEngine:
    pairs = zip(again.measures[:2], gait.measures[:2], strict=True)
    period, length = (abs(float(a) / float(b) - 1.0) for a, b in pairs)
    radii = (float(each.measures.spectral_radius) for each in (again, gait))
    return OtherEngine(
        other, again.outcome is Search.FOUND, period, length, abs(next(radii) - next(radii))
    )
