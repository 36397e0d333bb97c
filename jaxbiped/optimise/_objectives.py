"""Objectives: measures of a periodic gait by name, and which scenes have them."""

import functools
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple, TypeAlias

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np

from jaxbiped._checks import ArgumentError, check_choice, check_function, check_type
from jaxbiped._quantity import Quantity
from jaxbiped._types import Scalar, as_float
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.dynamics._energy import is_driven
from jaxbiped.dynamics._state import cyclic_names
from jaxbiped.gait._gait import Gait
from jaxbiped.hybrid._motion_costs import (
    Cost,
    Extreme,
    Integral,
    check_cost,
    check_has_costs,
    has_motion_costs,
    name_of,
)
from jaxbiped.hybrid._named_costs import NAMED_COSTS, cost_named, lacks_swing, part_of
from jaxbiped.scene._modes import rigid_modes
from jaxbiped.scene._parameter_access import parameter_names, parameter_values, select_parameters
from jaxbiped.scene._scene import AbstractScene

_SEARCHED = {
    "fatal_push": "it is the nearest point of a basin's boundary, found by a search that has no "
    "derivatives; jb.basins.minimal_fatal_shock tells it of a gait that was found",
}
"""What a gait has that is none of a smooth function's values."""


def _of_strike(scene: Any) -> str | None:
    if hasattr(scene, "normal"):
        return "its feet press into the ground for a while instead of striking at once"
    damps = any(getattr(part, "damping", None) is not None for part in scene.mechanism.joints)
    if is_driven(scene) or damps:
        return "what drives or damps it changes volumes of phase space, too"
    if rigid_modes(scene.mechanism).any:
        return "its stops or flat feet strike, too"
    return None


def _of_steps(scene: Any) -> str | None:
    structure = scene.mechanism.structure
    if structure.swing_leg == structure.stance_leg or structure.cycle_footsteps > 1:
        return "it is known of mirrored walkers alone, whose cycle is a step"
    return None


def _of_clearance(scene: Any) -> str | None:
    return lacks_swing(scene) or _of_steps(scene)


class Combined(NamedTuple):
    """A function of measures.

    Attributes:
        function: of their values, in the order of their names; JAX differentiates it.
        of: their names.
    """

    function: Callable[..., Any]
    of: tuple[str, ...]


def _divide(dividend: Any, divisor: Any) -> Any:
    return dividend / divisor


def _cost_of_transport(work: Any, length: Any, weight: Any, slope: Any) -> Any:
    """Work of the motors over weight times length, and gravity's share, exact over a cycle."""
    return work / (weight * length) + jnp.sin(slope)


class ParameterFunction(eqx.Module):
    """A measure that is a function of the scene's parameters alone.

    Attributes:
        function: of a scene; JAX differentiates it.
    """

    function: Callable[[Any], Any] = eqx.field(static=True)

    def __call__(self, scene: Any, gait: Gait) -> tuple[Any, Any, Any, Any]:
        """The value, its error, the derivatives with respect to the p parameters, their errors."""
        value, slopes = _value_and_slopes(self.function, jtu.tree_map(as_float, scene))
        return float(value), 0.0, np.asarray(slopes), np.zeros(len(slopes))


@cached_jit
def _value_and_slopes(function: Callable[[Any], Any], scene: Any) -> tuple[Scalar, Scalar]:
    value, slopes = jax.value_and_grad(function)(scene)
    (_, places), leaves = select_parameters(scene, None), jtu.tree_leaves(slopes)
    return value, jnp.stack([leaves[k] for k in places])


def _weight(scene: Any) -> Any:
    return scene.mechanism.total_mass * scene.ground.g


def _slope(scene: Any) -> Any:
    return scene.ground.slope


class Objective(NamedTuple):
    """A measure that can be optimised or bounded. Add one of your own to `OBJECTIVES`.

    One that is an integral along the cycle, or an extreme of the motion, needs no such entry: give
    `optimise_gait` an `Integral`, an `Extreme` or a constraint `Along` the cycle.

    Attributes:
        quantity: words, symbol and unit.
        lacks: function that returns why a scene does not have this objective, or None if it has.
        measured: for an objective of your own, a function of a scene and its gait that returns the
            value, its error, the derivatives with respect to the p parameters, shape (p,), and
            their errors.
        costs: integrals and extremes with their weights, whose sum it is; none for others.
        combined: a function of other measures, and their names; None for others.
    """

    quantity: Quantity
    lacks: Callable[[Any], str | None] = lambda _: None
    measured: Callable[[Any, Gait], tuple[Any, Any, Any, Any]] | None = None
    costs: tuple[tuple[float, Cost], ...] = ()
    combined: Combined | None = None


OBJECTIVES = {
    "speed": Objective(Quantity("speed", "$v$", "m/s")),
    "step_length": Objective(Quantity("step length", "$L$", "m")),
    "period": Objective(Quantity("period", "$T$", "s")),
    "peak_normal": Objective(Quantity("peak normal force", "$F$", "N")),
    "spectral_radius": Objective(Quantity("spectral radius", "$\\rho$")),
    "radius_bound": Objective(Quantity("smooth bound of the spectral radius", "$\\rho_q$")),
    "sensitivity_norm": Objective(Quantity("gait sensitivity norm", "$\\|G\\|$")),
    "floor_sensitivity": Objective(
        Quantity("gait sensitivity norm to steps", "$\\|G_h\\|$"), _of_steps
    ),
    "clearance_sensitivity": Objective(
        Quantity("sensitivity norm of clearance", "$\\|G_c\\|$"), _of_clearance
    ),
    "floor_clearance_sensitivity": Objective(
        Quantity("sensitivity norm of clearance to steps", "$\\|G_{hc}\\|$"), _of_clearance
    ),
    "whole_sensitivity": Objective(
        Quantity("gait sensitivity norm of all", "$\\|G_a\\|$"), _of_clearance
    ),
    "strike_divergence": Objective(
        Quantity("divergence of foot strike", "$\\ln|\\det S|$"), _of_strike
    ),
    "cost_of_transport": Objective(
        Quantity("cost of transport", "$C$"),
        combined=Combined(_cost_of_transport, ("motor_work", "step_length", "weight", "slope")),
    ),
    "weight": Objective(Quantity("weight", "$m g$", "N"), measured=ParameterFunction(_weight)),
    "slope": Objective(Quantity("slope", "$\\gamma$", "rad"), measured=ParameterFunction(_slope)),
    "fold_distance": Objective(Quantity("distance to the fold in slope", "$D_f$", "rad")),
    "doubling_distance": Objective(Quantity("distance to the doubling in slope", "$D_d$", "rad")),
}
"""By name; see `NAMED_COSTS` for what is summed along a cycle.

- cost of transport: work of gravity and of the motors over weight times way, as
  `measure.cost_of_transport` has it; sin(slope) for a passive walker.
- radius bound: never below the spectral radius, and smooth also where multipliers meet or have
  equal moduli, where that has corners; see `jacobian_functionals`.
- sensitivity norm, floor sensitivity, their norms of clearance, strike divergence: see
  `jacobian_functionals`; whole sensitivity: the root of the sum of squares of these four norms.
- fold distance, doubling distance: to the nearest in slope, see `bifurcation_distance`. Where none
  lies in the range that is followed the distance is that of the range's farther end, without
  derivatives: more than that of any design that has one.
"""


_PER = {"_per_length": ("step_length", "length", "m"), "_per_time": ("period", "time", "s")}
"""What a cost by name may be divided by: the measure, its words and its unit."""
Measures: TypeAlias = Mapping[str, Objective]
"""Objectives by the names that an optimisation tells them by."""


def objective_named(name: str, what: str = "objective") -> Objective:
    """An objective by its name, that of a part as `NAME[part]`, or one per length or per time.

    Raises:
        ArgumentError: an unknown name.
    """
    if name in _SEARCHED:
        raise ArgumentError(f"{what} = {name!r} is not allowed: {_SEARCHED[name]}.")
    if name in OBJECTIVES:
        return OBJECTIVES[name]
    for suffix, (divisor, words, unit) in _PER.items():
        base = name.removesuffix(suffix)
        if base != name and part_of(base)[0] in NAMED_COSTS:
            known = objective_named(base, what)
            per = Quantity(
                f"{known.quantity.words} per {words}", "", f"({known.quantity.unit})/{unit}"
            )
            return Objective(per, known.lacks, combined=Combined(_divide, (base, divisor)))
    cost, part = cost_named(name, what, tuple(OBJECTIVES))
    return Objective(cost.quantity, cost.lacks, costs=cost.costs(part))


def measures_named(names: Iterable[str]) -> dict[str, Objective]:
    """The objectives of these names."""
    return {name: objective_named(name) for name in names}


def with_parts(measures: Measures) -> dict[str, Objective]:
    """The measures, each behind those of which it is a function."""
    every: dict[str, Objective] = {}

    def add(name: str, objective: Objective) -> None:
        for part in objective.combined.of if objective.combined else ():
            if part not in every:
                add(part, measures.get(part) or objective_named(part))
        every[name] = objective

    for name, objective in measures.items():
        add(name, objective)
    return every


def costs_of(measures: Measures, scene: Any) -> tuple[Cost, ...]:
    """All integrals and extremes in measures, each once; what a scene lacks is zero and not among
    them.
    """
    known = (each.costs for each in measures.values() if each.costs and not each.lacks(scene))
    return tuple(dict.fromkeys(cost for costs in known for _, cost in costs))


def _of_ground(name: str, scene: AbstractScene) -> str | None:
    if has_motion_costs(scene):
        return None
    advances = bool(cyclic_names(scene.state_type))
    own = ("period", "spectral_radius", *(("speed", "step_length") if advances else ()))
    return None if name in own else f"a {type(scene).__name__} has {', '.join(own)}"


def check_objective(
    given: "str | Measure", scene: Any, what: str = "objective"
) -> tuple[str, Objective]:
    """The name of a measure that is asked for by name or as an object, and the objective.

    Raises:
        ArgumentError: an unknown name, what is neither, or an objective that the scene lacks.
    """
    check_type(what, given, str, Integral, Extreme, FunctionOf, Linear)
    objective, lacks = objective_of(given, scene, what), None
    name = given if isinstance(given, str) else given.name
    if isinstance(given, FunctionOf):
        for part in given.of:
            check_objective(part, scene, what)
    elif isinstance(given, str) and name in OBJECTIVES:
        lacks = _of_ground(name, scene) if objective.measured is None else None
    elif objective.costs or objective.combined:
        check_has_costs(name, scene)
    lacks = lacks or objective.lacks(scene)
    if lacks is not None:
        raise ArgumentError(f"{what} = {name!r} is not allowed for this scene: {lacks}.")
    if isinstance(given, Integral | Extreme):
        check_cost(given, scene)
    return name, objective


def objective_of(given: "str | Measure", scene: Any, what: str) -> Objective:
    """The objective that a name or an object asks for.

    Raises:
        ArgumentError: an unknown name of a measure or of a parameter.
    """
    if isinstance(given, str):
        return objective_named(given, what)
    if isinstance(given, FunctionOf):
        return Objective(given.quantity, combined=Combined(given.function, given.of))
    if isinstance(given, Linear):
        for name in given.weights:
            check_choice(what, name, parameter_names(scene))
        sums = functools.partial(_linear, tuple(given.weights.items()))
        return Objective(Quantity(given.name), measured=ParameterFunction(sums))
    return Objective(given.quantity, costs=((1.0, given),))


class FunctionOf(eqx.Module):
    """A function of a gait's measures, as a measure.

    Attributes:
        function: of the values of the measures, one argument each; JAX differentiates it.
        of: names of the measures.
        quantity: words, symbol and unit. The words, with underscores, are its name.

    Examples:
        >>> import jaxbiped as jb
        >>> froude = jb.optimise.FunctionOf(
        ...     lambda speed: speed**2 / (9.81 * 0.4), ("speed",), jb.laws.Quantity("froude")
        ... )
        >>> froude.name
        'froude'
    """

    function: Callable[..., Any] = eqx.field(static=True)
    of: tuple[str, ...] = eqx.field(static=True)
    quantity: Quantity = eqx.field(static=True)

    def __check_init__(self) -> None:
        check_function("function", self.function)
        check_type("of", self.of, tuple)
        check_type("quantity", self.quantity, Quantity)

    @property
    def name(self) -> str:
        """What it is called where measures are told by name."""
        return name_of(self.quantity)


class Linear(NamedTuple):
    """A weighted sum of parameters that is held: parameters that are tied, or bounded together.

    Attributes:
        weights: weights by parameter.
        equals: what the sum must be; None for bounds.
        low, high: bounds of the sum; None for none.
        name: what it is called in `Optimum.measures`.

    Examples:
        >>> import jaxbiped as jb
        >>> tied = jb.optimise.Linear({"d": 1.0, "r": -2.0}, equals=0.0)
        >>> tied.bounds
        (0.0, 0.0)
    """

    weights: Mapping[str, float]
    equals: float | None = None
    low: float | None = None
    high: float | None = None
    name: str = "linear"

    @property
    def bounds(self) -> tuple[float | None, float | None]:
        """Its bounds, equal ones for an equality."""
        return (self.low, self.high) if self.equals is None else (self.equals, self.equals)


Measure: TypeAlias = Cost | FunctionOf | Linear
"""A measure that is asked for as an object."""


def _linear(weights: tuple[tuple[str, float], ...], scene: Any) -> Any:
    values = parameter_values(scene)
    return sum(weight * values[name] for name, weight in weights)


def is_sum_of_parameters(objective: Objective) -> bool:
    """Whether a measure is one that `Linear` describes, by names of parameters."""
    function = getattr(objective.measured, "function", None)
    return getattr(function, "func", None) is _linear
