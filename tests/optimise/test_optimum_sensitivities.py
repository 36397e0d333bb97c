"""Sensitivities of an optimum, against exact optima of formulas and walkers' sought again."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.optimise import Evaluation, Outcome
from tests.optimise.drawn_designs import (
    NAMES,
    NO_STATE,
    Drawn,
    best_of,
    drawn,
    sensitivities_of,
    solved,
)
from tests.optimise.test_costs_of_motion import START, compass
from tests.optimise.test_optimality import form

CHOSEN = ("d", "J", "l", "g")
VARY = {"d": (0.05, 0.2), "J": (0.003, 0.02)}
HERE = {"l": 0.4, "g": 9.8, "bound": 0.45}
MEASURES = ("speed", "step_length")


def formulas(x, y, l, g):
    """Speed, the objective, and step length, by log(d / 0.1) and log(J / 0.008)."""
    a, b = x - 3.0 * (l - 0.4) - 0.1, y + 0.2 * (g - 9.81) * (1.0 + x)
    speed = 3.0 + a**2 + 0.5 * a * b + 2.0 * b**2 + 0.1 * x**3
    return jnp.array([speed, 0.4 + 0.3 * x + 0.1 * y * (1.0 + x) + 0.05 * (l - 0.4)])


@jax.jit
def by_parameters(d, J, l, g):
    return formulas(jnp.log(d / 0.1), jnp.log(J / 0.008), l, g)


slopes_by_parameters = jax.jit(jax.jacfwd(by_parameters, argnums=(0, 1, 2, 3)))


class Formulas(Drawn):
    """A problem of the formulas; derivatives with respect to all parameters, of relative errors."""

    def _follow(self, u):
        values = jb.parameter_values(self.scene_at(u))
        at = [values[name] for name in CHOSEN]
        slopes = np.zeros((2, len(NAMES)))
        places = [NAMES.index(name) for name in CHOSEN]
        slopes[:, places] = np.transpose(slopes_by_parameters(*at))
        rows, bars = (
            dict(zip(MEASURES, x, strict=True)) for x in (slopes, self.errors * np.abs(slopes))
        )
        numbers = dict(zip(MEASURES, map(float, by_parameters(*at)), strict=True))
        known = Evaluation(numbers, dict.fromkeys(MEASURES, 0.0), rows, bars, *NO_STATE)
        self.evaluations.add(u, known)
        return known


def conditions(z, holds, l, g, bound):
    def lagrangian(xy):
        speed, length = formulas(*xy, l, g)
        return speed - z[2] * (length - bound) * holds

    missed = formulas(*z[:2], l, g)[1] - bound
    return jnp.append(jax.grad(lagrangian)(z[:2]), holds * missed + (1.0 - holds) * z[2])


@jax.jit
def newton(z, *fixed):
    return z - jnp.linalg.solve(jax.jacfwd(conditions)(z, *fixed), conditions(z, *fixed))


def exact(holds, l, g, bound):
    """Design, speed and step length at the optimum, by Newton's method on the conditions."""
    z = jnp.zeros(3)
    for _ in range(30):
        z = newton(z, float(holds), l, g, bound)
    return np.array([0.1 * np.exp(z[0]), 0.008 * np.exp(z[1]), *formulas(*z[:2], l, g)])


REQUIREMENTS = [None, "step_length>0.45", "step_length=0.45"]


@pytest.mark.parametrize("subject_to", REQUIREMENTS)
def test_derivatives_are_those_of_exact_optima(subject_to):
    """Of the objective, the design and the measures: free, and held by a requirement."""
    made = drawn(None, VARY, {"speed": 1.0}, 1.0, subject_to, errors=1e-7, kind=Formulas)
    runs = solved(made)
    assert runs.outcome() is Outcome.CONVERGED
    known = sensitivities_of(made, runs.best, MEASURES)
    assert known.message == ""
    holds = subject_to is not None
    assert known.parameters[-1] == ("bound of step_length" if holds else "g")
    for name in ("l", "g", *["bound"] * holds):
        h = {"l": 1e-5, "g": 1e-4, "bound": 1e-5}[name]
        ends = [exact(holds, **HERE | {name: HERE[name] + x}) for x in (h, -h)]
        expected = (ends[0] - ends[1]) / (2.0 * h)
        place = known.parameters.index("bound of step_length" if name == "bound" else name)
        for part, told in zip(expected, [*known.variables.values(), *known.measures.values()],
                              strict=True):  # fmt: skip
            assert told[place] == pytest.approx(part, rel=2e-4, abs=1e-6)
        assert known.objective[place] == pytest.approx(expected[2], rel=2e-6, abs=1e-8)
        off = abs(known.objective[place] - expected[2])
        assert off <= known.objective_errors[place] + 1e-8 * abs(expected[2])


def test_error_bars_hold_what_errors_of_gradients_change():
    """Of a problem whose gradients are off by as much as they say, in a way that is drawn."""
    subject_to = "step_length=0.45"
    made = drawn(None, VARY, {"speed": 1.0}, 1.0, subject_to, errors=1e-5, kind=Formulas)
    best = solved(made).best
    known = sensitivities_of(made, best, MEASURES)
    random, worst = np.random.default_rng(1), 0.0
    kept = dict(made.evaluations._known)
    for _ in range(20):
        for u, exactly in kept.items():
            slopes = {
                name: row + exactly.slope_errors[name] * random.uniform(-1.0, 1.0, len(row))
                for name, row in exactly.slopes.items()
            }
            made.evaluations._known[u] = exactly._replace(slopes=slopes)
        design = best._replace(known=made.evaluations.get(best.u))
        other = sensitivities_of(made, design, MEASURES)
        pairs = [(known.objective, other.objective, known.objective_errors)]
        pairs += [(known.variables[n], other.variables[n], known.variable_errors[n]) for n in VARY]
        for one, two, bars in pairs:
            off, bars = np.abs(one - two), np.where(bars > 0.0, bars, 1.0)
            worst = max(worst, float(np.max(off / bars)))
    assert 0.02 < worst <= 1.0


def ridge_of_one(u):
    """Level along one of two variables."""
    away = u[0] - 0.5
    return {"speed": (2.0 + away**2, np.array([2.0 * away, 0.0]))}


@pytest.mark.parametrize(
    ("function", "subject_to", "words"),
    [
        (ridge_of_one, None, "does not determine the optimum"),
        (form(2.0), "period>1.0", "not certain that period holds"),
        (form(2.0), ["period=1", "step_length=1"], "depends on each other"),
    ],
)
def test_where_there_are_no_derivatives_a_sentence_says_why(function, subject_to, words):
    """Level ground, a requirement that just does not hold, and two that are the same."""

    def with_length(u):
        rows = function(u)
        return rows | ({"step_length": rows["period"]} if "period" in rows else {})

    runs = best_of(2, with_length, subject_to=subject_to, begin=0.3)
    known = sensitivities_of(runs.problem, runs.best, ("speed",))
    assert words in known.message
    assert np.all(np.isnan([known.objective, known.objective_errors, known.measures["speed"]]))
    assert all(np.all(np.isnan(row)) for row in known.variables.values())


def test_an_optimum_at_a_bound_moves_with_what_else_is_fixed_only():
    vary = {"d": (0.05, 0.09), "J": (0.003, 0.02)}
    made = drawn(None, vary, {"speed": 1.0}, 1.0, errors=1e-7, kind=Formulas)
    best = solved(made).best
    known = sensitivities_of(made, best, MEASURES)
    assert best.u[0] == 1.0
    np.testing.assert_allclose(known.variables["d"], 0.0, atol=1e-15)
    assert known.variables["J"][known.parameters.index("l")] != 0.0


SEED = jb.ladder()["rigid"]


@pytest.mark.slow
def test_the_seeds_fastest_design_moves_with_its_parameters_as_told():
    """By designs that Newton's method finds for other values; rigid feet."""
    told = jb.optimise_gait(SEED, vary={"d": (0.05, 0.2)}, maximise="speed", accuracy="tight")
    known, value = told.sensitivities, float(jb.parameter_values(told.scene)["slope"])
    over = {"slope": value * np.array([1.0, 1.01, 0.99])}
    gaits = jb.optimise.library(
        told.scene, over=over, vary={"d": (0.05, 0.2)}, maximise="speed", accuracy="tight"
    )
    assert gaits.outcome.values.tolist() == [0, 0, 0]
    place, h = known.parameters.index("slope"), 0.02 * value
    for name, mine in (("objective", known.objective), ("design_d", known.variables["d"])):
        own = gaits[name].values
        expected, bend = (own[1] - own[2]) / h, abs(own[1] + own[2] - 2.0 * own[0])
        assert mine[place] == pytest.approx(expected, rel=1e-3)
        assert bend < 1e-3 * abs(expected)
    period = float(gaits.measure_period[1] - gaits.measure_period[2]) / h
    assert known.measures["period"][place] == pytest.approx(period, rel=1e-3)


@pytest.mark.nightly
def test_a_driven_compass_moves_with_its_parameters_as_told():
    scene = compass(jb.actuation.PD(20.0, 1.0, 0.4))
    how = {
        "vary": {
            "leg.hip.kp": (1.0, 200.0), "leg.hip.kd": (0.01, 20.0), "leg.hip.target": (0.05, 1.0)
        },
        "minimise": "torque_squared", "guess": START,
    }  # fmt: skip
    bounds = ["step_length==0.4", "period==0.7"]
    known = jb.optimise_gait(scene, subject_to=bounds, **how).sensitivities
    h = np.array([0.0, 1.0, -1.0])
    for axis, over in {
        "g": {"g": 9.81 + 0.01 * h, "step_length": [0.4]},
        "bound of step_length": {"step_length": 0.4 + 1e-3 * h},
    }.items():
        own = {"step_length": [0.4], **over}
        gaits = jb.optimise.library(scene, over=own, subject_to="period==0.7", **how).squeeze()
        assert not np.any(gaits.outcome.values)
        place, size = known.parameters.index(axis), 0.01 if axis == "g" else 1e-3
        for name, mine in [("objective", known.objective)] + [
            (f"design_{each}", row) for each, row in known.variables.items()
        ]:
            expected = float(gaits[name][1] - gaits[name][2]) / (2.0 * size)
            assert mine[place] == pytest.approx(expected, rel=2e-3)
