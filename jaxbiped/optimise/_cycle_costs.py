"""Costs of a cycle as functionals of a periodic orbit: integrals together, extremes one by one."""

from typing import cast

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


class CostedCycle(AbstractAugmentedSystem):
    """A walker with integrals as coordinates, in their order, whose load is a function of it.

    Attributes:
        walker: the walker without them.
        coordinates: their names.
        integrals: whose rates and terms at resets they gain.
        extreme: what is looked for; the load is its value, with the opposite sign for a smallest.
            None for no load.
    """

    integrals: tuple[Integral, ...] = eqx.field(static=True)
    extreme: Extreme | None = eqx.field(static=True)

    @classmethod
    def of(
        cls, walker: AbstractSystem, integrals: tuple[Integral, ...], extreme: Extreme | None = None
    ) -> "CostedCycle":
        names = tuple(f"integral_{k}" for k in range(len(integrals)))
        return cls(walker, names, integrals, extreme)

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
            value if isinstance(value, Switch) else Switch(value, True)
            for integral in self.integrals
            if integral.corners is not None
            for value in integral.corners(motion)
        ]
        return self.walker.switches(args, state) + tuple(corners)

    def reset_map(self, args: PyTree, y: PyTree) -> PyTree:
        state = motion_of(y)
        after = self.walker.reset_map(args, state)
        if not self.walker.footsteps_end_on_section:
            return self.with_motion(y, after)
        struck = join(y, after, self._with_terms(args, y, after))
        for name, integral in zip(self.coordinates, self.integrals, strict=True):
            if integral.at_strike is not None:
                more = getattr(struck, name) + integral.at_strike(WalkerMotion(args, state))
                struck = struck._replace(**{name: more})
        return struck

    def reset_at_switch(self, args: PyTree, y: PyTree, which: Scalar) -> PyTree:
        after = self.walker.reset_at_switch(args, motion_of(y), which)
        return join(y, after, self._with_terms(args, y, after))

    def _with_terms(self, args: PyTree, y: PyTree, after: PyTree) -> dict[str, Scalar]:
        """The coordinates behind a reset, with what every reset adds."""
        gained = {name: getattr(y, name) for name in self.coordinates}
        both = WalkerMotion(args, motion_of(y)), WalkerMotion(args, after)
        for name, integral in zip(self.coordinates, self.integrals, strict=True):
            if integral.at_reset is not None:
                gained[name] = gained[name] + integral.at_reset(*both)
        return gained

    def load(self, args: PyTree, y: PyTree) -> Scalar | None:
        if self.extreme is None:
            return None
        value = self.extreme.value(WalkerMotion(args, motion_of(y)))
        return jnp.asarray(self.extreme.sign * value)


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
    extremes = [cost for cost in costs if isinstance(cost, Extreme)]
    first = extremes[0] if extremes else None
    # All integrals are coordinates of one solve; each solve looks for one extreme.
    groups = [(integrals, first), *(((), extreme) for extreme in extremes[1:])]
    rows: dict[Cost, list[Scalar]] = {}
    codes = []
    for summed, extreme in groups:
        system = CostedCycle.of(walker, summed, extreme)
        spec = cycle_spec(scene, system, section, arrivals, engine)
        note_code(spec, scene)
        told = _functionals(spec, scene, system.begin(state), precision)
        group: tuple[Cost, ...] = summed if extreme is None else (*summed, extreme)
        rows |= {cost: [part[k] for part in told[:4]] for k, cost in enumerate(group)}
        codes.append(told.code)
    columns = zip(*(rows[cost] for cost in costs), strict=True)
    return Functionals._make([*map(jnp.stack, columns), jnp.max(jnp.stack(codes))])


@host_jit(runs_by_lanes)
def _functionals(
    spec: ReturnMapSpec, scene: WalkerScene, y: PyTree, fine: Precision
) -> Functionals:
    orbits = orbits_near(spec, scene, y, fine)
    both = orbits.returns, orbits.points
    values, slopes = jax.vmap(totals_of_advance)(*both)
    extreme = cast(CostedCycle, spec.system).extreme
    if extreme is not None:
        peaks, by_peak = jax.vmap(total_of_peak)(*both)
        values = jnp.concatenate([values, extreme.sign * peaks[:, None]], axis=1)
        slopes = jnp.concatenate([slopes, extreme.sign * by_peak[:, None]], axis=1)
    return with_errors(values, slopes / orbits.sizes, orbits.returns.code)
