"""Designs whose measures are formulas, against optima, costs and norms in closed form."""

import json
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from reference.rigid import rigid_walker

import jaxbiped as jb
from jaxbiped._progress import Stage
from jaxbiped.dynamics import powers, push_off_work
from jaxbiped.dynamics._actuation import hip_torques
from jaxbiped.dynamics._stance import of_stance
from jaxbiped.dynamics._stance_motion import hip_motion_of
from jaxbiped.gait import Search
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.optimise import Evaluation, Outcome, _certificate
from jaxbiped.optimise._cycle_costs import CostedCycle
from jaxbiped.optimise._cycle_functionals import (
    Functional,
    Functionals,
    total_of_peak,
    totals_of_advance,
    with_errors,
)
from jaxbiped.optimise._design_gaits import (
    Ensemble,
    _by_nominal,
    _together,
    ensemble_of,
    with_worse_members,
)
from jaxbiped.optimise._design_problem import scale_of
from jaxbiped.optimise._jacobian_functionals import entry_weights, leading_multipliers
from jaxbiped.optimise._local_model import Local
from jaxbiped.optimise._objective_values import Evaluations, _root_of_squares, with_costs
from jaxbiped.optimise._objectives import measures_named
from jaxbiped.optimise._optimality import optimality_of
from jaxbiped.optimise._optimisers import _damped_update, run_trust_constr
from tests.optimise.drawn_designs import (
    BOTH,
    FASTEST,
    NAMES,
    NO_STATE,
    SCENE,
    difference,
    formula_problem,
    slopes_of,
    solved,
)

HEAVY_HIP = jb.Walker(m=1.0, J=0.01, l=0.4, d=0.1, r=0.08, hip_mass=0.5)
MU = 0.015 / 0.005625
"""Multiplier of a step of at most 0.21 m, by Lagrange."""


def logarithms(runs):
    named = runs.problem.variables.by_name(runs.best.u)
    return np.log([named["d"] / 0.1, named["slope"] / 0.02])


@pytest.mark.parametrize("vary", [BOTH, {"d": (0.04, 0.115), "slope": (0.005, 0.03)}])
@pytest.mark.parametrize(
    ("optimiser", "near"), [("trust-region", 1e-4), ("slsqp", 3e-3), ("trust-constr", 3e-3)]
)
def test_optimisers_come_to_the_same_optimum_and_say_so(optimiser, near, vary):
    """In the lower half of both ranges, and in the upper one."""
    runs = solved(formula_problem(vary, *FASTEST, "step_length<0.21"), optimiser=optimiser)
    assert logarithms(runs) == pytest.approx([0.2 - 0.05 * MU, 0.1 - 0.0125 * MU], abs=near)
    assert runs.history[-1].objective == pytest.approx(runs.best.known.values["speed"], abs=1e-4)
    assert runs.ended.converged


@pytest.mark.parametrize("kind", [ValueError, np.linalg.LinAlgError])
def test_an_optimiser_that_breaks_down_has_not_converged(kind):
    def objective(_):
        raise kind("array must not contain infs or NaNs")

    broken = SimpleNamespace(rows=(), objective=objective)
    ended = run_trust_constr(broken, np.full(2, 0.4), 5, lambda _: None)
    assert not ended.converged
    assert "broke down: array must not contain infs or NaNs" in ended.message


def test_an_upper_bound_holds_an_optimum_with_the_multiplier_of_lagrange():
    bounds = {"step_length": (None, 0.21), "period": (None, 0.9)}
    runs = solved(formula_problem(BOTH, *FASTEST, bounds))
    assert runs.ended.converged
    told = optimality_of(runs.problem, runs.best)
    held, free = told.requirements
    assert (free.active, free.multiplier, free.multiplier_error) == (False, 0.0, 0.0)
    assert held.active
    assert held.multiplier == pytest.approx(MU, rel=1e-3)
    assert (held.bound, held.value) == (0.21, pytest.approx(0.21, abs=1e-6))
    assert held.multiplier_error == pytest.approx(2e-3 * MU, rel=1e-2)  # of both derivatives
    assert told.residual < 1e-3
    # Moved along, the optimum's speed changes by what the multiplier says.
    more = solved(formula_problem(BOTH, *FASTEST, "step_length<0.211"))
    gained = more.best.known.values["speed"] - runs.best.known.values["speed"]
    assert gained / 0.001 == pytest.approx(MU, rel=0.15)


def test_a_variable_at_its_bound_is_held_by_it():
    runs = solved(formula_problem({"d": (0.04, 0.1)}, *FASTEST))
    (held,) = optimality_of(runs.problem, runs.best).bounds
    assert (held.name, held.value) == ("d", pytest.approx(0.1))
    assert (held.bound, held.error, held.active) == (held.value, 0.0, True)
    assert held.multiplier == pytest.approx(2.0 * 0.2 / 0.1, rel=1e-3)  # dv/dd
    free = solved(formula_problem({"d": (0.04, 0.18)}, *FASTEST))
    assert np.log(free.problem.variables.by_name(free.best.u)["d"] / 0.1) == pytest.approx(
        0.2, abs=1e-4
    )
    assert optimality_of(free.problem, free.best).bounds == ()


def test_moduli_that_meet_make_a_corner_in_which_the_radius_is_least():
    made = solved(formula_problem(BOTH, {"spectral_radius": 1.0}, 1.0)).problem
    least = min(each.known.values["spectral_radius"] for each in made.asked)
    assert least == pytest.approx(0.5, abs=1e-6)


def test_requirements_that_are_missed_are_told_in_units_of_their_bounds():
    bounds = {"step_length": (None, 0.1), "period": (0.6, 0.9)}
    made = formula_problem(BOTH, *FASTEST, bounds)
    known = made.latest.known
    over = (known.values["step_length"] - 0.1) / 0.1
    under = (0.6 - known.values["period"]) / 0.6
    assert made.excess(known) == pytest.approx(max(over, under))
    assert over > 0.0 < under
    assert made.allowance(known) == pytest.approx(0.01 * known.values["step_length"])
    value, error, slopes, _ = made.objective(known)
    assert (value, error) == (-known.values["speed"], known.errors["speed"])
    np.testing.assert_array_equal(slopes, -known.slopes["speed"])


def test_an_optimum_that_misses_a_requirement_is_infeasible():
    runs = solved(formula_problem(BOTH, *FASTEST, "step_length>0.9"), 10)
    assert runs.outcome() is Outcome.INFEASIBLE


def test_variables_keep_their_bounds_and_gradients_are_differences_of_the_designs():
    made = formula_problem(BOTH | {"hip_mass": (0.0, 1.0)}, {"speed": 1.0}, 1.0)
    u, variables = np.array([0.3, 0.6, 0.5]), made.variables
    slopes = made.gradient(u, made.at(u).slopes["speed"])
    for k, along in enumerate(np.eye(3)):
        speed = difference(lambda h, along=along: made.at(u + h * along).values["speed"])
        assert slopes[k] == pytest.approx(speed, rel=1e-5, abs=1e-8)
        rate = difference(lambda h, along=along: variables.values(u + h * along))
        np.testing.assert_allclose(rate, variables.rates(u) * along, rtol=1e-8, atol=1e-12)
    for at, bounds in ((np.zeros(3), variables.low), (np.ones(3), variables.high)):
        assert variables.values(at).tolist() == bounds.tolist()
    for at in (u, np.zeros(3), np.ones(3)):
        np.testing.assert_allclose(variables.positions(variables.values(at)), at)


def test_the_cost_of_transport_moves_with_all_that_it_is_made_of():
    """The motors' work over (2 m + M) g L beside the slope's sine, by differences."""
    base = dict(m=1.0, hip_mass=0.7, g=9.8, slope=0.02, d=0.1)
    scene = jb.with_parameters(SCENE, base)
    scene = jb.RigidScene(scene.walker, scene.ground, jb.actuation.PushOff(0.1))
    names = jb.parameter_names(scene)
    work = lambda p: 0.05 + 0.3 * p["d"] + 0.2 * p["m"]
    length = lambda p: 0.2 + 0.4 * p["d"] + 3.0 * p["slope"]

    def motors(p):
        return work(p) / ((2.0 * p["m"] + p["hip_mass"]) * p["g"] * length(p))

    def as_row(function, error):
        slopes = np.zeros(len(names))
        for name in base:
            moved = lambda h, name=name: function(base | {name: base[name] + h})
            slopes[names.index(name)] = difference(moved)
        return Functional(function(base), error, slopes, 0.0 * slopes)

    measures = measures_named(["cost_of_transport"])

    def cost_of(scene, costs):
        kept = [names.index(name) for name in jb.parameter_names(scene)]
        row = as_row(length, 2e-3)
        row = row._replace(slopes=row.slopes[kept], slope_errors=row.slope_errors[kept])
        rows = {"period": row, "step_length": row}
        for name in ("weight", "slope"):
            rows[name] = Functional(*jb.optimise.OBJECTIVES[name].measured(scene, None))
        return with_costs(measures, rows, costs, scene)["cost_of_transport"]

    found = cost_of(scene, Functionals(*map(np.stack, zip(as_row(work, 1e-3))), np.zeros(())))
    expected = as_row(lambda p: motors(p) + np.sin(p["slope"]), 0.0)
    assert found.value == pytest.approx(expected.value)
    np.testing.assert_allclose(found.slopes, expected.slopes, rtol=1e-6, atol=1e-9)
    assert found.error == pytest.approx(motors(base) * (1e-3 / work(base) + 2e-3 / length(base)))
    passive = cost_of(jb.RigidScene(scene.walker, scene.ground), None)
    assert (passive.value, passive.error) == (pytest.approx(np.sin(0.02), rel=1e-15), 0.0)
    slopes = dict(zip(jb.parameter_names(scene)[:-1], passive.slopes, strict=True))
    alone = {name: slope for name, slope in slopes.items() if slope}
    assert alone == {"slope": pytest.approx(np.cos(0.02), rel=1e-15)}


def test_a_root_of_squares_has_the_slopes_of_one():
    none = np.zeros(len(NAMES))
    rows = (
        Functional(3.0, 0.3, slopes_of(d=1.0, m=2.0), none),
        Functional(4.0, 0.1, slopes_of(d=-1.0), none),
    )
    found = _root_of_squares(rows)
    assert (found.value, found.error) == (5.0, pytest.approx(0.6 * 0.3 + 0.8 * 0.1))
    assert found.slopes[NAMES.index("d")] == pytest.approx(0.6 - 0.8)
    assert found.slopes[NAMES.index("m")] == pytest.approx(1.2)


def member(speed, radius, d):
    slopes = {"speed": slopes_of(d=d), "spectral_radius": slopes_of(d=-d)}
    values = {"speed": speed, "spectral_radius": radius}
    return Evaluation(values, dict(values), slopes, dict(slopes), *NO_STATE)


@pytest.mark.parametrize(
    ("criterion", "speed", "radius"), [("mean", 2.0, 0.5), ("worst", 1.0, 0.7)]
)
def test_members_are_taken_together(criterion, speed, radius):
    each = [member(1.0, 0.3, 1.0), member(3.0, 0.7, 3.0)]
    larger = {"speed": False, "spectral_radius": True}
    ensemble = Ensemble(("d",), np.ones((2, 1)), criterion, larger, np.zeros(1))
    found = _together(ensemble, each[0], each)
    assert found.values == {"speed": speed, "spectral_radius": pytest.approx(radius)}
    by_d = {name: slopes[NAMES.index("d")] for name, slopes in found.slopes.items()}
    expected = (2.0, -2.0) if criterion == "mean" else (1.0, -3.0)
    assert (by_d["speed"], by_d["spectral_radius"]) == expected


def test_members_are_multiples_of_the_nominal_design():
    ensemble = ensemble_of(SCENE, {"d": 0.1, "m": 0.3}, 64, "mean", {}, 0)
    assert ensemble.factors.min(axis=0) == pytest.approx([0.9, 0.7], abs=0.02)
    assert ensemble.factors.max(axis=0) == pytest.approx([1.1, 1.3], abs=0.02)
    # The worst case is that of the box: its corners come along.
    corners = ensemble_of(SCENE, {"d": 0.1, "m": 0.3}, 8, "worst", {}, 0).factors[8:]
    np.testing.assert_allclose(corners, [[0.9, 0.7], [0.9, 1.3], [1.1, 0.7], [1.1, 1.3]])
    places = [NAMES.index("d"), NAMES.index("m")]
    found = _by_nominal(member(1.0, 0.3, 2.0), np.array([0.9, 1.2]), places)
    assert found.slopes["speed"][NAMES.index("d")] == pytest.approx(1.8)


def test_a_search_in_the_box_finds_what_neither_sample_nor_corners_show():
    """−Σ (f − 1.03)² is worst, for a measure that should be small, at f = 1.03 inside the box."""

    def members(ensemble):
        values = -np.sum((ensemble.factors - 1.03) ** 2, axis=1)
        return [None if f[0] > 1.09 else member(v, 0.0, 0.0) for f, v in
                zip(ensemble.factors, values, strict=True)]  # fmt: skip

    ensemble = ensemble_of(SCENE, {"d": 0.08, "m": 0.1}, 8, "worst", {"speed": True}, 0)
    found = with_worse_members(ensemble, members, ("speed",), 0)
    assert found.factors.shape == ensemble.factors.shape
    np.testing.assert_allclose(found.factors[-1], 1.03, atol=0.02)
    np.testing.assert_array_equal(found.factors[7:-1], ensemble.factors[8:])  # corners are kept
    # A member without a gait is worse than any other.
    wide = ensemble_of(SCENE, {"d": 0.095, "m": 0.1}, 4, "worst", {"speed": True}, 0)
    inside = wide._replace(factors=1.0 + 0.5 * (wide.factors - 1.0))
    lost = with_worse_members(inside, members, ("speed",), 0)
    assert lost.factors[-1][0] > 1.09


def searched_by(find):
    """A problem of three designs whose gaits this finds, and an ensemble of other members."""
    made = formula_problem(BOTH, *FASTEST)
    made.ensemble = ensemble_of(SCENE, {"m": 0.1}, 4, "worst", {"speed": False}, 0)
    for d in (0.5, 0.6):
        made.at(np.array([d, 0.4]))
    made.settings = SimpleNamespace(find=find, state_of=lambda scene, point: point)
    return made, made.ensemble._replace(factors=1.01 * made.ensemble.factors)


def test_a_problem_that_begins_again_forgets_its_designs_and_counts_on():
    made, harder = searched_by(lambda *_: SimpleNamespace(ending=int(Search.FOUND), sound=True))
    begin, before = made.asked[0], made.evaluations
    again = made.begin_again(begin, harder)
    np.testing.assert_array_equal(again.u, begin.u)
    assert made.ensemble is harder
    assert made.asked == [again]
    assert made.latest is again
    # What is known of the other designs is of other members.
    assert before.get(np.array([0.5, 0.4])) is not None
    assert made.evaluations.get(np.array([0.5, 0.4])) is None
    assert (before.count, made.evaluations.count) == (3, 4)


@pytest.mark.parametrize("kind", [jb.ArgumentError, KeyboardInterrupt])
def test_a_problem_that_cannot_begin_again_stays_as_it_was(kind):
    def find(*_):
        raise kind

    made, harder = searched_by(find)
    parts = lambda: [made.ensemble, made.asked, made.evaluations, made.latest]
    before = parts()
    with pytest.raises(kind):
        made.begin_again(made.asked[0], harder)
    assert all(now is then for now, then in zip(parts(), before, strict=True))
    assert (len(made.asked), made.evaluations.count) == (3, 3)


def test_functionals_carry_the_change_by_the_looser_solve():
    values, slopes = np.array([[1.0, 2.0], [1.1, 2.0]]), np.array([[[3.0]], [[2.5]]])
    found = with_errors(values, slopes, np.zeros(2, int))
    np.testing.assert_allclose(found.errors, [0.1, 0.0], atol=1e-12)
    np.testing.assert_allclose(found.slope_errors, [[0.5]])
    assert np.isnan(with_errors(values, slopes, np.array([0, 3])).values).all()


def test_totals_are_those_of_the_fixed_point():
    """Of x → x/2 + 1, with the integrals 3 x and 5, seen from x = 2 − 0.1."""
    x = 1.9
    once = SimpleNamespace(
        recurring=jnp.array([0.5 * x + 1.0]),
        jacobian=jnp.array([[0.5, 0.25]]),
        advance=jnp.array([9.0, 3.0 * x, 5.0]),
        advance_rows=jnp.array([[0.0, 0.0], [3.0, 1.0], [0.0, 0.0]]),
        period_row=jnp.zeros(2),
        peak=jnp.asarray(0.1 * x),
        peak_row=jnp.array([0.1, 0.2]),
        grazes=jnp.asarray(0),
    )
    values, slopes = totals_of_advance(once, jnp.array([x]))
    np.testing.assert_allclose(values, [6.0, 5.0])
    np.testing.assert_allclose(slopes[:, 0], [1.0 + 3.0 * 0.5, 0.0])
    peak, slope = total_of_peak(once, jnp.array([x]))
    np.testing.assert_allclose([peak, slope[0]], [0.2, 0.2 + 0.1 * 0.5])


def test_functionals_of_a_jacobian_and_their_weights():
    """Moduli, the norm of summed responses, and all derivatives by differences."""
    random = np.random.default_rng(3)
    rows = 0.35 * random.standard_normal((6, 4))
    own, length = rows[2:], np.array([0.4, 0.9])
    leading = leading_multipliers(jnp.asarray(own))
    sizes = np.sort(np.unique(np.abs(np.linalg.eigvals(own)).round(10)))[::-1]
    np.testing.assert_allclose(np.abs(leading)[: len(sizes)], sizes[:3], rtol=1e-8)
    names = ("spectral_radius", "modulus_2", "sensitivity_norm", "clearance_sensitivity")

    @jax.jit
    def told(rows, length):
        return [tuple(entry_weights(n, None, rows, length, leading)) for n in names]

    def values(rows, length):
        return np.array([float(each[0]) for each in told(rows, length)])

    powers = [np.linalg.matrix_power(own, n)[:, 0] for n in range(400)]
    push = np.sqrt(sum(np.sum((rows[:2] / length[:, None] @ p) ** 2) for p in powers))
    foot = np.sqrt(sum((rows[1] @ p) ** 2 for p in powers))
    np.testing.assert_allclose(values(rows, length), [*sizes[:2], push, foot], rtol=1e-9)
    along, longer = random.standard_normal(rows.shape), np.array([1.0, 0.5])
    by_rows = difference(lambda h: values(rows + h * along, length))
    by_length = difference(lambda h: values(rows, length + h * longer))
    for name, each, *expected in zip(names, told(rows, length), by_rows, by_length, strict=True):
        assert np.sum(np.asarray(each[1]) * along) == pytest.approx(expected[0], rel=1e-6), name
        slope = float(np.asarray(each[3]) @ longer)
        assert slope == pytest.approx(expected[1], rel=1e-6, abs=1e-9), name


def integral_named(name):
    """A named cost of the whole walker, an integral."""
    ((_, integral),) = jb.optimise.NAMED_COSTS[name].costs(None)
    return integral


def test_integrals_of_a_cycle_gain_what_their_powers_say():
    scene = jb.seed_scene()
    names = ("slip_distance", "friction_loss", "impact_loss")
    rate_of = {name: integral_named(name).rate for name in names}
    state = jb.seed_state()._replace(hip_z=jnp.asarray(0.3948), hip_vx=jnp.asarray(-0.4))

    @jax.jit
    def fields(y):
        motion = jb.dynamics.WalkerMotion(scene, y)
        rates = {name: rate(motion) for name, rate in rate_of.items()}
        return rates, jb.dynamics.powers(scene, y), jb.dynamics.feet(scene, y)

    rates, power, both = fields(state)
    touching = float(both[1].penetration) > 0.0 and bool(both[1].admitted)
    assert touching
    assert float(both[1].slip_speed) < 0.0
    assert float(rates["slip_distance"]) == pytest.approx(-float(both[1].slip_speed))
    assert float(rates["friction_loss"]) == pytest.approx(float(power.friction))
    assert float(rates["friction_loss"]) > 0.0
    assert float(rates["impact_loss"]) == pytest.approx(float(power.indentation))


def test_an_impact_loses_the_energy_that_is_missing_after_it_and_the_push_off():
    push, spring = jb.actuation.PushOff(0.2), jb.actuation.HipSpring(1.0)
    scene = jb.RigidScene(HEAVY_HIP, jb.Ground(0.02), (push, spring))
    integrals = tuple(map(integral_named, ("impact_loss", "motor_work")))
    system, walker = CostedCycle.of(system_of(scene), integrals), rigid_walker(scene)
    state = jb.dynamics.RigidState(*map(jnp.asarray, (0.0, 0.3, -0.3, -1.0, -1.8)))
    after = jax.jit(lambda y: system.reset_map(scene, system.begin(y)))(state)
    energies = []
    for each in (state, jb.dynamics.impact(scene, state).state):
        y = np.reshape(each[1:], (4, 1))
        rates = walker.whole_rates(y)
        energies.append(0.5 * np.einsum("ni,nij,nj", rates, walker.mass_matrix(y), rates))
    given = float(push_off_work(scene, state))
    assert given > 0.0
    assert float(after.integral_0) == pytest.approx(energies[0] + given - energies[1])
    assert float(after.integral_1) == pytest.approx(given)


def test_motors_work_where_they_drive_and_not_where_they_brake():
    pulse = jb.actuation.HipPulse(2.0, phase=0.0, width=0.5)
    scene = jb.RigidScene(HEAVY_HIP, jb.Ground(0.02), pulse)
    rate = integral_named("motor_work").rate

    @jax.jit
    def told(state):
        motors = powers(scene, state).motors
        hip = of_stance(scene, state, hip_motion_of)
        work = rate(jb.dynamics.WalkerMotion(scene, state))
        return work, motors, hip_torques(scene, hip)

    signs = set()
    for rates in ((3.0, -1.0), (-3.0, 1.0)):
        work, (power,), torques = told(jb.dynamics.RigidState(0.0, 0.1, -0.1, *rates))
        assert float(power) == pytest.approx(float(np.dot(torques, rates)))
        assert float(work) == max(float(power), 0.0)
        signs.add(bool(power > 0.0))
    assert signs == {True, False}


@pytest.mark.parametrize(("last", "count", "returned"), [
    (0.50004, 20, True), (0.5002, 20, False), (0.50004, 10, False),
])  # fmt: skip
def test_a_pushed_walk_returns_to_the_gait_or_does_not(last, count, returned):
    times = np.full(20, np.inf)
    times[:count] = np.append(0.5 * np.arange(count - 1), 0.5 * (count - 2) + last)
    found = _certificate._judged(times, 0.5, 20, 0.01, 1, 1)
    assert found.returned is returned
    assert found.period_difference == pytest.approx(last / 0.5 - 1.0)
    assert (found.footsteps, found.asked) == (count, 20)
    pushed = _certificate._pushed(jb.dynamics.RigidState(1.0, 0.2, 0.3, -1.0, -2.0), 0.01)
    np.testing.assert_allclose(pushed, [1.0, 0.2, 0.3, -1.01, -2.02])


@pytest.mark.parametrize(("last", "returned"), [(0.25004, True), (0.3, False)])
def test_a_pushed_walk_is_told_by_its_last_cycle_of_two_footsteps(last, returned):
    """Of one arrival each, whose times differ."""
    times = np.append(np.cumsum([0.0, *[0.25, 0.35] * 4]), np.inf)
    times[8] = times[7] + last + 0.1
    found = _certificate._judged(times, 0.6, 10, 0.01, 2, 1)
    assert found.period_difference == pytest.approx(abs((last + 0.35) / 0.6 - 1.0), abs=1e-12)
    assert (found.footsteps, found.returned) == (9, returned)


def test_another_engine_s_gait_is_compared_with_the_first():
    def gait(engine, period, length, radius):
        pair = type("Pair", (tuple,), {"spectral_radius": radius})((period, length))
        return SimpleNamespace(engine=engine, measures=pair, outcome=jb.gait.Search.FOUND)

    again = gait("xla", 0.51, 0.19, 0.3)
    found = _certificate._compared(again, gait("lanes", 0.5, 0.2, 0.45), "xla")
    assert found == ("xla", True, *map(pytest.approx, (0.02, 0.05, 0.15)))
    assert [_certificate._other_than(name) for name in ("lanes", "xla")] == ["xla", "lanes"]


def test_the_merit_of_a_design_counts_what_it_misses():
    """An equality by its size, an inequality where it is below zero, the radius by its weight."""
    none = np.zeros((3, 2))
    here = Local(np.zeros(2), 1.0, np.zeros(2), np.array([-0.5, 0.25, -0.125]), none,
                 np.array([False, False, True]))  # fmt: skip
    assert here.merit(8.0) == 1.0 + 8.0 * 0.625
    # Multipliers of 0.5, 0.25 and none, of which the largest may be 0.4.
    three = dict(
        cluster=np.array([0.75, 0.125, 0.0]), cluster_gradients=none, next_gradient=none[0]
    )
    assert here._replace(weight=2.0, **three).merit(8.0) == pytest.approx(2.0 + 8.0 * 0.625)
    assert here._replace(bound=0.4, **three).merit(8.0) == pytest.approx(1.0 + 8.0 * 0.875)


def test_curvature_is_learnt_from_two_gradients():
    """The secant condition B s = y of a quadratic, and Powell's damping where it curves down."""
    hessian = np.array([[2.0, 0.5], [0.5, 1.0]])
    step = np.array([0.1, -0.3])
    learnt = _damped_update(np.eye(2), step, hessian @ step)
    np.testing.assert_allclose(learnt @ step, hessian @ step)
    assert np.linalg.eigvalsh(learnt).min() > 0.0
    damped = _damped_update(np.eye(2), step, -hessian @ step)
    assert step @ damped @ step == pytest.approx(0.2 * step @ step)


def test_a_part_of_a_certificate_fails_by_itself():
    def fails():
        raise ValueError("no root")

    def stops():
        raise KeyboardInterrupt

    parts = _certificate._Parts(Stage("certifying", 1, "parts", 0))
    assert parts.find("walk", fails) is None
    assert parts.find("basin", lambda: 3) == 3
    assert parts.find("push", stops) is None
    assert parts.find("norm", lambda: 4) is None
    assert parts.failed == {
        "walk": "ValueError: no root", "push": "interrupted", "norm": "interrupted"
    }  # fmt: skip


@pytest.mark.parametrize(("bound", "size"), [(-0.2, 0.2), (0.2, 0.2), (0.0, 1.0)])
def test_a_bound_of_either_sign_has_a_size(bound, size):
    """Else what exceeds a bound below zero would be told to keep it."""
    assert scale_of(bound) == size


def test_what_is_not_finite_comes_back_from_a_store(tmp_path):
    some = Evaluation(
        {"speed": 1.0}, {"speed": np.inf}, {"speed": np.array([np.nan, 1.0])},
        {"speed": np.array([-np.inf, 1.0])}, np.array([0.5]), np.array([[np.nan]]),
    )  # fmt: skip
    for _ in range(2):  # as two runs that begin it together
        Evaluations(tmp_path / "a", {"of": 1}).add(np.array([0.25]), some)
    for line in (tmp_path / "a").read_text().splitlines():
        json.loads(line, parse_constant=pytest.fail)
    kept = Evaluations(tmp_path / "a", {"of": 1}).get(np.array([0.25]))
    jax.tree.map(np.testing.assert_array_equal, kept, some)
