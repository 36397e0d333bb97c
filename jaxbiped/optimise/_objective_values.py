"""Values of objectives: those of one gait by name, their gradients and their error bars."""

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from jaxbiped.continuation._bifurcations import BranchEvent
from jaxbiped.dynamics._state_quantities import recurring_leaves
from jaxbiped.gait._gait import Gait
from jaxbiped.optimise._bifurcation_distance import Sought, bifurcation_distance
from jaxbiped.optimise._cycle_functionals import (
    Functional,
    Functionals,
    cycle_functionals,
    integral_names,
    weighted_sum,
)
from jaxbiped.optimise._jacobian_functionals import JACOBIAN_FUNCTIONALS, jacobian_functionals
from jaxbiped.optimise._jacobian_weights import CLEARANCE_NORMS, CLUSTER, SYMMETRIC
from jaxbiped.optimise._objectives import OBJECTIVES
from jaxbiped.scene._parameter_access import parameter_names, parameter_values
from jaxbiped.scene._scene import RigidScene, Scene

_OF_THE_GAIT = ("speed", "step_length", "period", "peak_normal")
_DISTANCES = {
    "fold_distance": BranchEvent.FOLD,
    "doubling_distance": BranchEvent.PERIOD_DOUBLING,
}
_WHOLE = ("sensitivity_norm", "floor_sensitivity", *CLEARANCE_NORMS)
"""What the whole sensitivity is made of: step length, step time and clearance, by both."""


class Evaluation(NamedTuple):
    """Objectives of one gait with respect to the p parameters of its scene.

    Attributes:
        values: by name.
        errors: their estimated errors.
        slopes: derivatives by name, shape (p,).
        slope_errors: their estimated errors.
        state: of the gait, its recurring components, shape (m,).
        state_slopes: derivatives, shape (m, p).
        beyond_range: distances whose bifurcation does not lie in the range that is followed: their
            values stand for more than the range holds, and their derivatives are zeros.
    """

    values: dict[str, float]
    errors: dict[str, float]
    slopes: dict[str, np.ndarray]
    slope_errors: dict[str, np.ndarray]
    state: np.ndarray
    state_slopes: np.ndarray
    beyond_range: tuple[str, ...] = ()

    def functional(self, name: str) -> Functional:
        """All that is known of one objective."""
        return Functional(
            self.values[name], self.errors[name], self.slopes[name], self.slope_errors[name]
        )


BothFunctionals: TypeAlias = tuple[Functionals | None, Functionals | None]
"""Those of a gait's Jacobian and those of its cycle, None where no measure needs them."""


def functionals_of(
    scene: Scene | RigidScene, gait: Gait, wanted: tuple[str, ...], footsteps: int, accuracy: str
) -> BothFunctionals:
    """What measures need beside the gait itself."""
    of_jacobian, of_cycle = _names_for(wanted)
    how: dict[str, Any] = dict(footsteps=footsteps, accuracy=accuracy, engine=gait.engine)
    state, first, second = gait.measures.state, None, None
    if of_jacobian:
        first = jacobian_functionals(scene, state, of_jacobian, **how)
    if of_cycle:
        second = cycle_functionals(scene, state, **how)
    return first, second


def _names_for(wanted: tuple[str, ...]) -> tuple[tuple[str, ...], bool]:
    """Which functionals of the Jacobian these measures need, and whether those of the cycle."""
    needed = {*wanted, *(_WHOLE if "whole_sensitivity" in wanted else ())}
    of_jacobian = tuple(name for name in JACOBIAN_FUNCTIONALS if name in needed)
    if "spectral_radius" in wanted:
        of_jacobian = (*CLUSTER, *(name for name in of_jacobian if name not in CLUSTER))
    others = {*of_jacobian, *_OF_THE_GAIT, *_DISTANCES, "whole_sensitivity", *_own(wanted)}
    return of_jacobian, bool(set(wanted) - others)


def _own(wanted: tuple[str, ...]) -> dict[str, Callable[[Any, Gait], tuple[Any, Any, Any, Any]]]:
    """Those of a user's own among these measures, by name."""
    known = {name: OBJECTIVES[name].measured for name in wanted if name in OBJECTIVES}
    return {name: measured for name, measured in known.items() if measured is not None}


def evaluate(
    scene: Scene | RigidScene,
    gait: Gait,
    names: Iterable[str],
    accuracy: str,
    functionals: BothFunctionals | None = None,
) -> Evaluation:
    """Objectives of a gait that was found with the sensitivities to all parameters.

    `functionals` are those of `functionals_of`, where they are known.
    """
    wanted = tuple(names)
    both = (gait.measures, gait.measure_errors, gait.sensitivities, gait.sensitivity_errors)
    rows = {name: _row(*(getattr(each, name) for each in both)) for name in _OF_THE_GAIT}
    rows |= {name: Functional(*measured(scene, gait)) for name, measured in _own(wanted).items()}
    if functionals is None:
        footsteps = gait.orbit[0].shape[0]
        functionals = functionals_of(scene, gait, wanted, footsteps, accuracy)
    of_jacobian, _ = _names_for(wanted)
    first, second = functionals
    if first is not None:
        # The orbit's own error moves the Jacobian, too, as its multipliers tell.
        shares = np.asarray(gait.multiplier_errors) / float(gait.measures.spectral_radius)
        rows |= {
            # Symmetric functions do not move as multipliers that meet do.
            name: row
            if name in SYMMETRIC
            else row._replace(error=max(row.error, abs(row.value) * float(shares[0])))
            for name, row in zip(of_jacobian, _rows_of(first), strict=True)
        }
    if "whole_sensitivity" in wanted:
        rows["whole_sensitivity"] = _root_of_squares([rows[name] for name in _WHOLE])
    if second is not None:
        rows |= dict(zip(integral_names(scene), _rows_of(second), strict=True))
        rows["cost_of_transport"] = _cost_of_transport(scene, rows)
    beyond_range = []
    for name in (name for name in wanted if name in _DISTANCES):
        told = bifurcation_distance(scene, gait, _DISTANCES[name], accuracy=accuracy)
        rows[name] = Functional(told.distance, told.error, told.slopes, told.slope_errors)
        if told.outcome is Sought.NONE_IN_RANGE:
            none = np.zeros_like(told.slopes)
            rows[name] = Functional(told.distance, 0.0, none, none)
            beyond_range.append(name)
    kept = {
        name: _row(*rows[name]) for name in dict.fromkeys((*wanted, *of_jacobian, *_OF_THE_GAIT))
    }
    state, slopes = gait.measures.state, gait.sensitivities.state
    return Evaluation(
        values={name: row.value for name, row in kept.items()},
        errors={name: row.error for name, row in kept.items()},
        slopes={name: row.slopes for name, row in kept.items()},
        slope_errors={name: row.slope_errors for name, row in kept.items()},
        state=np.stack(recurring_leaves(state)),
        state_slopes=np.stack(recurring_leaves(slopes)),
        beyond_range=tuple(beyond_range),
    )


def _row(value: Any, error: Any, slopes: Any, slope_errors: Any) -> Functional:
    return Functional(float(value), float(error), np.asarray(slopes), np.asarray(slope_errors))


def _rows_of(found: Functionals) -> list[Functional]:
    return [_row(*each) for each in zip(*map(np.asarray, found[:4]), strict=True)]


def _root_of_squares(rows: list[Functional]) -> Functional:
    value = float(np.sqrt(sum(row.value**2 for row in rows)))
    shares = [row.value / value for row in rows]
    return weighted_sum(shares, rows, len(rows[0].slopes))._replace(value=value)


def _cost_of_transport(scene: Scene | RigidScene, rows: dict[str, Functional]) -> Functional:
    """Losses, or what the motors do and gravity's share, over weight times length."""
    if scene.actuation is None:
        losses = [rows[name] for name in ("impact_loss", "friction_loss") if name in rows]
        return _over_weight_and_length(scene, losses, rows["step_length"])
    driven = _over_weight_and_length(scene, [rows["motor_work"]], rows["step_length"])
    slope = float(scene.ground.slope)
    by_slope = np.zeros(len(driven.slopes))
    by_slope[parameter_names(scene).index("slope")] = np.cos(slope)
    return driven._replace(value=driven.value + np.sin(slope), slopes=driven.slopes + by_slope)


def _over_weight_and_length(
    scene: Scene | RigidScene, works: list[Functional], length: Functional
) -> Functional:
    known = {name: float(value) for name, value in parameter_values(scene).items()}
    mass, names = float(scene.walker.total_mass), parameter_names(scene)
    own = length.slopes / length.value
    for name, share in (("m", 2.0 / mass), ("hip_mass", 1.0 / mass), ("g", 1.0 / known["g"])):
        own[names.index(name)] += share
    divisor = mass * known["g"] * length.value
    work = weighted_sum([1.0] * len(works), works, len(names))
    cost = work.value / divisor
    return Functional(
        value=cost,
        error=work.error / divisor + cost * length.error / length.value,
        slopes=work.slopes / divisor - cost * own,
        slope_errors=work.slope_errors / divisor + cost * length.slope_errors / length.value,
    )
