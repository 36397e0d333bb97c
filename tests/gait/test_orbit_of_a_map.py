"""Newton's method, sensitivities and errors of orbits, against maps that are written down."""

from types import SimpleNamespace
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped import Gait
from jaxbiped.gait import LinearisedReturn, Measures, _orbit_derivatives, slopes_of
from jaxbiped.gait._accurate_gait import judge_gait
from jaxbiped.gait._fixed_point_search import (
    FixedPointProblem,
    Found,
    walks_only,
)
from jaxbiped.gait._gait_measures import _by_correction
from jaxbiped.gait._gait_summary import elasticities_of, measure_errors, measure_slopes
from jaxbiped.gait._newton import Method, Stage, initial_progress, newton_iteration
from jaxbiped.gait._orbit_derivatives import SecondVariation
from jaxbiped.gait._return_map_spec import return_map_spec
from jaxbiped.solve._accuracy import Precision
from jaxbiped.variational._solve_to_section import Nodes
from jaxbiped.variational._tangents import Seeded
from tests.systems import map_of
from tests.variational.test_grazing import ABOVE, PULL, PUSH, Pulled
from tests.variational.test_grazing import start as pulled_from

P = np.array([0.7, -0.4])
TURN = np.array([[0.5, -0.6, 0.1], [0.6, 0.4, 0.0], [0.2, 0.1, 0.3]])
"""With a complex leading pair."""
LEAST = 1e-3 * jnp.array([1.0, 2.0, 4.0])
SHEAR = np.array([[0.8, 0.3, 0.0], [0.0, 0.2, 0.1], [0.1, 0.0, 0.3]])


class Triple(NamedTuple):
    """A state of one cyclic and three recurring components."""

    hip_x: jax.Array
    theta_1: jax.Array
    omega_1: jax.Array
    omega_2: jax.Array


def returned(linear, x, p):
    """Where (x, p) returns to; period, advance and peak."""
    curve = jnp.stack([0.1 * x[0] * x[1], 0.05 * x[2] ** 2, -0.1 * x[0] ** 2])
    push = jnp.stack([p[0], p[0] * p[1], p[1]])
    at = linear @ x + curve * (1.0 + p[1]) + 0.2 * push
    return at, 1.0 + x @ x + p[0] ** 2, 2.0 + x[1] * p[1], 3.0 + x[0] - p[0]


def fixed_point(linear, p):
    x = np.zeros(3)
    for _ in range(9):
        once = linearised(linear, x, p)
        slope = np.asarray(once.jacobian)[:, :3] - np.eye(3)
        x = x - np.linalg.solve(slope, np.asarray(once.recurring) - x)
    return x


@jax.jit
def linearised(linear, x, p):
    """A return from x, in units of the parameters."""
    at, *rest = returned(linear, x, p)
    slopes = jax.jacfwd(returned, argnums=(1, 2))(linear, x, p)
    rows = [jnp.concatenate([by_x, by_p * p], axis=-1) for by_x, by_p in slopes]
    period, advance, peak = rest
    no, zero = jnp.asarray(0), jnp.zeros(())
    start = jnp.concatenate([jnp.zeros(2), x])[None]
    return LinearisedReturn(
        at, rows[0], rows[0], at, period, rows[1], advance[None], rows[2][None], peak, rows[3],
        no, no, no, no, Nodes(start, None, start, zero),
    )  # fmt: skip


def measures(linear, p):
    x = fixed_point(linear, p)
    once = linearised(linear, x, p)
    radius = np.abs(np.linalg.eigvals(np.asarray(once.jacobian)[:, :3])).max()
    period, length = float(once.period), float(once.advance[0])
    return np.array([*x, period, length, length / period, once.peak, radius])


def differences(linear):
    """Derivatives of `measures` with respect to the parameters, in their own sizes."""
    h = 1e-5
    steps = np.diag(h * P)
    ends = [(measures(linear, P + d), measures(linear, P - d)) for d in steps]
    return np.stack([(a - b) / (2.0 * h) for a, b in ends], axis=1)


@pytest.mark.parametrize("linear", [TURN, SHEAR], ids=["complex", "real"])
def test_sensitivities_are_differences_of_fixed_points(linear, monkeypatch):
    x = jnp.asarray(fixed_point(linear, P))

    def second_variation(spec, args, like, last, leading, weights, family, sizes, _):
        """What the adjoint solve gives, of this map."""

        def jacobian(x, p):
            return jax.jacfwd(returned, argnums=1)(linear, x, p)[0]

        def summed(dx, dp):
            along = jax.jvp(jacobian, (x, P), (dx, dp))[1]
            return jnp.einsum("vi,ij,vj->", weights, along, leading)

        by_point = jax.vmap(lambda dx: summed(dx, 0.0 * P))(jnp.eye(3))
        by_parameter = jax.vmap(lambda dp: summed(0.0 * x, dp))(jnp.diag(P))
        return SecondVariation(by_point @ family + by_parameter, by_point, by_parameter)

    monkeypatch.setattr(_orbit_derivatives, "second_variation", second_variation)
    zero = jb.State(*[0.0] * 8)
    problem = FixedPointProblem(None, tuple(P), (0, 1), None, None)

    @jax.jit
    def told(last):
        slopes, length = slopes_of(last), last.advance[0]
        radius, terms, floor = _orbit_derivatives._radius_slopes(problem, LEAST, (last, None))
        measured = Measures(last.period, length, length / last.period, last.peak, None, zero)
        seven = slopes._replace(recurring=jnp.concatenate([slopes.recurring, jnp.zeros((4, 2))]))
        found = measure_slopes(SimpleNamespace(), measured, seven, radius)
        values = Measures(2.0, *[4.0] * 4, jnp.asarray(8.0))
        of = problem._replace(args=(1.0, 0.0))
        relative = elasticities_of(of, values, found._replace(state=found.period))
        return slopes.recurring, found, relative, terms, floor

    last = linearised(linear, x, P)
    recurring, found, relative, terms, floor = told(last)
    assert np.all(terms >= np.abs(found.spectral_radius) * (1.0 - 1e-12))
    # Columns are wrong by LEAST: 0.3 of what terms have of columns that are no larger than that.
    moved = {
        size: told(last._replace(jacobian=last.jacobian.at[:, 3:].set(size * LEAST[:, None])))[3]
        for size in (0.0, 1.0)
    }
    np.testing.assert_allclose(floor, 0.3 * (moved[1.0] - moved[0.0]), rtol=1e-6)
    ours = [*recurring, found.period, found.step_length, found.speed, found.peak_normal]
    expected = differences(linear)
    np.testing.assert_allclose(
        np.stack([*ours, found.spectral_radius]), expected, rtol=1e-6, atol=1e-8
    )
    np.testing.assert_allclose(relative.period, [expected[3, 0] / 2.0, 0.0], rtol=1e-6)
    np.testing.assert_allclose(relative.speed, [expected[5, 0] / 4.0, 0.0], rtol=1e-6)
    assert np.isnan(told(last._replace(grazes=jnp.asarray(1)))[1].period).all()


def test_bars_of_slopes_hold_two_witnesses_and_a_floor():
    """A derivative that no other solve changes, even one that is zero, has that of its column."""
    last = linearised(TURN, jnp.asarray(fixed_point(TURN, P)), P)
    moved = {"jacobian": last.jacobian.at[:, 1].multiply(1.0 + 1e-6)}
    found = SimpleNamespace(last=last, fine=last, loose=last, recurring=last.recurring)
    slopes, least = slopes_of(last), 1e-9 * jnp.array([1.0, 2.0, 4.0])
    floor = _orbit_derivatives._slope_errors(found, slopes, least)
    inverse = np.abs(np.linalg.inv(np.eye(3) - np.asarray(last.jacobian)[:, :3]))
    expected = 0.3 * inverse @ np.asarray(least)
    np.testing.assert_allclose(floor.recurring, np.stack([expected] * 2, axis=1), rtol=1e-9)
    for witness in ("loose", "last"):
        other = SimpleNamespace(**(vars(found) | {witness: last._replace(**moved)}))
        bars = _orbit_derivatives._slope_errors(other, slopes, least)
        change = np.abs(slopes_of(last._replace(**moved)).period - slopes.period)
        assert np.all(change > floor.period)
        assert np.all(bars.period >= change + floor.period - 1e-18)


def one_component(by_state, *by_parameters, period_row=(0.0, 0.0, 0.0)):
    """A return of one component, with derivatives with respect to it and to two parameters."""
    one, rows = jnp.ones(1), jnp.zeros(3)
    jacobian = jnp.array([[by_state, *by_parameters]])
    return LinearisedReturn(
        one, jacobian, rows[None], one, one[0], jnp.array(period_row), one, rows[None], one[0],
        rows, 0, 0, 0, 0, None,
    )  # fmt: skip


def bars_of(fine, loose, last):
    found = SimpleNamespace(fine=fine, loose=loose, last=last, recurring=fine.recurring)
    return _orbit_derivatives._slope_errors(found, slopes_of(fine), jnp.zeros(1))


def test_a_derivative_that_by_chance_is_not_changed_has_a_share_of_the_pooled_change():
    """x ← x/2 + p + q: dx/dp = dx/dq = 2. A looser solve says 2 and 2.2, shares 0 and 0.1 of the
    terms, with the root mean square 0.1/√2; seven tenths of that of 2 are 0.0989949."""
    fine, loose = one_component(0.5, 1.0, 1.0), one_component(0.5, 1.0, 1.1)
    np.testing.assert_allclose(bars_of(fine, loose, fine).recurring, [[0.0989949, 0.2]], rtol=1e-5)
    # By the search's own x/2.2, both are 11/6.
    other = one_component(1.0 / 2.2, 1.0, 1.0)
    np.testing.assert_allclose(
        bars_of(fine, loose, other).recurring, [[0.0989949 + 1 / 6, 0.2 + 1 / 6]], rtol=1e-5
    )


def test_a_parameter_that_moves_one_quantity_more_than_others_do_is_as_uncertain_in_the_rest():
    """The same, and a period of 4 p + q: a looser solve says 4 p (1 + 0.3) + q, a share of 0.3,
    and of dx/dq the 0.1. Of shares 0, 0.1 and 0.3, 0, and 0 of what has no derivatives, √0.09 by p
    is √(2·0.9) of all; by that much 0.1/√2 of dx/dp = 2 is expected to be wrong: 0.189737."""
    fine = one_component(0.5, 1.0, 1.0, period_row=(0.0, 4.0, 1.0))
    loose = one_component(0.5, 1.0, 1.1, period_row=(0.0, 5.2, 1.0))
    bars = bars_of(fine, loose, fine)
    np.testing.assert_allclose(bars.recurring, [[0.189737, 0.2]], rtol=1e-5)
    np.testing.assert_allclose(bars.period, [1.2, 0.7 * 0.3 / np.sqrt(2.0)], rtol=1e-5)


def test_a_component_that_the_section_holds_leaves_the_others_their_bars():
    """Its derivatives are rounding, which a looser solve changes wholly: by p and not by q."""
    fine, loose = one_component(0.5, 1.0, 1.0), one_component(0.5, 1.0, 1.1)
    expected = bars_of(fine, loose, fine)

    def beside(once, *rounding):
        rows = jnp.stack([once.jacobian[0, :1], jnp.zeros(1)])
        by_state = jnp.concatenate([rows, jnp.zeros((2, 1))], axis=1)
        by_parameter = jnp.stack([once.jacobian[0, 1:], jnp.array(rounding)])
        jacobian = jnp.concatenate([by_state, by_parameter], axis=1)
        no = jnp.zeros(4)
        return once._replace(
            recurring=jnp.ones(2), jacobian=jacobian, monodromy=jacobian, period_row=no,
            advance_rows=no[None], peak_row=no,
        )  # fmt: skip

    fine, loose = beside(fine, 1e-17, 1e-17), beside(loose, -2e-17, 1e-17)
    found = SimpleNamespace(fine=fine, loose=loose, last=fine, recurring=fine.recurring)
    least = 1e-9 * jnp.ones(2)
    bars = _orbit_derivatives._slope_errors(found, slopes_of(fine), least).recurring
    np.testing.assert_allclose(bars[0], expected.recurring[0], rtol=1e-6)
    np.testing.assert_allclose(bars[1], 0.3e-9, rtol=1e-6)


def test_a_quantity_without_derivatives_leaves_the_others_their_bars():
    fine, loose = one_component(0.5, 1.0, 1.0), one_component(0.5, 1.0, 1.1)
    expected = bars_of(fine, loose, fine)
    fine, loose = (each._replace(peak_row=jnp.full(3, jnp.nan)) for each in (fine, loose))
    found = bars_of(fine, loose, fine)
    np.testing.assert_allclose(found.recurring, expected.recurring)
    assert np.all(np.isnan(found.peak))


WALKING = SimpleNamespace(
    spec=SimpleNamespace(system=SimpleNamespace(cyclic_coordinates=(0,))), loaded=True
)
"""What measures ask of the problem of a walker."""


def test_errors_of_measures_hold_what_the_looser_solve_and_the_last_correction_change():
    x = fixed_point(TURN, P)
    off = 1e-5 * np.array([1.0, -2.0, 0.5])
    last, coarse = (linearised(TURN, x + d, P) for d in (off, 0.0 * off))
    coarse = coarse._replace(period=coarse.period + 0.01, peak=coarse.peak - 0.02)

    @jax.jit
    def errors_of(last, coarse):
        no = jnp.asarray(0)
        both = jax.tree.map(lambda a, b: jnp.stack([a, b]), last, coarse)
        found = Found(no, no, last.recurring, no, both, no, no, jnp.asarray(True))
        stability = SimpleNamespace(errors=jnp.array([0.25]), spectral_radius=0.5)
        orbit = SimpleNamespace(
            found=found, state=Triple(jnp.zeros(()), *last.recurring), stability=stability
        )
        length, period = last.advance[0], last.period
        told = Measures(period, length, length / period, last.peak, 0.5, orbit.state)
        return measure_errors(WALKING, told, orbit)

    errors = errors_of(last, coarse)
    true = measures(TURN, P)
    assert float(errors.period) == pytest.approx(
        (0.01 + abs(float(last.period) - true[3])), rel=1e-3
    )
    assert float(errors.peak_normal) == pytest.approx(
        (0.02 + abs(float(last.peak) - true[6])), rel=1e-3
    )
    assert float(errors.spectral_radius) == 0.25
    # Where the looser solve moves the state, a period that it does not change is chance.
    x = jnp.asarray(x)
    last, moved = linearised(TURN, x, P), np.array([1e-3, -1e-3, 2e-3])
    inverse = np.linalg.inv(np.eye(3) - np.asarray(last.jacobian)[:, :3])
    row = np.asarray(last.period_row)[:3]
    coarse = last._replace(
        recurring=last.recurring + moved, period=last.period - row @ inverse @ moved
    )
    reach, signless = inverse @ moved, np.abs(inverse) @ np.abs(moved)
    # Changes of period, length and peak, and the terms of them; of the speed they add up.
    changes, terms = [0.0], [abs(row @ inverse @ moved) + np.abs(row) @ signless]
    for slopes in (last.advance_rows[0], last.peak_row):
        changes.append(abs(np.asarray(slopes)[:3] @ reach))
        terms.append(np.abs(np.asarray(slopes)[:3]) @ signless)
    length, period = float(last.advance[0]), float(last.period)
    changes.append(changes[1] / period)
    terms.append((terms[1] + length / period * terms[0]) / period)
    share = np.sqrt(np.mean((np.array(changes) / terms) ** 2))
    errors = errors_of(last, coarse)
    assert 0.25 < share < 0.9
    assert float(errors.period) == pytest.approx(share * terms[0], rel=1e-6)
    for error, change, size in zip(
        errors[:4], np.array(changes)[[0, 1, 3, 2]], np.array(terms)[[0, 1, 3, 2]], strict=True
    ):
        assert float(error) == pytest.approx(max(change, share * size), rel=1e-6)


def test_newton_goes_quadratically_to_the_fixed_point_and_stops_there():
    method = Method(None, 40, 1e-10)
    iteration = jax.jit(lambda now, latest: newton_iteration(now, latest, method))
    x = fixed_point(SHEAR, P)
    now = initial_progress(jnp.asarray(x + 0.3), jnp.asarray(0.0), method, linearised(SHEAR, x, P))
    assert int(now.stage) == Stage.ROUGH
    while int(now.stage) < Stage.FOUND:
        now = iteration(now, linearised(SHEAR, now.trial, P))
    assert int(now.stage) == Stage.FOUND
    np.testing.assert_allclose(now.base, x, atol=1e-9)
    assert float(now.base_residual) <= 1e-10
    np.testing.assert_array_equal(now.coarse.recurring, linearised(SHEAR, now.trial, P).recurring)
    assert int(now.evaluations) <= 9
    for off, stage in ((1e-11, Stage.WITNESS), (1e-9, Stage.FINE)):
        latest = linearised(SHEAR, x + off, P)
        near = initial_progress(jnp.asarray(x + off), jnp.asarray(0.0), method, latest)
        then = iteration(near._replace(stage=jnp.asarray(3)), latest)
        assert int(then.stage) == stage
        # The witness of the error, too, is solved from Newton's next correction.
        np.testing.assert_allclose(then.trial, x, rtol=0.0, atol=1e-14)
    lost = linearised(SHEAR, now.trial, P)._replace(code=jnp.asarray(3))
    begin = initial_progress(jnp.asarray(x), jnp.asarray(0.0), method, lost)
    assert int(iteration(begin, lost).stage) == Stage.NO_RETURN
    # A trial that does not return: the step is shortened.
    away = iteration(begin._replace(stage=jnp.asarray(1)), linearised(SHEAR, begin.trial + 0.2, P))
    assert float(iteration(away, lost).damping) == 0.5 * float(away.damping)


def test_steps_are_damped_as_the_natural_level_function_says():
    """NLEQ-ERR on x → x − atan x from 3, whose full step lands farther off than it began."""
    nothing = linearised(TURN, np.zeros(3), P)._replace(code=np.asarray(0))

    def at(x):
        x = float(x[0])
        slope = np.array([[1.0 - 1.0 / (1.0 + x * x)]])
        return nothing._replace(recurring=np.array([x - np.arctan(x)]), jacobian=slope)

    iteration = jax.jit(lambda now, latest: newton_iteration(now, latest, Method(None, 40, 1e-9)))
    first = initial_progress(jnp.array([3.0]), jnp.asarray(0.0), Method(None, 40, 1e-9), at([3.0]))
    one = iteration(first, at(first.trial))
    step = 10.0 * np.arctan(3.0)
    assert float(one.trial[0]) == pytest.approx(3.0 - step)
    two = iteration(one, at(one.trial))
    share = 0.5 * step / (10.0 * np.arctan(step - 3.0))
    assert float(two.damping) == pytest.approx(share)
    assert float(two.trial[0]) == pytest.approx(3.0 - share * step)
    three = iteration(two, at(two.trial))
    assert float(three.damping) == 1.0
    while int(three.stage) < Stage.FOUND:
        three = iteration(three, at(three.trial))
    assert float(three.base[0]) == pytest.approx(0.0, abs=1e-9)


def test_near_a_fold_corrections_of_one_kind_are_compared():
    """x → x − 50 x, y → y + y/1000 + y²: a first step leaves y as it is, the next has to go far."""
    nothing = linearised(TURN, np.zeros(3), P)._replace(code=np.asarray(0))

    def at(place):
        x, y = map(float, place)
        change = np.array([-50.0 * x, 1e-3 * y + y * y])
        slope = np.diag([-49.0, 1.001 + 2.0 * y])
        return nothing._replace(recurring=np.array([x, y]) + change, jacobian=slope)

    method = Method(None, 40, 1e-10)
    iteration = jax.jit(lambda now, latest: newton_iteration(now, latest, method))
    begin = jnp.array([1e-8, 1e-6])
    now = initial_progress(begin, jnp.asarray(0.0), method, at(begin))
    while int(now.stage) < Stage.FOUND and int(now.evaluations) < 40:
        now = iteration(now, at(now.trial))
    assert int(now.stage) == Stage.FOUND
    assert int(now.evaluations) <= 6
    np.testing.assert_allclose(now.base, 0.0, atol=1e-9)


def gait_of(values, multipliers=(0.5, 0.1), found=jb.gait.Search.FOUND):
    """As much of a gait as its judge looks at; all its errors are 0.01."""
    state = jb.State(*[0.0] * 8)
    numbers = Measures(*values, 0.5, state)
    small = jax.tree.map(lambda _: np.asarray(0.01), numbers)
    slopes = jax.tree.map(lambda _: np.array([2.0, 20.0]), numbers)
    return SimpleNamespace(
        outcome=found, measures=numbers, measure_errors=small, multipliers=np.array(multipliers),
        multiplier_errors=np.full(2, 0.01), sensitivities=slopes, parameters=("K", "slope"),
        sensitivity_errors=jax.tree.map(lambda _: np.full(2, 1e-9), numbers),
    )  # fmt: skip


def test_bars_are_what_a_looser_tolerance_and_another_method_change():
    scene = jb.seed_scene()
    gait, other = gait_of((1.0, 2.0, 2.0, 50.0)), gait_of((1.1, 2.0, 2.0, 50.0), (0.3, 0.1))
    bars, relative, unknown = judge_gait(scene, gait, other, True)
    assert float(bars["measures"].period) == pytest.approx(0.65 * 0.01 + 1.4 * 0.1)
    assert float(bars["measures"].step_length) == pytest.approx(0.65 * 0.01)
    assert bars["multipliers"].tolist() == pytest.approx([0.8 * (0.0065 + 1.4 * 0.2), 0.8 * 0.0065])
    # The largest: the period's, in units of √(l/g).
    assert relative == pytest.approx(0.1465 / np.sqrt(0.4 / 9.8))
    assert unknown == ""
    loose = gait_of((1.0, 2.0, 2.0, 50.0))
    loose.sensitivity_errors = gait.sensitivity_errors._replace(period=np.array([0.0, 4e7]))
    _, relative, _ = judge_gait(scene, loose, loose, True)
    # An elasticity's error to the largest one: that of the slope, 0.02 rad, to that of K.
    assert relative == pytest.approx(0.5 * 0.65 * 4e7 * 0.02 / (2.0 * 1e6))
    lost = gait_of((1.0, 2.0, 2.0, 50.0), found=jb.gait.Search.NOT_CONVERGED)
    assert judge_gait(scene, gait, lost, True)[1] == np.inf


@pytest.mark.parametrize(
    ("ending", "radius", "stable"), [(0, 0.9, True), (0, 1.1, False), (2, 0.9, False)]
)
def test_only_what_was_found_is_stable(ending, radius, stable):
    gait = SimpleNamespace(
        ending=jnp.asarray(ending), measures=SimpleNamespace(spectral_radius=jnp.asarray(radius))
    )
    assert bool(Gait.stable.fget(gait)) is stable


def test_an_orbit_uphill_hasty_or_deep_underground_is_no_walk():
    scene, state = jb.seed_scene(), jb.seed_state()
    walking = jb.hybrid.Walking()
    judge = jax.jit(walking.is_walk)
    sound = lambda *at: bool(judge(scene, *at))
    assert sound(state, 0.18, 0.44, 1)
    assert not sound(state, -0.18, 0.44, 1)
    assert not sound(state, 0.18, 0.1 * np.sqrt(0.4 / 9.8), 1)
    # Footsteps of 1 % of the height, 0.4 m, in the mean.
    assert (sound(state, 0.00404, 0.44, 1), sound(state, 0.00396, 0.44, 1)) == (True, False)
    assert (sound(state, 0.00808, 0.44, 2), sound(state, 0.00792, 0.44, 2)) == (True, False)
    for length, expected in ((0.00404, True), (0.00396, False)):
        rolls = jb.hybrid.Rolling().is_walk(jb.ladder()["rigid"], state, length, 0.44, 1)
        assert bool(rolls) is expected
    for share in (0.99, 1.01):  # an arrival of unlike legs is two footsteps
        unlike = SimpleNamespace(mechanism=scene.mechanism, arrival_footsteps=2)
        assert bool(walking.takes_steps(unlike, 0.008 * share, 1)) is (share > 1.0)
    for leg, other in ((1, 2), (2, 1)):
        # On a leg that turns back, so deep that it would carry a hundred times the weight.
        stands = {f"theta_{leg}": 0.0, f"omega_{leg}": -1.0, f"theta_{other}": 1.5}
        for depth, expected in ((1e-4, True), (1.6e-2, False)):
            low = state._replace(hip_z=0.4 - depth, **stands)
            low = jax.tree.map(jnp.asarray, low)
            assert sound(low, 0.18, 0.44, 1) is expected, (leg, depth)
    found = Found(*[np.asarray(0)] * 7, sound=np.asarray(False))
    assert int(walks_only(found).ending) == jb.gait.Search.NO_WALK
    assert int(walks_only(found._replace(sound=np.asarray(True))).ending) == jb.gait.Search.FOUND


@pytest.mark.parametrize("length", [0.1, 1.6])
def test_an_arrival_may_take_fifty_swings(length):
    scene = jb.with_parameters(jb.seed_scene(), {"l": length, "d": 0.05, "r": 0.01})
    spec = return_map_spec(
        scene, jb.seed_state(), solver="rodas4", engine="xla", max_solver_steps=9
    )
    assert float(spec.max_time) == pytest.approx(50.0 * np.sqrt(length / 9.8))


class Point(NamedTuple):
    """One of two."""

    hip_x: jax.Array
    theta_1: jax.Array
    omega_1: jax.Array


def test_a_differentiable_correction_has_the_derivatives_of_the_fixed_point():
    """On the map x → a x + 3, y → y/2, after the time 2 + x and the way x/2."""

    def measured(a):
        state = Point(jnp.zeros(()), jnp.asarray(3.0 / (1.0 - 0.6)), jnp.zeros(()))
        after = Point(0.5 * state.theta_1, a * state.theta_1 + 3.0, 0.5 * state.omega_1)
        jacobian = jnp.array([[0.6, 0.0], [0.0, 0.5], [1.0, 0.0], [0.5, 0.0]])
        gait = SimpleNamespace(
            measures=SimpleNamespace(state=state), return_jacobian=jacobian, ending=jnp.asarray(0)
        )
        once = SimpleNamespace(time=2.0 + state.theta_1, state=after)
        found = _by_correction(jb.ladder()["rigid"], gait, once)
        return jnp.stack([found.state.theta_1, found.period, found.step_length])

    value, slope = jax.jit(lambda a: jax.jvp(measured, (a,), (jnp.ones(()),)))(0.6)
    np.testing.assert_allclose(value, [7.5, 9.5, 3.75])
    np.testing.assert_allclose(slope, np.array([1.0, 1.0, 0.5]) * 7.5 / (1.0 - 0.6))


@pytest.mark.slow
def test_an_orbit_that_grazes_has_no_sensitivities_and_multipliers_of_infinite_error():
    args = (jnp.asarray(PULL), jnp.asarray(PUSH))
    how = dict(rtol=1e-9, tangent_rtol=1e-8, section=ABOVE, system=Pulled(), engine="lanes")

    def orbit(depth):
        once = jb.gait.linearise_return_map(args, pulled_from(depth), **how)
        zero = jnp.asarray(0)
        found = Found(
            ending=zero,
            code=zero,
            recurring=once.recurring,
            residual=jnp.zeros(()),
            both=jax.tree.map(lambda leaf: jnp.stack([leaf, leaf]), once),
            evaluations=zero,
            history=jnp.zeros(1),
            sound=jnp.asarray(True),
        )
        spec = map_of(Pulled(), ABOVE, engine="lanes")
        problem = FixedPointProblem(spec, args, (0, 1), pulled_from(depth), Precision(1e-9, 1e-8))
        return _orbit_derivatives.orbit_of(problem, found, radius=False)

    known, grazing = orbit(1e-3), orbit(1e-12)
    assert np.all(np.isfinite(known.stability.errors))
    assert np.all(np.isfinite(known.slopes.period))
    assert np.all(np.isinf(grazing.stability.errors))
    assert np.all(np.isfinite(grazing.stability.multipliers))
    assert np.all(np.isnan(grazing.slopes.period))


class Landing(Pulled):
    """The ball whose motions across the ground are differentiated once."""

    def switches(self, args, y):
        return tuple(switch._replace(first_only=True) for switch in super().switches(args, y))


def test_xla_compiles_no_second_derivatives_across_a_force_that_jumps():
    """They are differences of first ones, by lanes alone: the return itself is not looked at."""
    numbers, start = (jnp.asarray(PULL), jnp.asarray(PUSH)), pulled_from(1e-3)
    spec = map_of(Landing(), ABOVE, engine="xla")
    args = Seeded(numbers, jnp.eye(2), jnp.zeros(2), (0, 1))
    leading, tangents = jnp.ones((1, 2)), jnp.ones((2, 2))
    variation = _orbit_derivatives.second_variation(
        spec, args, start, None, leading, leading, tangents, jnp.ones(2), Precision(1e-9, 1e-8)
    )
    assert np.isnan(variation.slopes).tolist() == [True, True]
    assert np.isnan(variation.by_parameter).tolist() == [True, True]
