"""Objectives: measures of a periodic gait by name, their gradients and their error bars."""

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np

from jaxbiped._checks import ArgumentError, check_choice
from jaxbiped._quantity import Quantity
from jaxbiped.continuation._bifurcations import BranchEvent
from jaxbiped.dynamics._state_quantities import recurring_leaves
from jaxbiped.gait._gait import Gait
from jaxbiped.optimise._bifurcation_distance import Sought, bifurcation_distance
from jaxbiped.optimise._cycle_functionals import Functionals, cycle_functionals, integral_names
from jaxbiped.optimise._jacobian_functionals import JACOBIAN_FUNCTIONALS, jacobian_functionals
from jaxbiped.optimise._jacobian_weights import CLEARANCE_NORMS, CLUSTER, SYMMETRIC
from jaxbiped.scene._parameter_access import parameter_names, parameter_values
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.scene.laws.friction._coulomb import Frictionless


def _of_any(scene: Scene | RigidScene) -> str | None:
    return None


def _of_driven(scene: Scene | RigidScene) -> str | None:
    return "it has no actuators" if scene.actuation is None else None


def _of_slip(scene: Scene | RigidScene) -> str | None:
    return None if isinstance(scene, Scene) else "a rigid walker's feet roll without slip"


def _of_friction(scene: Scene | RigidScene) -> str | None:
    if isinstance(scene, Scene) and isinstance(scene.friction, Frictionless):
        return "its friction is Frictionless"
    return _of_slip(scene)


def _of_strike(scene: Scene | RigidScene) -> str | None:
    if isinstance(scene, Scene):
        return "its feet press into the ground for a while instead of striking at once"
    if scene.actuation is not None:
        return "what drives it changes volumes of phase space, too"
    return None


def _of_swing(scene: Scene | RigidScene) -> str | None:
    if isinstance(scene, Scene) and not isinstance(
        scene.clearance.admits(1, jnp.ones(())), jax.Array
    ):
        return f"its clearance rule is {type(scene.clearance).__name__}, which lets no foot pass"
    return None


class Objective(NamedTuple):
    """What can be optimised or bounded; a user's own is added to `OBJECTIVES`.

    Attributes:
        quantity: words, symbol and unit.
        lacks: why a scene has none of it, None where it has.
        measured: of a user's own, value, error, derivatives with respect to the p parameters (p,)
            and their errors, of a scene and its gait.
    """

    quantity: Quantity
    lacks: Callable[[Scene | RigidScene], str | None] = _of_any
    measured: Callable[[Scene | RigidScene, Gait], tuple[Any, Any, Any, Any]] | None = None


OBJECTIVES = {
    "speed": Objective(Quantity("speed", "$v$", "m/s")),
    "step_length": Objective(Quantity("step length", "$L$", "m")),
    "period": Objective(Quantity("period", "$T$", "s")),
    "peak_normal": Objective(Quantity("peak normal force", "$F$", "N")),
    "spectral_radius": Objective(Quantity("spectral radius", "$\\rho$")),
    "radius_bound": Objective(Quantity("smooth bound of the spectral radius", "$\\rho_q$")),
    "sensitivity_norm": Objective(Quantity("gait sensitivity norm", "$\\|G\\|$")),
    "floor_sensitivity": Objective(Quantity("gait sensitivity norm to steps", "$\\|G_h\\|$")),
    "clearance_sensitivity": Objective(
        Quantity("sensitivity norm of clearance", "$\\|G_c\\|$"), _of_swing
    ),
    "floor_clearance_sensitivity": Objective(
        Quantity("sensitivity norm of clearance to steps", "$\\|G_{hc}\\|$"), _of_swing
    ),
    "whole_sensitivity": Objective(
        Quantity("gait sensitivity norm of all", "$\\|G_a\\|$"), _of_swing
    ),
    "strike_divergence": Objective(
        Quantity("divergence of foot strike", "$\\ln|\\det S|$"), _of_strike
    ),
    "cost_of_transport": Objective(Quantity("cost of transport", "$C$")),
    "impact_loss": Objective(Quantity("energy lost in impacts", "$E_i$", "J")),
    "friction_loss": Objective(Quantity("energy lost to friction", "$E_f$", "J"), _of_friction),
    "slip_distance": Objective(Quantity("slip distance", "$s$", "m"), _of_slip),
    "motor_work": Objective(Quantity("work of the motors", "$W$", "J"), _of_driven),
    "foot_clearance": Objective(Quantity("foot clearance", "$h$", "m"), _of_swing),
    "fold_distance": Objective(Quantity("distance to the fold in slope", "$D_f$", "rad")),
    "doubling_distance": Objective(Quantity("distance to the doubling in slope", "$D_d$", "rad")),
}
"""By name. Those of a cycle: losses and slip are sums over its footsteps.

- cost of transport: work of gravity and of the motors over weight times way, as
  `measure.cost_of_transport` has it; a passive walker's is what it loses, sin(slope) in all.
- impact loss: work of the normal reactions; a rigid walker's kinetic energy lost in its impacts,
  after its push-off.
- motor work: of each motor where its power is positive, added up, and the push-off's.
- slip distance: path of the feet that touch, along the ground.
- foot clearance: least height of the swinging foot, negative where it passes underground.
- radius bound: never below the spectral radius, and smooth also where multipliers meet or have
  equal moduli, where that has corners; see `jacobian_functionals`.
- sensitivity norm, floor sensitivity, their norms of clearance, strike divergence: see
  `jacobian_functionals`; whole sensitivity: the root of the sum of squares of these four norms.
- fold distance, doubling distance: to the nearest in slope, see `bifurcation_distance`. Where none
  lies in the range that is followed the distance is that of the range's farther end, without
  derivatives: more than that of any design that has one.
"""
_OF_THE_GAIT = ("speed", "step_length", "period", "peak_normal")
_SEARCHED = {
    "fatal_push": "it is the nearest point of a basin's boundary, found by a search that has no "
    "derivatives; jb.basins.minimal_fatal_shock tells it of a gait that was found",
}
"""What a gait has that is none of a smooth function's values."""
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


def check_objective(name: str, scene: Scene | RigidScene, what: str = "objective") -> None:
    """Raises `ArgumentError` for an unknown objective, or one that the scene lacks."""
    if name in _SEARCHED:
        raise ArgumentError(f"{what} = {name!r} is not allowed: {_SEARCHED[name]}.")
    check_choice(what, name, OBJECTIVES)
    lacks = OBJECTIVES[name].lacks(scene)
    if lacks is not None:
        raise ArgumentError(f"{what} = {name!r} is not allowed for this scene: {lacks}.")


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
    rows |= {name: _Row(*measured(scene, gait)) for name, measured in _own(wanted).items()}
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
        rows[name] = _Row(told.distance, told.error, told.slopes, told.slope_errors)
        if told.outcome is Sought.NONE_IN_RANGE:
            none = np.zeros_like(told.slopes)
            rows[name] = _Row(told.distance, 0.0, none, none)
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


class _Row(NamedTuple):
    value: float
    error: float
    slopes: np.ndarray
    slope_errors: np.ndarray


def _row(value: Any, error: Any, slopes: Any, slope_errors: Any) -> _Row:
    return _Row(float(value), float(error), np.asarray(slopes), np.asarray(slope_errors))


def _rows_of(found: Functionals) -> list[_Row]:
    return [_row(*each) for each in zip(*map(np.asarray, found[:4]), strict=True)]


def _root_of_squares(rows: list[_Row]) -> _Row:
    value = float(np.sqrt(sum(row.value**2 for row in rows)))
    shares = [row.value / value for row in rows]
    each = list(zip(shares, rows, strict=True))
    slopes, slope_errors = (
        np.asarray(sum(share * getattr(row, name) for share, row in each))
        for name in ("slopes", "slope_errors")
    )
    return _Row(value, sum(share * row.error for share, row in each), slopes, slope_errors)


def _cost_of_transport(scene: Scene | RigidScene, rows: dict[str, _Row]) -> _Row:
    """Losses, or what the motors do and gravity's share, over weight times length."""
    if scene.actuation is None:
        losses = [rows[name] for name in ("impact_loss", "friction_loss") if name in rows]
        return _over_weight_and_length(scene, losses, rows["step_length"])
    driven = _over_weight_and_length(scene, [rows["motor_work"]], rows["step_length"])
    slope = float(scene.ground.slope)
    by_slope = np.zeros(len(driven.slopes))
    by_slope[parameter_names(scene).index("slope")] = np.cos(slope)
    return driven._replace(value=driven.value + np.sin(slope), slopes=driven.slopes + by_slope)


def _over_weight_and_length(scene: Scene | RigidScene, works: list[_Row], length: _Row) -> _Row:
    known = {name: float(value) for name, value in parameter_values(scene).items()}
    mass, names = float(scene.walker.total_mass), parameter_names(scene)
    own = length.slopes / length.value
    for name, share in (("m", 2.0 / mass), ("hip_mass", 1.0 / mass), ("g", 1.0 / known["g"])):
        own[names.index(name)] += share
    divisor = mass * known["g"] * length.value
    cost = sum(row.value for row in works) / divisor
    slopes = sum(row.slopes for row in works) / divisor - cost * own
    errors = sum(row.error for row in works) / divisor + cost * length.error / length.value
    slope_errors = sum(row.slope_errors for row in works) / divisor
    return _Row(cost, errors, slopes, slope_errors + cost * length.slope_errors / length.value)
