"""Periodic orbit: its stability and its sensitivities."""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.gait._fixed_point_search import FixedPointProblem, Found, Search, with_looser
from jaxbiped.gait._poincare_map import LinearisedReturn, linearised_return
from jaxbiped.gait._return_map_spec import ReturnMapSpec
from jaxbiped.gait._second_variation import second_variation
from jaxbiped.gait._stability import Stability, stability_of
from jaxbiped.linalg._small_matrices import eigensystem, solve
from jaxbiped.solve._accuracy import Precision

CLOSENESS = 1e-3
"""Distance of a multiplier from the unit circle that is flagged as a bifurcation."""
_RADIUS_FLOOR = 2e-8
"""Error of the spectral radius's derivatives that no tolerance takes away, in units of the
parameter's size: of the switches' crossings, which second derivatives magnify."""


_ROWS = ("jacobian", "monodromy", "period_row", "advance_rows", "peak_row")
"""Those of a return's leaves that are derivatives."""
_NOTHING = 1e-300
_SHARE = 0.5
"""Of what a looser solve changes, that a first derivative may be wrong by."""
_POOLED = 0.1
"""Of what it changes on the whole, that every derivative is wrong by at least."""


class Slopes(NamedTuple):
    """Derivatives of an orbit with respect to p parameters in units of their sizes (1 where zero).

    Attributes:
        recurring: of the m recurring components on the section, shape (m, p).
        period: of the period, shape (p,).
        advance: of what the cyclic coordinates gain in a cycle, shape (d, p).
        peak: of the largest load, shape (p,).
    """

    recurring: Scalar
    period: Scalar
    advance: Scalar
    peak: Scalar


class Orbit(NamedTuple):
    """A periodic orbit of a system with m recurring components and d cyclic coordinates.

    Attributes:
        found: how the search went, and the last return.
        state: the state on the section, its cyclic coordinates zero.
        stability: its Floquet multipliers.
        slopes: its derivatives with respect to the parameters; `slope_errors` their errors.
        radius_slopes: derivatives of the spectral radius, shape (p,); NaN where not asked for.
        radius_errors: their estimated errors.
        sizes: by how much each parameter moved, shape (p,).
    """

    found: Found
    state: PyTree
    stability: Stability
    slopes: Slopes
    slope_errors: Slopes
    radius_slopes: Scalar
    radius_errors: Scalar
    sizes: Scalar


def with_parameter_columns(problem: FixedPointProblem, found: Found) -> Found:
    """What a search found, with derivatives with respect to parameters as well.

    The gait's own values and derivatives stay those of the search. Of parameters nothing is claimed
    (NaN) where it did not converge.
    """
    m, own = found.recurring.shape[0], found.both
    alone = {name: getattr(own, name)[..., :m] for name in _ROWS}
    if not problem.active:
        return found._replace(both=own._replace(**alone))
    seeds, _ = problem.directions(m)
    start = problem.state(found.recurring)
    idle = found.ending == int(Search.NO_RETURN)
    lost = idle | (found.ending == int(Search.NOT_CONVERGED))

    def once(precision: Precision) -> LinearisedReturn:
        return linearised_return(problem.spec, seeds, start, precision, idle)

    new = _each_of(problem.spec, once)(with_looser(problem.precision))

    def joined(name: str) -> Scalar:
        parameters = jnp.where(lost, jnp.nan, getattr(new, name)[..., m:])
        return jnp.concatenate([alone[name], parameters], axis=-1)

    changed = {name: joined(name) for name in _ROWS}
    for name in ("jumps", "missed", "grazes"):
        changed[name] = jnp.maximum(getattr(own, name), getattr(new, name))
    return found._replace(both=own._replace(nodes=new.nodes, **changed))


def orbit_of(problem: FixedPointProblem, found: Found, *, radius: bool) -> Orbit:
    """The orbit that a search found, differentiated by the implicit function theorem.

    `radius` asks for the derivatives of the spectral radius as well.
    """
    state = problem.state(found.recurring)
    m = found.recurring.shape[0]
    last, coarse = found.last, found.coarse
    monodromy, witness = last.monodromy[:, :m], coarse.monodromy[:, :m]
    stability = stability_of(monodromy, witness, last.velocity, CLOSENESS)
    unknown = jnp.where(last.grazes > 0, jnp.inf, stability.errors)
    stability = stability._replace(errors=unknown)
    slopes, looser = (slopes_of(each) for each in (last, coarse))
    # Where the force itself jumped on the section by XLA, columns lack the jump's own correction.
    slopes = jax.tree.map(lambda leaf: jnp.where(last.missed > 0, jnp.nan, leaf), slopes)
    errors = _slope_errors(last, slopes, looser)
    _, sizes = problem.directions(m)
    radius_slopes = radius_errors = jnp.full(len(problem.active), jnp.nan)
    if radius and problem.active:
        slopes_of_radius = functools.partial(_radius_slopes, problem)
        radius_slopes, looser_slopes = _each_of(problem.spec, slopes_of_radius)(found.both)
        change = jnp.abs(radius_slopes - looser_slopes)
        size = jnp.maximum(jnp.sum(radius_slopes * radius_slopes), _NOTHING)
        share = jnp.sqrt(jnp.sum(change * change) / size)
        pooled = _POOLED * share * jnp.abs(radius_slopes)
        radius_errors = jnp.maximum(jnp.maximum(change, pooled), _RADIUS_FLOOR)
    return Orbit(found, state, stability, slopes, errors, radius_slopes, radius_errors, sizes)


def slopes_of(last: LinearisedReturn) -> Slopes:
    """x(p) = P(x(p), p) differentiated: dx = (I − P_x)⁻¹ P_p, and all else by the chain rule.

    Args:
        last: a return to where it began, with p directions of parameters.

    Returns:
        Derivatives of the orbit, in units of the parameters' sizes; NaN where it grazes a switch,
        for they differ on both sides.
    """
    m = last.recurring.shape[0]
    by_state, by_parameter = last.jacobian[:, :m], last.jacobian[:, m:]
    recurring = solve(jnp.eye(m) - by_state, by_parameter)
    return _chain_rule(last, jnp.where(last.grazes > 0, jnp.nan, recurring))


def _chain_rule(
    last: LinearisedReturn, recurring: Scalar, size: Callable[[Scalar], Scalar] = lambda rows: rows
) -> Slopes:
    """What derivatives of the recurring components make of the others, of terms by their `size`."""
    m = last.recurring.shape[0]

    def total(rows: Scalar) -> Scalar:
        return size(rows[..., m:]) + size(rows[..., :m]) @ recurring

    return Slopes(recurring, total(last.period_row), total(last.advance_rows), total(last.peak_row))


def _slope_errors(last: LinearisedReturn, slopes: Slopes, looser: Slopes) -> Slopes:
    """What a looser solve changes, and no less than what it changes on the whole.

    Where a single derivative is hardly changed that is chance: terms that make it up are as
    uncertain as others'. So the changes of a measure are pooled, each relative to the sum of its
    terms without their signs.
    """
    m = last.recurring.shape[0]
    inverse = jnp.abs(solve(jnp.eye(m) - last.jacobian[:, :m], jnp.eye(m)))
    sizes = _chain_rule(last, inverse @ jnp.abs(last.jacobian[:, m:]), jnp.abs)

    def error(slope: Scalar, other: Scalar, size: Scalar) -> Scalar:
        change = jnp.abs(slope - other)
        share = change / jnp.where(size == 0.0, 1.0, size)
        pooled = jnp.sqrt(jnp.mean(share * share, axis=-1, keepdims=True))
        return _SHARE * jnp.maximum(change, _POOLED * pooled * size)

    return jax.tree.map(error, slopes, looser, sizes)


def _radius_slopes(problem: FixedPointProblem, last: LinearisedReturn) -> Scalar:
    """Derivatives of the leading multiplier's absolute value, shape (p,).

    dλ = wᵀ (dP_x) v with left and right eigenvectors, dP_x along the orbits' family.
    """
    m = last.recurring.shape[0]
    jacobian = last.jacobian[:, :m]
    vector, left = _leading_eigenvectors(jacobian)
    value = left @ (jacobian.astype(vector.dtype) @ vector)
    # d|λ| is the real part of dλ in the direction of λ.
    weight = jnp.conj(value) * left
    leading = jnp.stack([vector.real, vector.imag])
    weights = jnp.stack([weight.real, -weight.imag]) / jnp.abs(value)
    family = slopes_of(last).recurring
    seeds, sizes = problem.directions(m)
    slopes = second_variation(
        problem.spec, seeds, problem.guess, last, leading, weights, family, sizes
    )
    # Second derivatives across a jump of the force itself would need more than its Jacobians'.
    return jnp.where(last.jumps > 0, jnp.nan, slopes)


def _each_of(spec: ReturnMapSpec, function: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """The function of each row: lanes take both at once; XLA would compute in lockstep."""
    return (
        jax.vmap(function) if spec.engine == "lanes" else lambda rows: jax.lax.map(function, rows)
    )


def _leading_eigenvectors(jacobian: Scalar) -> tuple[Scalar, Scalar]:
    """Right and left eigenvectors of the largest eigenvalue, wᵀ v = 1."""
    finite = jnp.all(jnp.isfinite(jacobian))
    found = eigensystem(jnp.where(finite, jacobian, jnp.eye(jacobian.shape[0])))
    largest = jnp.argmax(jnp.abs(found.values))
    return found.right[:, largest], found.left[largest]
