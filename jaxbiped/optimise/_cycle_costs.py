"""Costs of a cycle as functionals of a periodic orbit: integrals together, extremes one by one."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import Scalar, Time
from jaxbiped.caching._cached_jit import note_code
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
    return Functionals._make([*map(jnp.stack, columns), jnp.max(jnp.stack(codes))])


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
