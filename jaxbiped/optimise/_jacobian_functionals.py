"""Functionals of the return map's Jacobian: smooth bound of its radius, gait sensitivity norm.

Their derivatives are second derivatives of the motion, by the adjoint of the second variation:
weights of the Jacobian's entries, factored into pairs of directions and of weights.
"""

import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.compiler import host_jit
from jaxbiped.dynamics._surfaces import AbstractSection
from jaxbiped.gait._fixed_point_search import with_looser
from jaxbiped.gait._orbit_derivatives import slopes_of
from jaxbiped.gait._poincare_map import LinearisedReturn
from jaxbiped.gait._return_map_spec import ReturnMapSpec, runs_by_lanes
from jaxbiped.gait._second_variation import second_variation
from jaxbiped.linalg._small_matrices import singular_pairs
from jaxbiped.optimise._augmented_cycles import (
    DROP,
    PUSH,
    LowestSwing,
    LowestSwingSection,
    SteppedSection,
    disturbed_cycle,
)
from jaxbiped.optimise._augmented_system import AbstractAugmentedSystem, MotionSection
from jaxbiped.optimise._cycle_functionals import (
    Functionals,
    cycle_spec,
    functional_precision,
    orbits_near,
    with_errors,
)
from jaxbiped.optimise._jacobian_weights import (
    CLEARANCE_NORMS,
    MODULI,
    entry_weights,
    leading_multipliers,
)
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.scene._state_types import WalkerState
from jaxbiped.solve._accuracy import Precision
from jaxbiped.variational._adjoint_solve import COUNT
from jaxbiped.variational._hybrid_system import section_of, system_of

_BY_STEP = ("floor_sensitivity", "floor_clearance_sensitivity")
"""Functionals of a cycle that a step in the ground disturbs; of all others a push does."""
JACOBIAN_FUNCTIONALS = (
    *MODULI,
    "radius_bound",
    "sensitivity_norm",
    "floor_sensitivity",
    *CLEARANCE_NORMS,
    "strike_divergence",
)


def jacobian_functionals(
    scene: Scene | RigidScene,
    state: WalkerState,
    names: tuple[str, ...] = JACOBIAN_FUNCTIONALS,
    *,
    arrivals: int = 1,
    accuracy: str = "balanced",
    engine: str = "lanes",
) -> Functionals:
    """Moduli of the leading multipliers, a smooth bound of them all, the gait sensitivity norm.

    The moduli are those of different multipliers, largest first, of a conjugate pair once: where
    two of them are equal the spectral radius has a corner, and they have none. Zero where there is
    no further multiplier.

    The bound is ‖P⁶⁴‖^(1/64), with Frobenius's norm and components in their sizes on a walk: never
    below the spectral radius, and smooth also where multipliers meet.

    The norm is √Σ |g_n|² over all footsteps n, where g are the relative changes of step length
    and of step time for each unit of a push: of a force along the slope in units of the weight that
    acts for one cycle. It is infinite where the gait is not stable. Hobbelen and Wisse, IEEE Trans.
    Robotics 23 (2007) 1213, with this push as the disturbance. The floor sensitivity is the same
    for each unit of a step in the ground, in leg lengths: from the next footstep on the ground lies
    lower by so much, along the slope's normal.

    The clearance sensitivity and the floor clearance sensitivity are the same norms of one number:
    the height of the swinging foot where it passes lowest, above the ground that the other stands
    on, in leg lengths.

    The divergence of the foot strike is ln |λ₁ λ₂ …|, by which a footstep changes volumes of phase
    space about the orbit. A passive rigid walker's swing changes none in canonical coordinates, by
    Liouville's theorem, so that all of it is the strike's, whatever the coordinates. After Jin,
    Kistemaker, van Dieën, Daffertshofer and Bruijn, Royal Society Open Science 8 (2021) 201122.

    Args:
        scene: the walker.
        state: of its gait, on the section.
        names: which of `JACOBIAN_FUNCTIONALS`, or of `CLUSTER`; each costs adjoint solves of its
            own.
        arrivals: how often a cycle comes to the section.
        accuracy: "balanced" or "tight".
        engine: "xla" or "lanes".

    Returns:
        Those, with respect to all parameters in the order of `parameter_names`.
    """
    groups: dict[tuple[bool, bool], tuple[str, ...]] = {}
    for name in names:
        kind = name in _BY_STEP, name in CLEARANCE_NORMS
        groups[kind] = (*groups.get(kind, ()), name)
    told = []
    for (by_step, has_clearance), group in groups.items():
        on, count = section_of(scene, None), arrivals
        disturbed = disturbed_cycle(system_of(scene), DROP if by_step else PUSH)
        system: AbstractAugmentedSystem = disturbed
        section: AbstractSection = SteppedSection(on) if by_step else MotionSection(on)
        if has_clearance:
            system, section = LowestSwing(disturbed), LowestSwingSection(section)
            count *= 2
        spec = cycle_spec(scene, system, section, count, engine)
        precision = functional_precision(accuracy, scene, group)
        told.append(_functionals(spec, scene, system.begin(state), group, precision))
    if len(told) == 1:
        return told[0]
    every = [name for group in groups.values() for name in group]
    order = jnp.asarray([every.index(name) for name in names])
    rows = (jnp.concatenate(part)[order] for part in zip(*(each[:4] for each in told), strict=True))
    return Functionals._make([*rows, jnp.max(jnp.stack([each.code for each in told]))])


@host_jit(runs_by_lanes)
def _functionals(
    spec: ReturnMapSpec,
    scene: Scene | RigidScene,
    y: PyTree,
    names: tuple[str, ...],
    fine: Precision,
) -> Functionals:
    seeds, sizes, points, returns = orbits_near(spec, scene, y, fine)
    m = points.shape[1]
    leading = leading_multipliers(returns.jacobian[0, :, :m])

    def at(once: LinearisedReturn, precision: Precision) -> tuple[Scalar, Scalar]:
        first = slopes_of(once)
        # The Jacobian's rows, as components lie: hip_x, the clock, a fall, and what must return.
        rows = jnp.concatenate([once.advance_rows, once.jacobian])[:, :m]
        length = jnp.stack([once.advance[0], once.period])
        told = [entry_weights(name, y, rows, length, leading) for name in names]
        pairs = [_in_pairs(each.by_rows, each.rank) for each in told]
        along, weights = (jnp.concatenate(part) for part in zip(*pairs, strict=True))

        def part(along: Scalar, weights: Scalar) -> Scalar:
            tangents = first.recurring
            return second_variation(
                spec, seeds, y, once, along, weights, tangents, sizes, precision
            ).slopes

        parts, done, slopes = jax.vmap(part)(along, weights), 0, []
        by_length = jnp.stack([first.advance[0], first.period])
        for each, (own, _) in zip(told, pairs, strict=True):
            total = jnp.sum(parts[done : done + len(own)], axis=0)
            slopes.append(total + each.by_length @ by_length)
            done += len(own)
        return jnp.stack([each.value for each in told]), jnp.stack(slopes) / sizes

    return with_errors(*jax.vmap(at)(returns, with_looser(fine)), returns.code)


def _in_pairs(weights: Scalar, rank: int) -> tuple[Scalar, Scalar]:
    """Directions (k, 2, m) and weights (k, 2, d + m) whose products sum to a matrix."""
    left, values, right = singular_pairs(weights)
    count = -(-rank // COUNT)
    spare = ((0, max(COUNT * count - len(values), 0)), (0, 0))
    along = jnp.pad(right, spare)[: COUNT * count]
    scaled = jnp.pad((left * values).T, spare)[: COUNT * count]
    return along.reshape(count, COUNT, -1), scaled.reshape(count, COUNT, -1)
