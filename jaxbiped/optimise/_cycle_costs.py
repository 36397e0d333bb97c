"""Costs of a cycle as functionals of a periodic orbit: integrals together, extremes one by one."""

from collections.abc import Callable, Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, is_number
from jaxbiped._types import Scalar, Time
from jaxbiped.caching._cached_jit import note_code
from jaxbiped.caching._known_by_shape import known_by_shape
from jaxbiped.compiler import host_jit
from jaxbiped.dynamics._walker_motion import WalkerMotion
from jaxbiped.gait._return_map_spec import ReturnMapSpec, runs_by_lanes
from jaxbiped.hybrid._guards import Switch
from jaxbiped.hybrid._motion_costs import Cost, Extreme, Integral
from jaxbiped.hybrid._sections import section_of
from jaxbiped.hybrid._system import AbstractSystem
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.optimise._augmented_system import (
    AbstractAugmentedSystem,
    MotionSection,
    integrals_of,
    join,
    motion_of,
)
from jaxbiped.optimise._cycle_functionals import (
    Functionals,
    cycle_spec,
    functional_precision,
    orbits_near,
    total_of_peak,
    totals_of_advance,
    with_errors,
)
from jaxbiped.scene._scene import WalkerScene
from jaxbiped.scene._state_types import WalkerState
from jaxbiped.solve._accuracy import Precision


class IntegratedCycle(AbstractAugmentedSystem):
    """A walker with integrals as coordinates, in their order.

    Attributes:
        walker: the walker without them.
        coordinates: their names.
        integrals: whose rates and terms at strikes they gain.
    """

    integrals: tuple[Integral, ...] = eqx.field(static=True)

    @classmethod
    def of(cls, walker: AbstractSystem, integrals: tuple[Integral, ...]) -> "IntegratedCycle":
        return cls(walker, tuple(f"integral_{k}" for k in range(len(integrals))), integrals)

    def vector_field(self, t: Time, y: PyTree, args: PyTree) -> PyTree:
        state = motion_of(y)
        motion = WalkerMotion(args, state)
        rates = {
            name: jnp.asarray(integral.rate(motion))
            for name, integral in zip(self.coordinates, self.integrals, strict=True)
        }
        return join(y, self.walker.vector_field(t, state, args), rates)

    def switches(self, args: PyTree, y: PyTree) -> tuple[Switch, ...]:
        state = motion_of(y)
        motion = WalkerMotion(args, state)
        corners = [
            Switch(value, True)
            for integral in self.integrals
            if integral.corners is not None
            for value in integral.corners(motion)
        ]
        return self.walker.switches(args, state) + tuple(corners)

    def reset_map(self, args: PyTree, y: PyTree) -> PyTree:
        state = motion_of(y)
        motion, gained = WalkerMotion(args, state), {}
        for name, integral in zip(self.coordinates, self.integrals, strict=True):
            gained[name] = getattr(y, name)
            if integral.at_strike is not None:
                gained[name] = gained[name] + integral.at_strike(motion)
        return join(y, self.walker.reset_map(args, state), gained)


class ExtremeCycle(AbstractAugmentedSystem):
    """A walker whose load is a function of the motion.

    Attributes:
        walker: the walker with its own load.
        coordinates: none.
        extreme: what is looked for; the load is its value, with the opposite sign for a smallest.
    """

    extreme: Extreme = eqx.field(static=True)

    @classmethod
    def of(cls, walker: AbstractSystem, extreme: Extreme) -> "ExtremeCycle":
        return cls(walker, (), extreme)

    def vector_field(self, t: Time, y: PyTree, args: PyTree) -> PyTree:
        return join(y, self.walker.vector_field(t, motion_of(y), args), {})

    def reset_map(self, args: PyTree, y: PyTree) -> PyTree:
        return join(y, self.walker.reset_map(args, motion_of(y)), {})

    def load(self, args: PyTree, y: PyTree) -> Scalar:
        motion = WalkerMotion(args, motion_of(y))
        return jnp.asarray(self.extreme.sign * self.extreme.value(motion))


def cost_functionals(
    scene: WalkerScene,
    state: WalkerState,
    costs: tuple[Cost, ...],
    *,
    arrivals: int = 1,
    accuracy: str = "balanced",
    engine: str = "lanes",
) -> Functionals:
    """The costs of the cycle of the gait with this state, in their order.

    Args:
        scene: the walker.
        state: of its gait, on the section.
        costs: integrals and extremes.
        arrivals: how often a cycle comes to the section.
        accuracy: "balanced" or "tight".
        engine: "xla" or "lanes".

    Returns:
        Those, with respect to all parameters in the order of `parameter_names`.
    """
    walker, section = system_of(scene.minimal), MotionSection(section_of(scene, None))
    precision = functional_precision(accuracy, scene)
    integrals = tuple(cost for cost in costs if isinstance(cost, Integral))
    systems: dict[tuple[Cost, ...], Any] = {}
    if integrals:
        systems[integrals] = IntegratedCycle.of(walker, integrals)
    for cost in costs:
        if isinstance(cost, Extreme):
            systems[cost,] = ExtremeCycle.of(walker, cost)
    rows: dict[Cost, list[Scalar]] = {}
    codes = []
    for own, system in systems.items():
        spec = cycle_spec(scene, system, section, arrivals, engine)
        note_code(spec, scene)
        told = _functionals(spec, scene, system.begin(state), precision)
        rows |= {cost: [part[k] for part in told[:4]] for k, cost in enumerate(own)}
        codes.append(told.code)
    columns = zip(*(rows[cost] for cost in costs), strict=True)
    return Functionals(*map(jnp.stack, columns), jnp.max(jnp.stack(codes)))


@host_jit(runs_by_lanes)
def _functionals(
    spec: ReturnMapSpec, scene: WalkerScene, y: PyTree, fine: Precision
) -> Functionals:
    orbits = orbits_near(spec, scene, y, fine)
    if isinstance(spec.system, ExtremeCycle):
        sign = spec.system.extreme.sign
        peaks, slopes = jax.vmap(total_of_peak)(orbits.returns, orbits.points)
        values, slopes = sign * peaks[:, None], sign * slopes[:, None]
    else:
        values, slopes = jax.vmap(totals_of_advance)(orbits.returns, orbits.points)
    return with_errors(values, slopes / orbits.sizes, orbits.returns.code)


def check_cost(cost: Cost, scene: Any) -> None:
    """Raises `ArgumentError` for a cost that the scene cannot have, before anything is compiled."""
    if integrals_of(scene) is None:
        raise ArgumentError(
            f"{cost.name} is not allowed for a {type(scene).__name__}: costs are functions of a "
            "walker's motion; add a coordinate of its own to the system instead."
        )
    functions: Mapping[str, Any] = (
        {"rate": cost.rate, "at_strike": cost.at_strike}
        if isinstance(cost, Integral)
        else {"value": cost.value}
    )
    if functions.get("at_strike") is not None and not system_of(scene).footsteps_end_on_section:
        raise ArgumentError(
            f"at_strike of {cost.name} is not allowed for compliant feet, which press into the "
            "ground for a while: give a rate."
        )
    for name, function in functions.items():
        if function is not None:
            _check_number(f"{name} of {cost.name}", function, scene)


def _check_number(words: str, function: Callable[..., Any], scene: Any) -> None:
    state = scene.state_type(*[np.zeros(())] * len(scene.state_names))
    leaf = jtu.tree_leaves(state)[0]
    try:
        told = _shape_of(function, scene, state)
    except (jax.errors.ConcretizationTypeError, jax.errors.TracerArrayConversionError) as error:
        raise ArgumentError(
            f"{words} takes the motion for plain numbers, which is not allowed: write it with "
            "jax.numpy, and a choice with jax.numpy.where."
        ) from error
    if told != (np.shape(leaf), "f"):
        raise ArgumentError(f"{words} returns {told[0]}, which is not allowed: return one number.")


@known_by_shape
def _shape_of(function: Callable[..., Any], scene: Any, state: Any) -> Any:
    value = function(WalkerMotion(scene, state))
    if not isinstance(value, jax.Array) and not is_number(value):
        return repr(value), ""
    value = jnp.asarray(value)
    return jnp.shape(value), "f" if jnp.issubdtype(value.dtype, jnp.floating) else "other"
