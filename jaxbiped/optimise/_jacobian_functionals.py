"""Functionals of the return map's Jacobian: smooth bound of its radius, gait sensitivity norm.

Their derivatives are second derivatives of the motion, by the adjoint of the second variation:
weights of the Jacobian's entries, factored into pairs of directions and of weights.
"""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.compiler import host_jit
from jaxbiped.dynamics._state import dimensions_of
from jaxbiped.gait._fixed_point_search import with_looser
from jaxbiped.gait._orbit_derivatives import second_variation, slopes_of
from jaxbiped.gait._poincare_map import LinearisedReturn
from jaxbiped.gait._return_map_spec import ReturnMapSpec, runs_by_lanes
from jaxbiped.hybrid._sections import AbstractSection, HeelStrike, section_of
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.linalg._small_matrices import Eigensystem, eigenpairs, eigensystem, singular_pairs
from jaxbiped.optimise._augmented_system import (
    DROP,
    PUSH,
    AbstractAugmentedSystem,
    LowestSwing,
    LowestSwingSection,
    MotionSection,
    SteppedSection,
    disturbed_cycle,
)
from jaxbiped.optimise._cycle_functionals import (
    Functionals,
    cycle_spec,
    functional_precision,
    orbits_near,
    with_errors,
)
from jaxbiped.scene._scene import WalkerScene
from jaxbiped.scene._state_types import WalkerState
from jaxbiped.solve._accuracy import Precision
from jaxbiped.variational._adjoint_solve import COUNT

MODULI = ("spectral_radius", "modulus_2", "modulus_3")
"""Moduli that are told apart: of a pair of conjugate multipliers once."""
SYMMETRIC = ("symmetric_1", "symmetric_2", "symmetric_3")
"""Elementary symmetric functions λ₁ + λ₂ + λ₃, … of a cluster: the three leading multipliers, of
which no conjugate lies outside. They are smooth where its multipliers meet."""
CLUSTER = ("spectral_radius", *SYMMETRIC, "next_modulus")
"""What the spectral radius is bounded by: the cluster, and the largest modulus outside of it."""
CLEARANCE_NORMS = ("clearance_sensitivity", "floor_clearance_sensitivity")
"""Norms of the swinging foot's clearance, by a push and by a step in the ground."""
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
SQUARINGS = 6
"""Of the return map's Jacobian P for its bound ‖P⁶⁴‖^(1/64)."""
_SIZES: dict[tuple[float, float], float] = {(1, 0): 0.4, (1, -1): 2.0, (0, -1): 5.0, (0, 0): 1.0}
"""Of components by the powers of length and time in their units (SI), for that norm: the same for
all walkers, so that it is one function."""
_DOUBLINGS = 24
"""Of the footsteps over which responses are summed: 2 ** 24 of them."""


class WeightedEntries(NamedTuple):
    """A function of the Jacobian's rows, and of step length and period.

    Attributes:
        value: the function.
        by_rows: its derivatives with respect to the rows, shape (d + m, m), of this `rank`: those
            of d cyclic coordinates come first.
        by_length: with respect to step length and period, shape (2,).
    """

    value: Scalar
    by_rows: Scalar
    rank: int
    by_length: Scalar


def _eigen(jacobian: Scalar) -> Eigensystem:
    finite = jnp.all(jnp.isfinite(jacobian))
    found = eigensystem(jnp.where(finite, jacobian, jnp.eye(len(jacobian))))
    lost = jnp.where(finite, 1.0, jnp.nan).astype(found.values.dtype)
    return found._replace(values=found.values * lost)


def _by_entries(eigen: Eigensystem, shares: Scalar) -> Scalar:
    """Derivatives Σ Re(share · dλ) with respect to the rows: dλ = wᵀ dP v."""
    # Zeros of multiple eigenvalues have no finite left vectors, and no share.
    left = jnp.where(shares[:, None] == 0.0, 0.0, eigen.left)
    weights = jnp.einsum("i,ia,bi->ab", shares, left, eigen.right).real
    return jnp.concatenate([jnp.zeros((2, len(weights))), weights])


def leading_multipliers(jacobian: Scalar) -> Scalar:
    """Of the different multipliers those of largest modulus, of a conjugate pair the upper one."""
    values = _eigen(jacobian).values
    sizes = jnp.where(values.imag < 0.0, -1.0, jnp.abs(values))
    order = jnp.argsort(-sizes)[: len(MODULI)]
    return jnp.where(sizes[order] > 0.0, values[order], jnp.zeros_like(values[order]))


def _modulus(k: int, rows: Scalar, length: Scalar, leading: Scalar) -> WeightedEntries:
    """Of the multiplier nearest to the k-th leading one: a looser solve may have another order."""
    eigen = _eigen(rows[2:])
    place = jnp.argmin(jnp.abs(eigen.values - leading[k]))
    size = jnp.abs(eigen.values[place])
    known = (size > 0.0) & (leading[k] != 0.0)
    divisor = jnp.where(known, size, 1.0).astype(eigen.values.dtype)
    shares = jnp.zeros_like(eigen.values).at[place].set(jnp.conj(eigen.values[place]) / divisor)
    value = jnp.where(known, size, 0.0)
    return WeightedEntries(value, _by_entries(eigen, shares), 2, jnp.zeros_like(length))


def _cluster(values: Scalar) -> tuple[Scalar, Scalar]:
    """Which multipliers the cluster has, and which is the largest outside (booleans, (m,)).

    Multipliers are taken by size while they fit in, a conjugate pair at once.
    """
    sizes = jnp.abs(values)
    order = jnp.argsort(-sizes - 1e-9 * jnp.sign(values.imag))
    inside, room = jnp.zeros(len(values), bool), jnp.asarray(len(SYMMETRIC))
    for k in range(len(values)):
        at = order[k]
        paired, follows = values[at].imag != 0.0, values[at].imag < 0.0
        mate = inside[order[max(k - 1, 0)]]
        fits = jnp.where(follows, mate, room >= jnp.where(paired, 2, 1)) & (sizes[at] > 0.0)
        inside = inside.at[at].set(fits)
        room = room - fits.astype(int)
    outside = jnp.argmax(jnp.where(inside, -1.0, sizes))
    return inside, jnp.arange(len(values)) == outside


def _symmetric(k: int, rows: Scalar, length: Scalar) -> WeightedEntries:
    """The k-th of the cluster: its derivatives are those of its multipliers, which add up."""
    eigen = _eigen(rows[2:])
    inside, _ = _cluster(eigen.values)
    own = jnp.where(inside, eigen.values, 0.0)
    first, second, third = (jnp.sum(own**power) for power in (1, 2, 3))
    product = 0.5 * (first * first - second)
    values = (first, product, (first**3 - 3.0 * first * second + 2.0 * third) / 6.0)
    shares = (jnp.ones_like(own), first - own, product - own * (first - own))
    by_rows = _by_entries(eigen, jnp.where(inside, shares[k], 0.0))
    return WeightedEntries(values[k].real, by_rows, len(SYMMETRIC), jnp.zeros_like(length))


def _next_modulus(rows: Scalar, length: Scalar) -> WeightedEntries:
    eigen = _eigen(rows[2:])
    _, outside = _cluster(eigen.values)
    size = jnp.sum(jnp.where(outside, jnp.abs(eigen.values), 0.0))
    known = outside & (size > 0.0)
    divisor = jnp.where(size > 0.0, size, 1.0).astype(eigen.values.dtype)
    shares = jnp.where(known, jnp.conj(eigen.values) / divisor, 0.0)
    return WeightedEntries(size, _by_entries(eigen, shares), 2, jnp.zeros_like(length))


def _divergence(rows: Scalar, length: Scalar) -> WeightedEntries:
    """Without the zeros of the push and of the section."""
    eigen = _eigen(rows[2:])
    order = jnp.argsort(-jnp.abs(eigen.values))[:-2]
    leading = eigen.values[order]
    shares = jnp.zeros_like(eigen.values).at[order].set(1.0 / leading)
    value = jnp.sum(jnp.log(jnp.abs(leading)))
    return WeightedEntries(value, _by_entries(eigen, shares), len(order), jnp.zeros_like(length))


def _radius_bound(sizes: Scalar, rows: Scalar, length: Scalar) -> WeightedEntries:
    def bound(rows: Scalar) -> Scalar:
        # Without the push, which has no response of its own.
        power, logarithm = rows[3:, 1:] * sizes / sizes[:, None], jnp.zeros(())
        # Each power is scaled to the order of one, so that small ones do not vanish.
        for k in range(SQUARINGS):
            size = jnp.sqrt(jnp.sum(power * power))
            logarithm = logarithm + jnp.log(size) / 2**k
            power = (power / size) @ (power / size)
        return jnp.exp(logarithm + 0.5 * jnp.log(jnp.sum(power * power)) / 2**SQUARINGS)

    value, weights = jax.value_and_grad(bound)(rows)
    return WeightedEntries(value, weights, rows.shape[1], jnp.zeros_like(length))


def _norm_of(
    response: Callable[[Scalar, Scalar], Scalar], rows: Scalar, length: Scalar
) -> WeightedEntries:
    """Of the response over all footsteps."""
    own = rows[-rows.shape[1] :]
    jacobian = jnp.where(jnp.isfinite(own), own, 0.0)
    stable = jnp.max(jnp.abs(eigenpairs(jacobian)[0])) < 1.0

    def norm(rows: Scalar, length: Scalar) -> Scalar:
        return _response_norm(rows[-rows.shape[1] :], response(rows, length))

    value, (weights, by_length) = jax.value_and_grad(norm, argnums=(0, 1))(
        jnp.where(stable, rows, rows.at[-rows.shape[1] :].set(0.0)), length
    )
    return WeightedEntries(jnp.where(stable, value, jnp.inf), weights, rows.shape[1], by_length)


def _response_norm(power: Scalar, told: Scalar) -> Scalar:
    """√(Q₀₀), where Q = Σ (Aⁿ)ᵀ CᵀC Aⁿ solves Q = CᵀC + Aᵀ Q A, by doubling."""
    total = told.T @ told
    for _ in range(_DOUBLINGS):
        total, power = total + power.T @ total @ power, power @ power
    return jnp.sqrt(total[0, 0])


def entry_weights(
    name: str, y: PyTree, rows: Scalar, length: Scalar, leading: Scalar
) -> WeightedEntries:
    """A functional by name.

    Args:
        name: one of `jacobian_functionals`.
        y: a state, whose recurring components the disturbance is the first of.
        rows: of the Jacobian, shape (d + m, m), those of d cyclic coordinates first.
        length: step length and period, shape (2,).
        leading: multipliers that are told apart, of a solve that all others are compared with.
    """
    if name == "radius_bound":
        units = dimensions_of(type(y))
        sizes = jnp.asarray([_SIZES[units[field]] for field in y._fields[3:]])
        return _radius_bound(sizes, rows, length)
    if name in SYMMETRIC:
        return _symmetric(SYMMETRIC.index(name), rows, length)
    if name in MODULI:
        return _modulus(MODULI.index(name), rows, length, leading)
    return _OF_ROWS[name](rows, length)


_PUSH_NORM = partial(_norm_of, lambda rows, length: rows[:2] / length[:, None])
"""Of relative changes of step length and step time."""
_OF_ROWS: dict[str, Callable[[Scalar, Scalar], WeightedEntries]] = {
    "sensitivity_norm": _PUSH_NORM,
    "floor_sensitivity": _PUSH_NORM,
    # Of changes of foot clearance, in leg lengths.
    **dict.fromkeys(CLEARANCE_NORMS, partial(_norm_of, lambda rows, length: rows[1:2])),
    "strike_divergence": _divergence,
    "next_modulus": _next_modulus,
}


def jacobian_functionals(
    scene: WalkerScene,
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
        disturbed = disturbed_cycle(system_of(scene.minimal), DROP if by_step else PUSH)
        system: AbstractAugmentedSystem = disturbed
        # Mid-stance lies where it does, however high the ground.
        is_moved = by_step and isinstance(on, HeelStrike)
        section: AbstractSection = SteppedSection(on) if is_moved else MotionSection(on)
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
    scene: WalkerScene,
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
