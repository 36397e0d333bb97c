"""Certificates of optima, against constructed stalls and folds, and against true optima."""

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.gait import Bifurcation, Search
from jaxbiped.optimise import Outcome
from jaxbiped.optimise._design_functions import restored
from jaxbiped.optimise._design_problem import Design, variables_of
from jaxbiped.optimise._optimality import OPTIMAL, balance_of, curvature_of, doubt_of, optimality_of
from jaxbiped.optimise._runs import doubt_of_gait
from tests.optimise.drawn_designs import (
    BOTH,
    FASTEST,
    SCENE,
    best_of,
    drawn,
    formula_problem,
    solved,
)

LEAST = np.array([0.62, 0.45])
NONE, OTHER = np.zeros(2), np.array([0.1, 0.0])


def bowl(u, curvature=1.0, sign=1.0):
    """A bowl about `LEAST`, or a dome."""
    away = u - LEAST[: len(u)]
    return 2.0 + sign * 0.5 * curvature * away @ away, sign * curvature * away


def of_bowl(change=lambda value, slope, u: (value, slope), **how):
    return lambda u: {"speed": change(*bowl(u, **how), u)}


def unlike(u, size):
    """Noise that is the same whenever a design is asked for."""
    seed = np.frombuffer(np.ascontiguousarray(u).tobytes(), np.uint32)
    return size * np.random.default_rng(seed).standard_normal(len(u))


def ridge(steep, kink=0.4):
    """Least on a line across which the derivative jumps."""

    def function(u):
        side = np.sign(u[0] - kink)
        value, slope = bowl(u)
        return {"speed": (value + steep * abs(u[0] - kink), slope + np.array([steep * side, 0.0]))}

    return function


def largest(u):
    """The larger of two bowls that lie apart, least where they cross."""
    both = [(2.0 + (u - c) @ (u - c), 2.0 * (u - c)) for c in (0.2, np.array([0.9, 0.6]))]
    return {"speed": max(both, key=lambda each: each[0])}


def at_fold(u):
    """A branch that turns back at u₁ = 0.25: nothing lies beyond, and derivatives grow to it."""
    if u[0] <= 0.25:
        return None
    root = np.sqrt(u[0] - 0.25)
    return {"speed": (2.0 + root, np.array([0.5 / root, 0.0]), 1e-9, np.array([1e-9 / root**3, 0]))}


def at_fold_and_bound(u):
    """The same where the variable's bound is."""
    root = np.sqrt(u[0] + 1e-12)
    return {"speed": (2.0 + root, np.array([0.5 / root, 0.1]), 1e-9, np.array([1e-9 / root**3, 0]))}


def beyond_fold(u):
    """What hardly depends on how far the fold is, but whose derivatives are known ever worse."""
    value, slope = bowl(u)
    return {"speed": (value, slope, 1e-9, np.full(2, 1e-5 / (abs(u[0] - LEAST[0]) + 1e-4)))}


def jump(u):
    """Another gait on the other side of u₁ = 0.2."""
    return {"speed": (2.0 + u[0] + 0.5 * (u[0] < 0.2), np.array([1.0, 0.0]))}


def with_limit(error):
    """A requirement whose measure is known so well."""

    def function(u):
        bars = 1e-9, np.full(2, 1e-9)
        limit = 1.0 + u[0], np.array([1.0, 0.0]), error, np.full(2, 1e-9)
        return {"speed": (*bowl(u), *bars), "period": limit}

    return function


STALLS = {
    "ridge": ridge(0.5),
    "steep ridge": ridge(30.0),
    "bowls that cross": largest,
    "fold": at_fold,
    "fold at a bound": at_fold_and_bound,
    "fold that is not seen": beyond_fold,
    "edge of existence": lambda u: None if u[0] > 0.5 else {"speed": bowl(u)},
    "edge of existence aslant": lambda u: None if u.sum() > 0.9 else {"speed": bowl(u)},
    "edge of derivatives": of_bowl(lambda v, s, u: (v, s if u[0] < 0.5 else s * np.nan)),
    "infinite derivatives": of_bowl(lambda v, s, u: (v, s if u[1] < 0.4 else s + np.inf)),
    "noise that is told": of_bowl(lambda v, s, u: (v, s + unlike(u, 1e-4), 1e-9, NONE + 0.01)),
    "noise that is not told": of_bowl(lambda v, s, u: (v, s + unlike(u, 0.05))),
    "noise of values": of_bowl(lambda v, s, u: (v + unlike(u, 1e-3)[0], s)),
    "errors without bound": of_bowl(lambda v, s, u: (v, s, 1e-9, NONE + np.inf)),
    "errors that are no numbers": of_bowl(lambda v, s, u: (v, s, 1e-9, NONE + np.nan)),
    "derivatives that vanish": of_bowl(lambda v, s, u: (v, NONE)),
    "derivatives the wrong way": of_bowl(lambda v, s, u: (v, -s)),
    "derivatives of another": of_bowl(lambda v, s, u: (v, s + OTHER)),
    "derivatives by half": of_bowl(lambda v, s, u: (v, 0.5 * s), curvature=8.0),
    "jump": jump,
    "flat": lambda u: {"speed": (2.0, NONE)},
    "flat but for noise": lambda u: {"speed": (2.0, unlike(u, 1e-8), 1e-9, NONE + 1e-7)},
}  # fmt: skip


@pytest.mark.parametrize("name", STALLS)
def test_no_stall_counts_as_an_optimum(name):
    runs = best_of(2, STALLS[name], iterations=100)
    outcome = runs.outcome()
    assert outcome in (Outcome.CORNER, Outcome.FLAT, Outcome.UNFINISHED)
    assert (outcome is Outcome.FLAT) == name.startswith("flat")
    assert (outcome is Outcome.CORNER) <= bool(doubt_of(runs.problem, runs.best))


@pytest.mark.parametrize("optimiser", ["slsqp", "trust-constr"])
@pytest.mark.parametrize("name", ["ridge", "noise that is told", "derivatives of another", "flat"])
def test_nor_by_another_optimiser(name, optimiser):
    assert best_of(2, STALLS[name], optimiser=optimiser).outcome() is not Outcome.CONVERGED


def test_a_requirement_is_known_as_well_as_is_claimed():
    how = dict(subject_to="period<1.5", begin=0.3)
    assert best_of(2, with_limit(1e-6), **how).outcome() is Outcome.CONVERGED
    runs = best_of(2, with_limit(0.01), **how)
    assert runs.outcome() is Outcome.CORNER
    assert "holds it, period, is known to within 1.0e-02" in doubt_of(runs.problem, runs.best)
    assert best_of(2, with_limit(1e-6), subject_to="period<0.5").outcome() is Outcome.INFEASIBLE
    assert best_of(2, of_bowl(curvature=8.0), iterations=1).outcome() is Outcome.UNFINISHED


@pytest.mark.parametrize("bound", [1.5, 1.75])
def test_an_equality_makes_up_for_errors_along_its_normal_from_either_side(bound):
    """The bowl is least at a period of 1.62, so that the multipliers have different signs."""

    def function(u):
        period = 1.0 + u[0], np.array([1.0, 0.0]), 1e-9, np.full(2, 1e-9)
        return {"speed": (*bowl(u), 1e-9, np.array([0.01, 1e-9])), "period": period}

    runs = best_of(2, function, subject_to=f"period={bound}")
    assert runs.outcome() is Outcome.CONVERGED
    optimality = optimality_of(runs.problem, runs.best)
    assert optimality.error < 1e-6
    assert np.sign(optimality.requirements[0].multiplier) == np.sign(bound - 1.62)


def told(count=2, **how):
    return best_of(count, of_bowl(**how.pop("bowl", {})), **how)


def edge(u):
    """A slope towards a bound, and half a bowl that ends at one."""
    return {"speed": (2.0 + u[0] + u[1] ** 2, np.array([1.0, 2.0 * u[1]]))}


def saddle(u):
    """Stationary where it begins, at 0.3, along the variable in which it falls to both sides."""
    away = u - [0.6, 0.3]
    return {"speed": (2.0 + away[0] ** 2 - away[1] ** 2, 2.0 * away * [1.0, -1.0])}


def trough(u):
    """A bowl in one variable, on which the other has no influence."""
    value, slope = bowl(u[:1])
    return {"speed": (value, np.append(slope, 0.0))}


OPTIMA = {
    "one variable": lambda: told(1),
    "two variables": told,
    "shallow": lambda: told(bowl={"curvature": 0.02}),
    "steep": lambda: told(bowl={"curvature": 1e3}),
    "known to 1e-4": lambda: told(bowl={"change": lambda v, s, u: (v, s, 1e-5, NONE + 1e-4)}),
    "slsqp": lambda: told(optimiser="slsqp"),
    "trust-constr": lambda: told(optimiser="trust-constr"),
    "begun there": lambda: told(1, begin=LEAST[0]),
    "at a bound": lambda: best_of(2, edge),
    "at a bound that is badly known": lambda: best_of(
        1, lambda u: {"speed": (2.0 + u[0], np.ones(1), 1e-9, np.full(1, 0.01))}
    ),
    "begun on a dome": lambda: told(1, bowl={"sign": -1.0}, begin=LEAST[0]),
    "begun on a saddle": lambda: best_of(2, saddle),
    "begun where one is flat": lambda: best_of(2, trough),
    "requirement": lambda: solved(formula_problem(BOTH, *FASTEST, "step_length<0.21", errors=1e-5)),
    "equality": lambda: solved(formula_problem(BOTH, *FASTEST, "step_length=0.21", errors=1e-5)),
    "radius": lambda: solved(formula_problem(BOTH, {"spectral_radius": 1.0}, 1.0, errors=1e-6)),
}  # fmt: skip


@pytest.mark.parametrize("name", OPTIMA)
def test_true_optima_are_certified(name):
    runs = OPTIMA[name]()
    assert runs.outcome() is Outcome.CONVERGED, doubt_of(runs.problem, runs.best)
    found = optimality_of(runs.problem, runs.best)
    assert max(found.residual, found.error) <= OPTIMAL
    if "dome" in name or "saddle" in name:  # left for a bound
        last = runs.best.u[-1]
        assert min(abs(last), abs(1.0 - last)) < 1e-12  # within rounding: SciPy's solver decides


def test_a_gait_at_a_fold_or_not_found_again_leaves_doubt():
    assert doubt_of_gait(Search.FOUND, Bifurcation.NONE) == ""
    assert doubt_of_gait(Search.FOUND, Bifurcation.PERIOD_DOUBLING) == ""
    assert "fold" in doubt_of_gait(Search.FOUND, Bifurcation.FOLD)
    assert "not converged" in doubt_of_gait(Search.NOT_CONVERGED, Bifurcation.NONE)


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("goal", "vary"),
    [
        ({"minimise": "step_length"}, {"slope": (0.005, 0.03)}),
        ({"minimise": "step_length"}, {"slope": (0.005, 0.03), "d": (0.095, 0.105)}),
        ({"minimise": "speed"}, {"slope": (0.0095186, 0.03)}),
        ({"maximise": "spectral_radius"}, {"slope": (0.009, 0.012)}),
        ({"minimise": "cost_of_transport"}, {"d": (0.09, 0.11)}),
    ],
)
def test_a_walkers_folds_and_flat_goals_do_not_count_as_optima(goal, vary):
    """The branch of the seed's gaits turns back at a slope of 0.0095185."""
    best = jb.optimise_gait(jb.seed_scene(), vary=vary, **goal)
    assert best.outcome is not Outcome.CONVERGED, best.message
    assert (best.outcome is Outcome.FLAT) == ("cost_of_transport" in goal.values())


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("goal", "vary", "more"),
    [
        ({"maximise": "speed"}, {"d": (0.05, 0.2), "r": (0.04, 0.12)}, {}),
        ({"maximise": "speed"}, {"d": (0.05, 0.2), "J": (0.003, 0.02)}, {}),
        ({"minimise": "spectral_radius"}, {"d": (0.05, 0.2), "J": (0.003, 0.02)}, {}),
        ({"minimise": "slip_distance"}, {"d": (0.05, 0.2), "mu_kinetic": (0.1, 0.5)}, {}),
        ({"maximise": "speed"}, {"d": (0.05, 0.2)}, {"subject_to": "step_length<0.19"}),
    ],
)
def test_a_walkers_optima_do(goal, vary, more):
    best = jb.optimise_gait(jb.seed_scene(), vary=vary, **goal, **more)
    assert best.outcome is Outcome.CONVERGED, best.message


def test_a_slope_that_is_badly_known_leaves_its_own_variable_open_beside_the_radius():
    """Of d alone the speed's derivative is uncertain, and the radius moves with the slope alone."""
    exact = 0.0, np.zeros(2)

    def function(_, u):
        rates = variables_of(SCENE, BOTH).rates(u)
        largest, along = 0.3 + 0.1 * u[1], np.array([0.0, 0.1]) / rates
        return {  # beside multipliers of 0.1 and 0
            "speed": (1.0, np.array([1.0, 0.5]) / rates, 1e-9, np.array([0.01, 0.0]) / rates),
            "symmetric_1": (largest + 0.1, along, *exact),
            "symmetric_2": (0.1 * largest, 0.1 * along, *exact),
            "symmetric_3": (0.0, np.zeros(2), *exact),
            "spectral_radius": (largest, np.full(2, np.nan), *exact),
            "next_modulus": (0.0, np.zeros(2), *exact),
        }

    made = drawn(function, BOTH, {"speed": 1.0, "spectral_radius": 1.0})
    errors = balance_of(made, made.latest, 2.0).errors
    np.testing.assert_allclose(errors, [0.005, 0.0, 0.0], atol=1e-12)


def form(least):
    """A quadratic form about u = 0.5, and the sum of u."""
    hessian = np.array([[2.0, 0.5], [0.5, least]])

    def function(u):
        away = u - 0.5
        value = 2.0 + 0.5 * away @ hessian @ away
        return {"speed": (value, hessian @ away), "period": (u.sum(), np.ones(2))}

    return function


@pytest.mark.parametrize("least", [1.0, 4.0])
def test_the_curvature_of_an_optimum_is_that_along_what_holds_it(least):
    """By the Hessian's closed form; without a requirement both of its eigenvalues are told."""
    runs = best_of(2, form(least), subject_to="period=1", begin=0.2)
    known = curvature_of(runs.problem, runs.best)
    assert runs.outcome() is Outcome.CONVERGED
    np.testing.assert_allclose(known.values, [(2.0 + least - 1.0) / 2.0 / 2.0], rtol=1e-6)
    free = best_of(2, form(least), begin=0.2)
    expected = np.linalg.eigvalsh([[2.0, 0.5], [0.5, least]]) / 2.0
    np.testing.assert_allclose(curvature_of(free.problem, free.best).values, expected, rtol=1e-6)


def test_no_saddle_counts_as_an_optimum():
    runs = best_of(2, form(-4.0), subject_to="period=1", begin=0.5, iterations=2)
    known = curvature_of(runs.problem, runs.problem.asked[0])
    np.testing.assert_allclose(known.values, [-1.5 / 2.0], rtol=1e-6)
    assert "curves down" in doubt_of(runs.problem, runs.problem.asked[0])


def test_requirements_are_kept_to_rounding():
    """By a design that misses one by far more than what counts as kept."""
    problem = formula_problem(BOTH, *FASTEST, "step_length=0.21")
    u = np.array([0.55, 0.5])
    design = restored(problem, Design(u, problem.at(u)))
    assert abs(design.known.values["step_length"] - 0.21) < 1e-10
    assert np.max(np.abs(design.u - u)) < 0.2
