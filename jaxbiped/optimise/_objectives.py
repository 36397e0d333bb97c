"""Objectives: measures of a periodic gait by name, and which scenes have them."""

import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple, TypeAlias

import jax
import jax.numpy as jnp

from jaxbiped._checks import ArgumentError, check_choice, check_type
from jaxbiped._quantity import Quantity
from jaxbiped.dynamics._energy import is_driven
from jaxbiped.dynamics._state import cyclic_names
from jaxbiped.gait._gait import Gait
from jaxbiped.hybrid._motion_costs import Cost, Extreme, Integral
from jaxbiped.hybrid._named_costs import NAMED_COSTS
from jaxbiped.optimise._augmented_system import integrals_of
from jaxbiped.optimise._cycle_costs import check_cost
from jaxbiped.scene._modes import rigid_modes
from jaxbiped.scene._scene import AbstractScene
from jaxbiped.scene.laws.friction._coulomb import Frictionless

_SEARCHED = {
    "fatal_push": "it is the nearest point of a basin's boundary, found by a search that has no "
    "derivatives; jb.basins.minimal_fatal_shock tells it of a gait that was found",
}
"""What a gait has that is none of a smooth function's values."""


def _of_driven(scene: Any) -> str | None:
    return None if is_driven(scene) else "it has no actuators"


def _of_slip(scene: Any) -> str | None:
    return None if hasattr(scene, "friction") else "a rigid walker's feet roll without slip"


def _of_friction(scene: Any) -> str | None:
    if isinstance(getattr(scene, "friction", None), Frictionless):
        return "its friction is Frictionless"
    return _of_slip(scene)


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
    return _of_swing(scene) or _of_steps(scene)


def _of_swing(scene: Any) -> str | None:
    rule = getattr(scene, "clearance", None)
    if rule is None or isinstance(
        rule.admits(scene.mechanism.structure.legs[0], jnp.ones(())), jax.Array
    ):
        return None
    return f"its clearance rule is {type(rule).__name__}, which lets no foot pass"


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
        quotient: names of the measures whose quotient it is; none for others.
    """

    quantity: Quantity
    lacks: Callable[[Any], str | None] = lambda _: None
    measured: Callable[[Any, Gait], tuple[Any, Any, Any, Any]] | None = None
    costs: tuple[tuple[float, Cost], ...] = ()
    quotient: tuple[str, str] | None = None


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
  `measure.cost_of_transport` has it; sin(slope) for a passive walker.
- impact loss: work of the normal reactions, and what springs, stops and latches lose; a rigid
  walker's kinetic energy lost in its impacts, after its push-off, and what its joints lose.
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


_PER = {"_per_length": ("step_length", "length", "m"), "_per_time": ("period", "time", "s")}
"""What a cost by name may be divided by: the measure, its words and its unit."""
_DIVIDED = ("slip_distance", "friction_loss", "impact_loss", "motor_work")
"""Objectives that are integrals along the cycle."""
_OF_PART = re.compile(r"(\w+)\[(\w+)\]")

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
        if base != name and (base in _DIVIDED or _part_of(base)[0] in NAMED_COSTS):
            known = objective_named(base, what)
            per = Quantity(
                f"{known.quantity.words} per {words}", "", f"({known.quantity.unit})/{unit}"
            )
            return Objective(per, known.lacks, quotient=(base, divisor))
    base, part = _part_of(name)
    if base not in NAMED_COSTS or (part is not None and not NAMED_COSTS[base].part):
        check_choice(what, name, (*OBJECTIVES, *NAMED_COSTS))
    cost = NAMED_COSTS[base]
    if part is None and cost.part == "angle":
        raise ArgumentError(f"{what} = {name!r} is not allowed: name an angle, {name}[BODY].")
    return Objective(cost.quantity, cost.lacks, costs=cost.costs(part))


def _part_of(name: str) -> tuple[str, str | None]:
    match = _OF_PART.fullmatch(name)
    return (match[1], match[2]) if match else (name, None)


def measures_named(names: Iterable[str]) -> dict[str, Objective]:
    """The objectives of these names."""
    return {name: objective_named(name) for name in names}


def with_divided(measures: Measures) -> dict[str, Objective]:
    """The measures, and those of which they are quotients."""
    every = dict(measures)
    for objective in measures.values():
        for name in objective.quotient or ():
            every.setdefault(name, objective_named(name))
    return every


def costs_of(measures: Measures) -> tuple[Cost, ...]:
    """All integrals and extremes in measures, each once."""
    return tuple(dict.fromkeys(cost for each in measures.values() for _, cost in each.costs))


def _of_ground(name: str, scene: AbstractScene) -> str | None:
    if integrals_of(scene) is not None:
        return None
    advances = bool(cyclic_names(scene.state_type))
    own = ("period", "spectral_radius", *(("speed", "step_length") if advances else ()))
    return None if name in own else f"a {type(scene).__name__} has {', '.join(own)}"


def check_objective(
    given: str | Cost, scene: Any, what: str = "objective"
) -> tuple[str, Objective]:
    """The name of a measure that is asked for by name or as a cost, and the objective.

    Raises:
        ArgumentError: an unknown name, what is neither, or an objective that the scene lacks.
    """
    if isinstance(given, Integral | Extreme):
        check_cost(given, scene)
        return given.name, Objective(given.quantity, costs=((1.0, given),))
    check_type(what, given, str, Integral, Extreme)
    objective, lacks = objective_named(given, what), None
    if objective.measured is None and not objective.costs:
        lacks = _of_ground(objective.quotient[0] if objective.quotient else given, scene)
    lacks = lacks or objective.lacks(scene)
    if lacks is not None:
        raise ArgumentError(f"{what} = {given!r} is not allowed for this scene: {lacks}.")
    for _, cost in objective.costs:
        check_cost(cost, scene)
    return given, objective
