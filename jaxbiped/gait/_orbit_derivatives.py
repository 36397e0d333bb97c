"""Periodic orbit: its stability and its sensitivities.

The spectral radius is a function of the return map's Jacobian, so its sensitivities are second
derivatives of the map.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import RealScalarLike, Scalar
from jaxbiped.compiler import XLA
from jaxbiped.gait._fixed_point_search import (
    FixedPointProblem,
    Found,
    Search,
    crossings_of,
    with_looser,
)
from jaxbiped.gait._poincare_map import (
    PARAMETER_FLOOR,
    LinearisedReturn,
    linearised_return,
    recurring_indices,
    state_with,
)
from jaxbiped.gait._return_map_spec import ReturnMapSpec, has_switches
from jaxbiped.gait._stability import Stability, stability_of
from jaxbiped.hybrid._scales import recurring_inverse_units
from jaxbiped.linalg._small_matrices import eigensystem, solve
from jaxbiped.solve._accuracy import Precision
from jaxbiped.variational._adjoint_solve import Adjoints, carry_tangents, pull_back
from jaxbiped.variational._flow import Flow, tangent_on_section
from jaxbiped.variational._tangents import Seeded, active_leaves

CLOSENESS = 1e-3
"""Distance of a multiplier from the unit circle that is flagged as a bifurcation."""
_RADIUS_FLOOR = 2e-8
"""Error of the spectral radius's derivatives that no tolerance takes away, in units of the
parameter's size: of the switches' crossings, which second derivatives magnify."""
_VALUES = ("recurring", "period", "advance", "peak")
_ROWS_OF_VALUES = ("jacobian", "period_row", "advance_rows", "peak_row")
"""Of a return's leaves, values on the section, and their derivatives."""
_ROWS = (*_ROWS_OF_VALUES, "monodromy")
"""All those that are derivatives."""
_NOTHING = 1e-300
_POOLED = 0.7
"""Of what a looser solve changes on the whole, that every derivative is wrong by at least: see the
table in docs/gradients.md for how many then lie within their bars."""
_FLOOR = 0.3
"""Of the error up to which columns are solved however small they are, that derivatives have."""
_LOOSER_SHARE, _TURNED, _TURNED_TERMS = 1.5, 3.0, 0.01
"""Of what a looser solve changes in derivatives of the spectral radius, that they are wrong by; and
of a multiplier's error over its distance to the others, by which its eigenvectors are turned, that
they and their terms are: the largest of the three counts.

On 300 compliant gaits of random scenes at "draft", 4,484 of 4,485 such derivatives lay within their
bars, the worst 1.1 bars off, and the median bar was 66 times the error."""
_STEP = 0.2
"""Step of differences of Jacobians, in units of the fifth root of the tolerance."""


class Slopes(NamedTuple):
    """Derivatives of an orbit with respect to p parameters in units of their sizes (1 where zero).

    Attributes:
        recurring: derivatives of the m recurring components on the section, shape (m, p).
        period: derivatives of the period, shape (p,).
        advance: derivatives of the advance of the cyclic coordinates in a cycle, shape (d, p).
        peak: derivatives of the largest load, shape (p,).
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
    """What a search found, with derivatives with respect to parameters as well: its `columns`.

    The gait's own values and multipliers stay those of the search, whatever is asked for. At few
    steps most of the derivatives' error is that of the gait's place. So they are taken at Newton's
    next correction, and those of the witness as far from there as the looser solve's fixed point
    is: some ten times the error of the place that is left, as its steps have ten times the error.
    Of parameters nothing is claimed (NaN) where the search did not converge, or where a solve with
    these columns does not come to the end.
    """
    m = found.recurring.shape[0]
    own = found.both._replace(**{name: getattr(found.both, name)[..., :m] for name in _ROWS})
    if not problem.active:
        return found._replace(both=own)
    seeds, _ = problem.directions(m)
    idle = found.ending == int(Search.NO_RETURN)
    lost = idle | (found.ending == int(Search.NOT_CONVERGED))
    spec = problem.spec.with_more_steps()
    near = crossings_of(found.coarse, problem.spec.system.cyclic_coordinates)[0]
    changes = jnp.stack([found.last.recurring - found.recurring, found.coarse.recurring - near])
    correction, looser = solve(jnp.eye(m) - found.last.jacobian[:, :m], changes.T).T
    looser = near - found.recurring + looser
    # On the other side than the looser map's fixed point, where a search may have ended.
    off = jnp.stack([correction, 2.0 * correction - looser])
    off = jnp.where(lost | ~jnp.isfinite(off), 0.0, off)

    def once(given: tuple[Precision, Scalar]) -> LinearisedReturn:
        precision, place = given
        return linearised_return(spec, seeds, problem.state(place), precision, idle)

    new = _each_of(spec, once)((with_looser(problem.precision), found.recurring + off))

    def known(name: str) -> Scalar:
        every = getattr(new, name)
        unknown = jnp.reshape(lost | (new.code != 0), (-1, *[1] * (every.ndim - 1)))
        return jnp.where(unknown, jnp.nan, every)

    seen: dict[str, Any] = {
        name: jnp.maximum(getattr(own, name), getattr(new, name)) for name in ("jumps", "grazes")
    }
    columns = new._replace(**{name: known(name) for name in _ROWS}, **seen)
    return found._replace(both=own._replace(**seen), columns=columns)


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
    slopes = slopes_of(found.fine)
    _, sizes = problem.directions(m)
    units = 1.0 / recurring_inverse_units(problem.args, m)
    least = jnp.asarray(problem.precision.tangent_rtol) * PARAMETER_FLOOR * units
    errors = _slope_errors(found, slopes, least)
    radius_slopes = radius_errors = jnp.full(len(problem.active), jnp.nan)
    if radius and problem.active:
        slopes_of_radius = functools.partial(_radius_slopes, problem, least)
        rows = found.columns, with_looser(problem.precision)
        both, terms, own = _each_of(problem.spec, slopes_of_radius)(rows)
        radius_slopes, radius_errors = both[0], own[0] + _radius_errors(both, terms[0], stability)
        if has_switches(problem.spec.system, problem.args, problem.guess):
            radius_errors = jnp.maximum(radius_errors, _RADIUS_FLOOR)
    return Orbit(found, state, stability, slopes, errors, radius_slopes, radius_errors, sizes)


def slopes_of(last: LinearisedReturn) -> Slopes:
    """x(p) = P(x(p), p) differentiated: dx = (I − P_x)⁻¹ P_p, and all else by the chain rule.

    Args:
        last: a return to where it began, with p directions of parameters.

    Returns:
        Derivatives of the orbit, in units of the parameters' sizes; NaN if it grazes a switch,
        because they differ on the two sides.
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


def _slope_errors(found: Found, slopes: Slopes, least: Scalar) -> Slopes:
    """What a looser solve changes and what one by other steps does, and no less than a floor.

    Where a single derivative is hardly changed that is chance: terms that make it up are as
    uncertain as others'. So the changes are pooled, each relative to the sum of its terms without
    their signs. The floor is what errors of the components, `least`, shape (m,), make of all else:
    the solve holds columns to no less. By other steps, and where the search ended, are the
    search's own derivatives with respect to the components.
    """
    fine, m = found.fine, found.recurring.shape[0]
    pairs = {name: (getattr(found.last, name), getattr(fine, name)) for name in _ROWS}
    searched: dict[str, Any] = {
        name: jnp.concatenate([own[..., :m], by_all[..., m:]], axis=-1)
        for name, (own, by_all) in pairs.items()
    }

    def change(other: LinearisedReturn) -> Slopes:
        return jax.tree.map(lambda a, b: jnp.abs(a - b), slopes, slopes_of(other))

    sizes = _chain_rule(fine, _term_sizes(fine), jnp.abs)
    floors = jax.tree.map(lambda leaf: leaf[..., None], _spread(fine, least))
    parts = _pooled(change(found.loose), sizes, floors), change(fine._replace(**searched)), floors
    return jax.tree.map(lambda a, b, floor: a + b + _FLOOR * floor, *parts)


def _pooled(changes: PyTree, sizes: PyTree, floors: PyTree) -> PyTree:
    """Changes of quantities by p parameters, leaves (…, p), and no less than by chance.

    That is a share of what those of the same quantity are on the whole, and as much more as those
    by the same parameter are than all: relative to `sizes`, and to `floors` where these are
    larger, as of what the section holds.
    """

    def share(change: Scalar, size: Scalar, floor: Scalar) -> Scalar:
        return change / jnp.where(size + floor == 0.0, 1.0, size + floor)

    shares = jax.tree.map(share, changes, sizes, floors)
    every = jnp.concatenate([jnp.atleast_2d(leaf) for leaf in jax.tree.leaves(shares)])
    # A quantity without derivatives, as a peak beside a jump may be, tells nothing of the others.
    by_parameter = _root_mean_square(jnp.where(jnp.isfinite(every), every, 0.0), axis=0)
    more = by_parameter / (_root_mean_square(by_parameter) + _NOTHING)

    def pooled(change: Scalar, share: Scalar, size: Scalar) -> Scalar:
        expected = _root_mean_square(share)[..., None] * jnp.maximum(_POOLED, more)
        return jnp.maximum(change, expected * size)

    return jax.tree.map(pooled, changes, shares, sizes)


def _root_mean_square(values: Scalar, axis: int = -1) -> Scalar:
    return jnp.sqrt(jnp.mean(values * values, axis=axis))


def change_terms(
    last: LinearisedReturn, looser: LinearisedReturn, cyclic: tuple[int, ...] = (0,)
) -> Slopes:
    """What a looser solve changes in an orbit: its terms without signs, `Slopes` of one axis less.

    It need not begin where the other does: what that changes is taken off to first order.
    """
    m = last.recurring.shape[0]
    apart = crossings_of(looser, cyclic)[0] - crossings_of(last, cyclic)[0]

    def change(value: str, row: str) -> Scalar:
        moved = getattr(last, value) + getattr(last, row)[..., :m] @ apart
        return jnp.abs(moved - getattr(looser, value))

    recurring, period, advance, peak = map(change, _VALUES, _ROWS_OF_VALUES)
    own = Slopes(jnp.zeros_like(recurring), period, advance, peak)
    return jax.tree.map(jnp.add, own, _spread(last, recurring))


def _spread(last: LinearisedReturn, errors: Scalar) -> Slopes:
    """What errors of a return's m components, without signs, make of the orbit and of all else."""
    m = last.recurring.shape[0]
    reach = _inverse_size(last) @ errors
    rows = (last.period_row, last.advance_rows, last.peak_row)
    return Slopes(reach, *(jnp.abs(row[..., :m]) @ reach for row in rows))


def _radius_errors(both: Scalar, terms: Scalar, stability: Stability) -> Scalar:
    """Of derivatives of the spectral radius: what a looser solve changes, or what errors of the
    eigenvectors make of the derivatives or of their terms without signs."""
    multipliers = stability.multipliers
    apart = jnp.min(jnp.abs(multipliers[1:] - multipliers[0]), initial=jnp.inf)
    turned = stability.errors[0] / jnp.maximum(apart, _NOTHING)
    slopes, looser = both
    changes = _LOOSER_SHARE * _pooled(jnp.abs(slopes - looser), terms, 0.0)
    sizes = jnp.maximum(_TURNED * jnp.abs(slopes), _TURNED_TERMS * terms)
    return jnp.maximum(changes, turned * sizes)


def _radius_slopes(
    problem: FixedPointProblem, least: Scalar, solved: tuple[LinearisedReturn, Precision]
) -> tuple[Scalar, Scalar, Scalar]:
    """Derivatives of the leading multiplier's absolute value, their terms without signs, and errors
    of differences and of the orbit's derivatives, which are solved to no less than `least`, (p,).

    dλ = wᵀ (dP_x) v with left and right eigenvectors, dP_x along the orbits' family.
    """
    last, precision = solved
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
    found = second_variation(
        problem.spec, seeds, problem.guess, last, leading, weights, family, sizes, precision
    )
    by_point = jnp.abs(found.by_point)
    terms = by_point @ _term_sizes(last) + jnp.abs(found.by_parameter)
    floor = _FLOOR * by_point @ _inverse_size(last) @ least
    return found.slopes, terms, jnp.broadcast_to(found.errors + floor, found.slopes.shape)


def _term_sizes(last: LinearisedReturn) -> Scalar:
    """Of the recurring components' derivatives: the sum of their terms without signs, (m, p)."""
    return _inverse_size(last) @ jnp.abs(last.jacobian[:, last.recurring.shape[0] :])


def _inverse_size(last: LinearisedReturn) -> Scalar:
    """Entries of (I − P_x)⁻¹ without signs, (m, m)."""
    m = last.recurring.shape[0]
    return jnp.abs(solve(jnp.eye(m) - last.jacobian[:, :m], jnp.eye(m)))


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


class SecondVariation(NamedTuple):
    """Second derivatives along p directions, as weighted sums.

    Attributes:
        slopes: the sums, shape (p,).
        by_point: what they have by each of the m recurring components, shape (m,).
        by_parameter: what they have by each parameter itself, moved by its size, shape (p,).
        errors: of differences across a force that jumps or is steep, shape (p,); zero elsewhere.
    """

    slopes: Scalar
    by_point: Scalar
    by_parameter: Scalar
    errors: RealScalarLike = 0.0


def second_variation(
    spec: ReturnMapSpec,
    args: Seeded,
    like: PyTree,
    last: LinearisedReturn,
    leading: Scalar,
    weights: Scalar,
    tangents: Scalar,
    sizes: Scalar,
    precision: Precision,
) -> SecondVariation:
    """Second derivatives of the return map along two sets of directions, as weighted sums.

    An adjoint: the leading tangents go along the cycle, the sum's derivatives with respect to what
    it starts from come back, whatever the number of parameters. Where second derivatives are not
    followed, across a switch that resets the state or where the force jumps or is infinitely steep,
    differences of first ones, by lanes alone. NaN where they are not known.

    Args:
        spec: of the return map.
        args: parameters.
        like: a state, for its structure.
        last: the return, with its nodes.
        leading: v directions of the m recurring components, those of the leading eigenpair, which
            move no parameter; (v, m).
        weights: of each one's second derivatives, of the recurring components or all, (v, m or c).
        tangents: p other directions, each of which moves one active parameter, shape (m, p).
        sizes: by how much, shape (p,).
        precision: of the return.

    Returns:
        For each of the p the sum over components and the v.
    """
    engine = XLA if spec.programs is None else spec.programs
    watch = spec.watch(args.args, like)
    assert watch.section is not None
    if has_switches(spec.system, args.args, like, "first_only"):
        if spec.engine == "xla":  # which would compile another solve, for minutes
            unknown = jnp.full(len(sizes), jnp.nan)
            return SecondVariation(unknown, jnp.zeros(len(tangents)), unknown)
        return _by_differences(spec, args, like, last, leading, weights, tangents, precision)
    field = spec.system.vector_field
    flow = Flow(spec.system, watch.section, field, args, jtu.tree_structure(like))
    places = jnp.asarray(recurring_indices(spec.system, like))
    c, p = flow.structure.num_leaves, len(args.active)
    parameters = jnp.stack([jnp.asarray(leaf) for leaf in active_leaves(args)])
    along, carried = jnp.zeros((len(leading), c)).at[:, places].set(leading), []
    for k in range(spec.steps):
        nodes = jax.tree.map(lambda leaf, k=k: leaf[k], last.nodes)
        arrived, steps = carry_tangents(engine, flow, nodes, along)
        carried.append((nodes, arrived, steps))
        if k + 1 < spec.steps:
            along = _behind_arrival(flow, nodes.arrival, parameters, arrived.leading)
    if weights.shape[1] != c:
        weights = jnp.zeros((len(weights), c)).at[:, places].set(weights)
    adjoints = Adjoints(weights, jnp.zeros(c), jnp.zeros(p))
    for nodes, arrived, steps in reversed(carried):
        adjoints = pull_back(engine, flow, nodes, arrived, steps, adjoints)
    by_point, by_parameter = adjoints.family[places], adjoints.parameters * sizes
    slopes = jnp.where(last.jumps > 0, jnp.nan, by_point @ tangents + by_parameter)
    return SecondVariation(slopes, by_point, by_parameter)


def _by_differences(
    spec: ReturnMapSpec,
    args: Seeded,
    like: PyTree,
    last: LinearisedReturn,
    leading: Scalar,
    weights: Scalar,
    tangents: Scalar,
    precision: Precision,
) -> SecondVariation:
    """The same from differences of Jacobians along the leading directions, of which there are few:
    second derivatives are symmetric.
    """
    m, c = len(tangents), weights.shape[1]
    pair, h = _jacobian_slopes(spec, args, like, last, leading, precision)
    both = jnp.einsum("vc,ovcn->on", weights, pair[:, :, -c:])
    by_point, by_parameter = both[0, :m], both[0, m:]
    slopes, rougher = both[:, :m] @ tangents + both[:, m:]
    errors: RealScalarLike = 0.0
    if not has_switches(spec.system, args.args, like, "resets"):
        # Between resets a motion is smooth; a force that jumps makes the Jacobians' errors rough.
        own = jnp.abs(jnp.concatenate([last.advance_rows, last.jacobian])[-c:])
        sizes = jnp.einsum("vc,cn,v->n", jnp.abs(weights), own, 1.0 / h)
        size = sizes[:m] @ jnp.abs(tangents) + sizes[m:]
        errors = jnp.abs(slopes - rougher) + precision.tangent_rtol * size
    return SecondVariation(slopes, by_point, by_parameter, errors)


def _jacobian_slopes(
    spec: ReturnMapSpec,
    args: Seeded,
    like: PyTree,
    last: LinearisedReturn,
    leading: Scalar,
    precision: Precision,
) -> tuple[Scalar, Scalar]:
    """Derivatives of the Jacobian's rows along v directions, of two orders, shape (2, v, c, n), and
    the steps of their differences, shape (v,).

    Central differences of order four, whose step balances their error and the solve's, and of two.
    """
    size = jnp.max(jnp.abs(leading), axis=1)
    h = _STEP * jnp.power(precision.rtol, 0.2) / jnp.maximum(1.0, size)

    def rows(along: Scalar, share: Scalar) -> Scalar:
        state = state_with(spec.system, like, last.recurring + share * along)
        # A real eigenvector has no imaginary part to go along.
        idle = ~jnp.any(along != 0.0)
        once = linearised_return(spec.with_more_steps(), args, state, precision, idle)
        found = jnp.concatenate([once.advance_rows, once.jacobian])
        return jnp.where(idle, 0.0, jnp.where(once.code != 0, jnp.nan, found))

    shares = h[:, None] * jnp.array([1.0, -1.0, 2.0, -2.0])
    each = jax.vmap(jax.vmap(rows, (None, 0)))(leading, shares)
    near, back, far, farther = jnp.moveaxis(each, 1, 0)
    pair = (8.0 * (near - back) - (far - farther)) / 12.0, (near - back) / 2.0
    return jnp.stack(pair) / h[:, None, None], h


def _behind_arrival(flow: Flow, arrival: Scalar, parameters: Scalar, leading: Scalar) -> Scalar:
    """Leading tangents (v, c) on the section, behind the reset: maps from arrival to arrival are
    composed, so that the reset need be no symmetry of the motion."""
    z = jnp.concatenate([flow.earlier(arrival, parameters)[1:], parameters])

    def behind(tangent: Scalar) -> Scalar:
        along = jnp.concatenate([tangent, jnp.zeros_like(parameters)])
        return jax.jvp(flow.reset, (z,), (tangent_on_section(flow, z, along),))[1]

    return jax.vmap(behind)(leading)
