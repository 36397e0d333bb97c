"""Functionals of the return map's Jacobian: smooth bound of its radius, gait sensitivity norm.

Their derivatives are second derivatives of the motion, by the adjoint of the second variation:
weights of the Jacobian's entries, factored into pairs of directions and of weights.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._cached_jit import cached_jit
from jaxbiped._types import Scalar
from jaxbiped.dynamics._rigid_state import WalkerState
from jaxbiped.dynamics._section import AbstractSection
from jaxbiped.gait._fixed_point_search import LOOSER
from jaxbiped.gait._orbit import slopes_of
from jaxbiped.gait._poincare_map import (
    LinearisedReturn,
    linearised_return,
    recurring_components,
    seed_directions,
)
from jaxbiped.gait._return_map_spec import ReturnMapSpec
from jaxbiped.gait._second_variation import second_variation
from jaxbiped.linalg._small_matrices import eigenpairs, invert, singular_pairs
from jaxbiped.optimise._augmented_state import MotionSection
from jaxbiped.optimise._cycle_functionals import (
    Functionals,
    corrected,
    cycle_spec,
    with_errors,
)
from jaxbiped.optimise._disturbed_cycle import disturbed, undisturbed
from jaxbiped.optimise._stepped_cycle import SteppedSection, stepped, unstepped
from jaxbiped.scene._parameters import select_parameters
from jaxbiped.scene._rigid_scene import RigidScene
from jaxbiped.scene._scene import Scene
from jaxbiped.solve._accuracy import Precision, precision_of
from jaxbiped.variational._adjoint_solve import COUNT
from jaxbiped.variational._hybrid_system import AbstractSystem, section_of

LEADING = 3
"""Moduli that are told apart: of a pair of conjugate multipliers once."""
JACOBIAN_FUNCTIONALS = (
    *("spectral_radius", "modulus_2", "modulus_3")[:LEADING],
    "radius_bound",
    "sensitivity_norm",
    "floor_sensitivity",
    "strike_divergence",
)
SQUARINGS = 6
"""Of the return map's Jacobian P for its bound ‖P⁶⁴‖^(1/64)."""
_SIZES = {"hip_z": 0.4, "hip_vx": 2.0, "hip_vz": 2.0, "omega_1": 5.0, "omega_2": 5.0}
"""Of components (SI units), for that norm: the same for all walkers, so that it is one function."""
_DOUBLINGS = 24
"""Of the footsteps over which responses are summed: 2 ** 24 of them."""


def jacobian_functionals(
    scene: Scene | RigidScene,
    state: WalkerState,
    names: tuple[str, ...] = JACOBIAN_FUNCTIONALS,
    *,
    footsteps: int = 1,
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

    The divergence of the foot strike is ln |λ₁ λ₂ …|, by which a footstep changes volumes of phase
    space about the orbit. A passive rigid walker's swing changes none in canonical coordinates, by
    Liouville's theorem, so that all of it is the strike's, whatever the coordinates. After Jin,
    Kistemaker, van Dieën, Daffertshofer and Bruijn, Royal Society Open Science 8 (2021) 201122.

    Args:
        scene: the walker.
        state: of its gait, on the section.
        names: which of `JACOBIAN_FUNCTIONALS`; each costs adjoint solves of its own.
        footsteps: how many a cycle has.
        accuracy: "balanced" or "tight".
        engine: "xla" or "lanes".

    Returns:
        Those, with respect to all parameters in the order of `parameter_names`.
    """
    on = section_of(scene, None)
    groups = {
        _disturbance(name): tuple(
            each for each in names if _disturbance(each) == _disturbance(name)
        )
        for name in names
    }
    systems: dict[str, tuple[PyTree, AbstractSystem, AbstractSection]] = {
        "step": (unstepped(state), stepped(scene), SteppedSection(on)),
        "push": (undisturbed(state), disturbed(scene), MotionSection(on)),
    }
    told = []
    for disturbance, group in groups.items():
        y, system, section = systems[disturbance]
        spec = cycle_spec(scene, system, section, footsteps, accuracy, engine)
        told.append(_functionals(spec, scene, y, group, accuracy))
    if len(told) == 1:
        return told[0]
    every = [name for group in groups.values() for name in group]
    order = jnp.asarray([every.index(name) for name in names])
    values, errors, slopes, slope_errors = (
        jnp.concatenate([each[k] for each in told])[order] for k in range(4)
    )
    code = jnp.max(jnp.stack([each.code for each in told]))
    return Functionals(values, errors, slopes, slope_errors, code)


def _disturbance(name: str) -> str:
    """What a functional's cycle is disturbed by."""
    return "step" if name == "floor_sensitivity" else "push"


@cached_jit
def _functionals(
    spec: ReturnMapSpec,
    scene: Scene | RigidScene,
    y: PyTree,
    names: tuple[str, ...],
    accuracy: str,
) -> Functionals:
    m = len(recurring_components(spec.system, y))
    _, active = select_parameters(scene, None)
    seeds, sizes = seed_directions(scene, active, m)
    fine = precision_of(accuracy, scene)
    y = corrected(spec, seeds, y, fine)
    both = Precision(*(jnp.asarray([tol, LOOSER * tol]) for tol in fine))

    def once(precision: Precision) -> LinearisedReturn:
        return linearised_return(spec, seeds, y, precision, jnp.asarray(False))

    returns = jax.vmap(once)(both)
    leading = _leading(returns.jacobian[0, :, :m])

    def at(once: LinearisedReturn) -> tuple[Scalar, Scalar]:
        first = slopes_of(once)
        # The Jacobian's rows, as components lie: hip_x, the clock, a fall, and what must return.
        rows = jnp.concatenate([once.advance_rows, once.jacobian])[:, :m]
        length = jnp.stack([once.advance[0], once.period])
        told = [_weighed(name, y, rows, length, leading) for name in names]
        pairs = [_in_pairs(each.by_rows, each.rank) for each in told]
        along, weights = (jnp.concatenate(part) for part in zip(*pairs, strict=True))

        def part(along: Scalar, weights: Scalar) -> Scalar:
            return second_variation(spec, seeds, y, once, along, weights, first.recurring, sizes)

        parts, done, slopes = jax.vmap(part)(along, weights), 0, []
        by_length = jnp.stack([first.advance[0], first.period])
        for each, (own, _) in zip(told, pairs, strict=True):
            total = jnp.sum(parts[done : done + len(own)], axis=0)
            slopes.append(total + each.by_length @ by_length)
            done += len(own)
        found = jnp.where(once.jumps > 0, jnp.nan, jnp.stack(slopes))
        return jnp.stack([each.value for each in told]), found / sizes

    return with_errors(*jax.vmap(at)(returns), returns.code)


class _Weighed(NamedTuple):
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


def _in_pairs(weights: Scalar, rank: int) -> tuple[Scalar, Scalar]:
    """Directions (k, 2, m) and weights (k, 2, d + m) whose products sum to a matrix."""
    left, values, right = singular_pairs(weights)
    count = -(-rank // COUNT)
    spare = ((0, max(COUNT * count - len(values), 0)), (0, 0))
    along = jnp.pad(right, spare)[: COUNT * count]
    scaled = jnp.pad((left * values).T, spare)[: COUNT * count]
    return along.reshape(count, COUNT, -1), scaled.reshape(count, COUNT, -1)


class _Eigen(NamedTuple):
    """Eigenvalues, right eigenvectors (columns) and left ones (rows), wᵀ v = 1."""

    values: Scalar
    right: Scalar
    left: Scalar


def _eigen(jacobian: Scalar) -> _Eigen:
    finite = jnp.all(jnp.isfinite(jacobian))
    values, right = eigenpairs(jnp.where(finite, jacobian, jnp.eye(len(jacobian))))
    return _Eigen(
        values * jnp.where(finite, 1.0, jnp.nan).astype(values.dtype), right, invert(right)
    )


def _by_entries(eigen: _Eigen, shares: Scalar) -> Scalar:
    """Derivatives Σ Re(share · dλ) with respect to the rows: dλ = wᵀ dP v."""
    weights = jnp.einsum("i,ia,bi->ab", shares, eigen.left, eigen.right).real
    return jnp.concatenate([jnp.zeros((2, len(weights))), weights])


def _leading(jacobian: Scalar) -> Scalar:
    """Of the different multipliers those of largest modulus, of a conjugate pair the upper one."""
    values = _eigen(jacobian).values
    sizes = jnp.where(values.imag < 0.0, -1.0, jnp.abs(values))
    order = jnp.argsort(-sizes)[:LEADING]
    return jnp.where(sizes[order] > 0.0, values[order], jnp.zeros_like(values[order]))


def _modulus(k: int, rows: Scalar, length: Scalar, leading: Scalar) -> _Weighed:
    """Of the multiplier nearest to the k-th leading one: a looser solve may have another order."""
    eigen = _eigen(rows[2:])
    place = jnp.argmin(jnp.abs(eigen.values - leading[k]))
    size = jnp.abs(eigen.values[place])
    known = (size > 0.0) & (leading[k] != 0.0)
    divisor = jnp.where(known, size, 1.0).astype(eigen.values.dtype)
    shares = jnp.zeros_like(eigen.values).at[place].set(jnp.conj(eigen.values[place]) / divisor)
    value = jnp.where(known, size, 0.0)
    return _Weighed(value, _by_entries(eigen, shares), 2, jnp.zeros_like(length))


def _divergence(rows: Scalar, length: Scalar) -> _Weighed:
    """Without the zeros of the push and of the section."""
    eigen = _eigen(rows[2:])
    order = jnp.argsort(-jnp.abs(eigen.values))[:-2]
    leading = eigen.values[order]
    shares = jnp.zeros_like(eigen.values).at[order].set(1.0 / leading)
    value = jnp.sum(jnp.log(jnp.abs(leading)))
    return _Weighed(value, _by_entries(eigen, shares), len(order), jnp.zeros_like(length))


def _radius_bound(sizes: Scalar, rows: Scalar, length: Scalar) -> _Weighed:
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
    return _Weighed(value, weights, rows.shape[1], jnp.zeros_like(length))


def _sensitivity_norm(rows: Scalar, length: Scalar) -> _Weighed:
    own = rows[-rows.shape[1] :]
    jacobian = jnp.where(jnp.isfinite(own), own, 0.0)
    stable = jnp.max(jnp.abs(eigenpairs(jacobian)[0])) < 1.0
    value, (weights, by_length) = jax.value_and_grad(_norm, argnums=(0, 1))(
        jnp.where(stable, rows, jnp.zeros_like(rows).at[:2].set(rows[:2])), length
    )
    return _Weighed(jnp.where(stable, value, jnp.inf), weights, rows.shape[1], by_length)


def _norm(rows: Scalar, length: Scalar) -> Scalar:
    """√(Q₀₀), where Q = Σ (Aⁿ)ᵀ CᵀC Aⁿ solves Q = CᵀC + Aᵀ Q A, by doubling."""
    power, told = rows[-rows.shape[1] :], rows[:2] / length[:, None]
    total = told.T @ told
    for _ in range(_DOUBLINGS):
        total, power = total + power.T @ total @ power, power @ power
    return jnp.sqrt(total[0, 0])


def _weighed(name: str, y: PyTree, rows: Scalar, length: Scalar, leading: Scalar) -> _Weighed:
    if name == "radius_bound":
        sizes = jnp.asarray([_SIZES.get(field, 1.0) for field in y._fields[3:]])
        return _radius_bound(sizes, rows, length)
    if name in ("sensitivity_norm", "floor_sensitivity"):
        return _sensitivity_norm(rows, length)
    if name == "strike_divergence":
        return _divergence(rows, length)
    return _modulus(JACOBIAN_FUNCTIONALS.index(name), rows, length, leading)
