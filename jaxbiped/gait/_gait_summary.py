"""Summary of a search as a gait: measures, derivatives and errors of its orbit; step lengths."""

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.compiler import host_jit
from jaxbiped.dynamics._contacts import feet
from jaxbiped.dynamics._footfalls import FootMotion, landings, standing_leg, touches
from jaxbiped.dynamics._state import recurring_leaves, state_of_recurring
from jaxbiped.dynamics._surfaces import foot_ahead
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
from jaxbiped.scene._structure import Structure

_NOTHING = 1e-9
"""A measure (SI units) that is zero but for the solve's error has no elasticity."""
_CHANGE_SHARE, _TERMS_SHARE = 1.0, 0.08
"""What a measure's error has of its change by a looser solve, and of that change's terms at least.

With both, on 60 rigid gaits of random scenes all of 240 measures lay within their bars, and the
median bar was 8 times the error. So did all of 25 compliant gaits', at 24 times."""
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
    orbit = orbit_of(problem, found, radius=radius)
    stability = orbit.stability
    last, m = found.last, found.recurring.shape[0]
    structure = problem.args.mechanism.structure
    lost = found.ending == int(Search.NO_RETURN)

    def known(tree: PyTree) -> PyTree:
        """NaN where no cycle was ever completed."""
        return jtu.tree_map(lambda leaf: jnp.where(lost, jnp.nan, leaf), tree)

    measures = Measures(
        period=last.period,
        step_length=last.advance[0],
        speed=last.advance[0] / last.period,
        peak_normal=last.peak,
        spectral_radius=stability.spectral_radius,
        state=orbit.state,
    )
    measures = known(measures)._replace(state=orbit.state)
    slopes = measure_slopes(orbit, measures, orbit.slopes, orbit.radius_slopes)
    backwards = speed_backwards(measures)
    slope_errors = measure_slopes(orbit, backwards, orbit.slope_errors, orbit.radius_errors)
    errors = measure_errors(measures, orbit)
    rows = jnp.concatenate([last.jacobian, last.period_row[None], last.advance_rows])
    told = dict(
        measure_errors=errors,
        multipliers=stability.multipliers,
        multiplier_errors=stability.errors,
        directions=stability.directions,
        monodromy=last.monodromy[:, :m],
        step_lengths=step_lengths(problem, last, path[1]),
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
        * minimal_cycle(last, off, problem.precision.rtol),
        sound=found.sound,
        origin=jtu.tree_map(jnp.asarray, origin),
        orbit=path,
        parameters=names,
        engine=problem.spec.engine,
        cycle="stride" if len(structure.namings) == 1 else "step",
        quantities=tuple(map(parameter_quantities(problem.args).__getitem__, names)),
    )


def measure_errors(measures: Measures, orbit: Orbit) -> Measures:
    """What Newton's last correction and a looser solve change in the measures.

    A looser solve may change a measure little by chance, but not the terms of that change, taken
    without their signs.
    """
    last, coarse = orbit.found.last, orbit.found.coarse
    fine, loose = (_at_fixed_point(each, orbit) for each in (last, coarse))
    radius, backwards = orbit.stability.errors[0], speed_backwards(measures)
    terms = measure_slopes(orbit, backwards, change_terms(last, coarse), radius)

    def error(told: Scalar, fine: Scalar, loose: Scalar, terms: Scalar) -> Scalar:
        change = _CHANGE_SHARE * (jnp.abs(told - fine) + jnp.abs(fine - loose))
        return jnp.maximum(change, _TERMS_SHARE * terms) + _ROUNDING * jnp.abs(told)

    errors = jtu.tree_map(error, measures, fine, loose, terms)
    return errors._replace(spectral_radius=radius)


def speed_backwards(measures: Measures) -> Measures:
    """For errors: those of length and period add up in the speed's, whatever their signs."""
    return measures._replace(speed=-jnp.abs(measures.speed))


def _at_fixed_point(once: LinearisedReturn, orbit: Orbit) -> Measures:
    """Measures of a return, linearly extrapolated to its own fixed point."""
    m = orbit.found.recurring.shape[0]
    begun = crossings_of(once)[0]
    correction = solve(jnp.eye(m) - once.jacobian[:, :m], once.recurring - begun)
    period = once.period + once.period_row[:m] @ correction
    length = once.advance[0] + once.advance_rows[0, :m] @ correction
    peak = once.peak + once.peak_row[:m] @ correction
    state = state_of_recurring(type(orbit.state), begun + correction, jnp.zeros_like(period))
    return Measures(period, length, length / period, peak, orbit.stability.spectral_radius, state)


def measure_slopes(orbit: Orbit, measures: Measures, slopes: Slopes, radius: Scalar) -> Measures:
    """Derivatives of the measures with respect to parameters in their own sizes, shape (p,)."""
    length, period = slopes.advance[0], slopes.period
    speed = (length - measures.speed * period) / measures.period
    state = state_of_recurring(type(measures.state), slopes.recurring, jnp.zeros_like(period))
    return Measures(period, length, speed, slopes.peak, radius, state)


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


def step_lengths(problem: FixedPointProblem, last: LinearisedReturn, states: PyTree) -> Scalar:
    """Distances between the places of successive heel strikes in a cycle [m], shape (footsteps,).

    The first one is from the last strike of the cycle before. Rigid feet: of the standing foot's
    places just after the strikes.
    """
    mechanism = problem.args.mechanism
    structure, steps = mechanism.structure, problem.spec.steps
    count = steps * problem.args.arrival_footsteps
    if count == 1:
        return last.advance
    if not problem.args.compliant:
        begins = jtu.tree_map(lambda x: x[:, 0], states)
        ahead = jax.vmap(lambda y: foot_ahead(problem.args, y))(begins)
        return _distances(jtu.tree_leaves(begins)[0] + ahead, last.advance)
    scene = problem.args.minimal
    found = jax.vmap(jax.vmap(lambda y: feet(scene, y)))(states)
    before = jtu.tree_map(lambda x: x[:, :-1], found)
    after = jtu.tree_map(lambda x: x[:, 1:], found)
    lands = jnp.stack(landings(structure, before, after))
    places = jnp.stack([_place_of_strike([after[k] for k in leg]) for leg in structure.feet_of_leg])
    lands, places = (_in_names_of_start(structure, each) for each in (lands, places))
    stands = standing_leg(structure, jtu.tree_map(lambda x: x[0, 0], found))
    return _distances(_first_strikes(lands, places, stands - 1, count), last.advance)


def _place_of_strike(feet_of_leg: list[FootMotion]) -> Scalar:
    """Where the first of a leg's feet that touches is [m]."""
    *others, place = [foot.x for foot in feet_of_leg]
    for foot, own in zip(reversed(feet_of_leg[:-1]), reversed(others), strict=True):
        place = jnp.where(touches(foot), own, place)
    return place


def _in_names_of_start(structure: Structure, values: Scalar) -> Scalar:
    """Values of legs, shape (legs, arrivals, nodes), as (legs, all nodes).

    Names are exchanged at each arrival.
    """
    every = [
        jnp.stack([values[k, i] for k in structure.legs_renamed(i)]) for i in range(values.shape[1])
    ]
    return jnp.concatenate(every, axis=1)


def _first_strikes(lands: Scalar, places: Scalar, stands: Scalar, count: int) -> Scalar:
    """Places of the first footsteps, shape (count,); NaN where there are fewer.

    A landing is one where another leg made the one before; at first `stands` is that leg's number,
    −1 for none.
    """
    legs, n = lands.shape
    number, node = jnp.arange(legs)[:, None], jnp.arange(n)
    found, at = [], jnp.asarray(-1)
    for _ in range(count):
        ahead = lands & (node > at)
        if legs > 1:
            ahead &= number != stands
        at = jnp.min(jnp.where(ahead, node, n))
        here = ahead & (node == at)
        stands = jnp.max(jnp.where(here, number, -1))
        found.append(jnp.where(at < n, jnp.max(jnp.where(here, places, -jnp.inf)), jnp.nan))
    return jnp.stack(found)


def _distances(places: Scalar, advance: Scalar) -> Scalar:
    return places - jnp.concatenate([places[-1:] - advance, places[:-1]])
