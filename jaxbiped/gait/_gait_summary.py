"""Summary of a search as a gait: measures, derivatives and errors of its orbit."""

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.compiler import host_jit
from jaxbiped.dynamics._state import recurring_leaves, state_of_recurring
from jaxbiped.gait._fixed_point_search import (
    FixedPointProblem,
    Found,
    Search,
    crossings_of,
    minimal_cycle,
    search_by_lanes,
)
from jaxbiped.gait._gait import Gait, Measures
from jaxbiped.gait._orbit_derivatives import (
    Orbit,
    Slopes,
    change_terms,
    orbit_of,
    with_parameter_columns,
)
from jaxbiped.gait._poincare_map import LinearisedReturn
from jaxbiped.gait._search_provenance import Origin
from jaxbiped.gait._stability import Bifurcation
from jaxbiped.linalg._small_matrices import solve
from jaxbiped.scene._parameter_access import parameter_quantities

_NOTHING = 1e-9
"""A measure (SI units) that is zero but for the solve's error has no elasticity."""
_TERMS_SHARE = 0.2
"""What a measure's error has at least of the terms of its change by a looser solve."""
_ROUNDING = 1e-15
"""Relative error that no tolerance takes away."""


@host_jit(search_by_lanes)
def summarise_gait(
    problem: FixedPointProblem, found: Found, names: tuple[str, ...], radius: bool, origin: Origin
) -> Gait:
    """The gait that a search found, with its stability and its derivatives.

    They are those with respect to the problem's active parameters, whose names are given; `radius`
    tells whether the spectral radius is differentiated, and `origin` how the search came to it.
    """
    path = nodes_of(found.last, problem.guess)  # of the search, whose steps are counted
    found = with_parameter_columns(problem, found)
    return summary_of(problem, orbit_of(problem, found, radius=radius), path, names, origin)


def summary_of(
    problem: FixedPointProblem, orbit: Orbit, path: PyTree, names: tuple[str, ...], origin: Origin
) -> Gait:
    """The gait of an orbit, whose nodes are given as `nodes_of` has them."""
    found, stability = orbit.found, orbit.stability
    last, m, spec = found.last, found.recurring.shape[0], problem.spec
    lost = found.ending == int(Search.NO_RETURN)

    def known(tree: PyTree) -> PyTree:
        """NaN where no cycle was ever completed."""
        return jtu.tree_map(lambda leaf: jnp.where(lost, jnp.nan, leaf), tree)

    measures = _measures(
        problem, last.period, last.advance, last.peak, stability.spectral_radius, orbit.state
    )
    measures = known(measures)._replace(state=orbit.state)
    slopes = measure_slopes(orbit, measures, orbit.slopes, orbit.radius_slopes)
    backwards = speed_backwards(measures)
    slope_errors = measure_slopes(orbit, backwards, orbit.slope_errors, orbit.radius_errors)
    errors = measure_errors(problem, measures, orbit)
    rows = jnp.concatenate([last.jacobian, last.period_row[None], last.advance_rows])
    told = dict(
        measure_errors=errors,
        multipliers=stability.multipliers,
        multiplier_errors=stability.errors,
        directions=stability.directions,
        monodromy=last.monodromy[:, :m],
        step_lengths=spec.system.step_lengths(problem.args, path[1], last.advance, spec.steps),
        return_jacobian=rows[:, :m],
        unit_multiplier_error=stability.unit_error,
        sensitivities=jtu.tree_map(lambda leaf: leaf / orbit.sizes, slopes),
        sensitivity_errors=jtu.tree_map(lambda leaf: leaf / jnp.abs(orbit.sizes), slope_errors),
        elasticities=elasticities_of(problem, measures, slopes),
    )
    off = jnp.stack(recurring_leaves(errors.state))
    is_found = found.ending == int(Search.FOUND)
    return Gait(
        **known(told),
        ending=found.ending,
        walk_ending=found.code,
        measures=measures,
        residual=found.residual,
        bifurcation=jnp.where(is_found, stability.bifurcation, int(Bifurcation.NONE)),
        evaluations=found.evaluations,
        history=found.history,
        solver_steps=last.attempted,
        grazes=last.grazes,
        cycle_footsteps=problem.args.arrival_footsteps
        * minimal_cycle(last, off, problem.precision.rtol, spec.system.cyclic_coordinates),
        sound=found.sound,
        origin=jtu.tree_map(jnp.asarray, origin),
        orbit=path,
        parameters=names,
        engine=problem.spec.engine,
        cycle=problem.args.cycle,
        endings=problem.args.endings,
        quantities=tuple(map(parameter_quantities(problem.args).__getitem__, names)),
    )


def measure_errors(problem: FixedPointProblem, measures: Measures, orbit: Orbit) -> Measures:
    """What Newton's last correction and a looser solve change in the measures.

    A looser solve may change one measure little by chance, but not period, length, speed and peak
    alike: relative to the terms of its change, taken without their signs, each error is at least
    what it changes in these four (root mean square), and a fifth. On 430 rigid gaits of random
    scenes at "draft", 1,707 of 1,720 measures lay within their bars (the worst 2.0 bars off), and
    all of 240 of 60 compliant ones; the fifth alone held 1,701, in the median as wide.
    """
    last, coarse = orbit.found.last, orbit.found.coarse
    fine, loose = (_at_fixed_point(problem, each, orbit) for each in (last, coarse))
    radius, backwards = orbit.stability.errors[0], speed_backwards(measures)
    terms = measure_slopes(
        orbit, backwards, change_terms(last, coarse, problem.spec.system.cyclic_coordinates), radius
    )

    changes = jtu.tree_map(lambda a, b: jnp.abs(a - b), fine, loose)
    four = zip(*map(jtu.tree_leaves, (changes[:4], terms[:4])), strict=True)
    shares = jnp.stack([each / jnp.where(size > 0.0, size, jnp.inf) for each, size in four])
    pooled = jnp.maximum(jnp.sqrt(jnp.mean(shares * shares)), _TERMS_SHARE)

    def error(told: Scalar, fine: Scalar, change: Scalar, terms: Scalar) -> Scalar:
        least = _ROUNDING * jnp.abs(told)
        return jnp.maximum(jnp.abs(told - fine) + change, pooled * terms) + least

    errors = jtu.tree_map(error, measures, fine, changes, terms)
    return errors._replace(spectral_radius=radius)


def _measures(
    problem: FixedPointProblem,
    period: Scalar,
    advance: Scalar,
    peak: Scalar,
    radius: Scalar,
    state: PyTree,
) -> Measures:
    """Measures of a cycle; None for what its system has not."""
    length = advance[0] if len(advance) else None
    speed = None if length is None else length / period
    return Measures(period, length, speed, peak if problem.loaded else None, radius, state)


def speed_backwards(measures: Measures) -> Measures:
    """For errors: those of length and period add up in the speed's, whatever their signs."""
    return measures._replace(speed=jax.tree.map(lambda speed: -jnp.abs(speed), measures.speed))


def _at_fixed_point(problem: FixedPointProblem, once: LinearisedReturn, orbit: Orbit) -> Measures:
    """Measures of a return, linearly extrapolated to its own fixed point."""
    m = orbit.found.recurring.shape[0]
    begun = crossings_of(once, problem.spec.system.cyclic_coordinates)[0]
    correction = solve(jnp.eye(m) - once.jacobian[:, :m], once.recurring - begun)
    period = once.period + once.period_row[:m] @ correction
    advance = once.advance + once.advance_rows[:, :m] @ correction
    peak = once.peak + once.peak_row[:m] @ correction
    state = state_of_recurring(type(orbit.state), begun + correction, jnp.zeros_like(period))
    radius = orbit.stability.spectral_radius
    return _measures(problem, period, advance, peak, radius, state)


def measure_slopes(orbit: Orbit, measures: Measures, slopes: Slopes, radius: Scalar) -> Measures:
    """Derivatives of the measures with respect to parameters in their own sizes, shape (p,)."""
    period, peak = slopes.period, None if measures.peak_normal is None else slopes.peak
    length = speed = None
    if measures.speed is not None:
        length = slopes.advance[0]
        speed = (length - measures.speed * period) / measures.period
    state = state_of_recurring(type(measures.state), slopes.recurring, jnp.zeros_like(period))
    return Measures(period, length, speed, peak, radius, state)


def elasticities_of(problem: FixedPointProblem, measures: Measures, slopes: Measures) -> Measures:
    leaves, active = jtu.tree_leaves(problem.args), problem.active
    zero = (jnp.stack([leaves[i] for i in active]) if active else jnp.zeros(0)) == 0.0

    def relative(value: Scalar, slope: Scalar) -> Scalar:
        return jnp.where(zero, 0.0, jnp.where(jnp.abs(value) < _NOTHING, jnp.nan, slope / value))

    return jax.tree.map(relative, measures, slopes)


def nodes_of(last: LinearisedReturn, like: PyTree) -> tuple[Scalar, PyTree]:
    """Times and states of a cycle's nodes, leaves of shape (arrivals, nodes); NaN beyond them."""
    nodes = last.nodes
    assert nodes is not None
    times, *states = jax.vmap(lambda ends, start: ends.columns(start))(nodes.ends, nodes.start)
    return times, jtu.tree_unflatten(jtu.tree_structure(like), states)
