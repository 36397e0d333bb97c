"""Optima at ridges, corners and meeting multipliers, against designs all round and closed forms."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

import jaxbiped as jb
from jaxbiped.optimise import Outcome
from jaxbiped.optimise._design_functions import ClusterRow, conditions, radius_of
from jaxbiped.optimise._jacobian_functionals import SYMMETRIC
from jaxbiped.optimise._optimality import optimality_of
from tests.optimise.drawn_designs import SCENE, best_of, difference


def gained(runs, function):
    """By how much the best of the allowed designs all round is better, at three distances."""
    made, best = runs.problem, runs.best
    random, own, gain = np.random.default_rng(1), made.objective(best.known).value, 0.0
    for distance in (1e-4, 1e-3, 1e-2):
        for _ in range(200):
            aside = random.standard_normal(len(best.u))
            u = np.clip(best.u + distance * aside / np.linalg.norm(aside), 0.0, 1.0)
            values = {name: float(value) for name, (value, _) in function(u).items()}
            if made.excess(best.known._replace(values=values)) <= 1e-6:
                gain = max(gain, own - sum(w * values[n] for n, w in made.weights.items()))
    return gain


def ridge(steep):
    """A sharp valley across which |Σ − u₁| rises; least at its foot on the way to the centre."""

    def function(u):
        x = u - 0.5
        across = np.append(-1.0, np.ones(len(u) - 1))
        s = float(across @ x)
        gradient = x + 0.3 * np.eye(len(u))[0] + steep * np.sign(s) * across
        return {"speed": (5.0 + steep * abs(s) + 0.5 * x @ x + 0.3 * x[0], gradient)}

    return function


def largest_of(count, many, seed):
    """The largest of bowls that lie apart."""
    random = np.random.default_rng(seed)
    tilts, centres = random.standard_normal((many, count)), random.uniform(0.2, 0.8, (many, count))
    heights = random.uniform(0.0, 0.3, many)

    def function(u):
        away = u - centres
        values = heights + np.sum(tilts * away, axis=1) + 1.5 * np.sum(away * away, axis=1)
        k = int(np.argmax(values))
        return {"speed": (5.0 + values[k], tilts[k] + 3.0 * away[k])}

    return function


def curved(u):
    """Rosenbrock's valley with a sharp bottom."""
    s = u[1] - 2.0 * (u[0] - 0.2) ** 2 - 0.3
    by_first = 2.0 * (u[0] - 0.7) - 4.0 * np.sign(s) * (u[0] - 0.2)
    return {"speed": (2.0 + (u[0] - 0.7) ** 2 + abs(s), np.array([by_first, np.sign(s)]))}


def rooted(u):
    """A valley whose one side rises like a root, as a modulus does from where multipliers meet."""
    s, away = u[0] - u[1], u - 0.6
    steep = 0.5 / np.sqrt(s) if s > 0.0 else -0.5
    value = 2.0 + (np.sqrt(s) if s > 0.0 else -0.5 * s) + away @ away + 0.2 * u[0]
    return {"speed": (value, 2.0 * away + [0.2 + steep, -steep])}


@pytest.mark.parametrize(
    ("count", "function"),
    [
        *((k, ridge(steep)) for k in (2, 3, 5) for steep in (1.0, 30.0)),
        *((k, largest_of(k, n, s)) for k, n, s in ((2, 3, 0), (2, 6, 1), (3, 5, 0), (4, 8, 1))),
        (2, curved),
        (2, rooted),
    ],
)
def test_no_design_round_the_end_is_better(count, function):
    runs = best_of(count, function)
    assert runs.outcome() in (Outcome.CONVERGED, Outcome.CORNER)
    assert gained(runs, function) < 2e-6


@pytest.mark.parametrize("optimiser", ["trust-region", "slsqp", "trust-constr"])
def test_a_ridge_ends_at_its_foot(optimiser):
    """On u₁ = u₂ the derivative along it is that of (u₁ − ½)² + 0.3 (u₁ − ½)."""
    runs = best_of(2, ridge(1.0), optimiser=optimiser)
    assert runs.best.u == pytest.approx([0.35, 0.35], abs=2e-3)
    assert runs.outcome() is Outcome.CORNER  # no multipliers meet there


def test_designs_that_are_scattered_count_as_iterations():
    """After 34 it would scatter ten about the best, when two more are allowed."""
    runs = best_of(4, largest_of(4, 6, 2), iterations=36)
    assert len(runs.history) == 1 + 36
    assert not runs.ended.converged


@pytest.mark.parametrize("kind", ["real", "conjugate"])
def test_the_conditions_hold_where_all_three_multipliers_lie_inside(kind):
    random = np.random.default_rng(2)
    for _ in range(500):
        three = random.uniform(-0.6, 0.6, 3).astype(complex)
        if kind == "conjugate":
            three[1] = random.uniform(0.1, 0.6) * np.exp(1j * random.uniform(0.0, np.pi))
            three[2] = np.conj(three[1])
        symmetric = np.real(np.poly(three))[1:] * [-1.0, 1.0, -1.0]
        told = conditions(symmetric, 0.4)
        assert (np.min(told.values) > 0.0) == (np.max(np.abs(three)) < 0.4)
        assert radius_of(symmetric) == pytest.approx(np.max(np.abs(three)), rel=1e-6)
        along = random.standard_normal(3)
        by_symmetric = difference(lambda h, s=symmetric, a=along: conditions(s + h * a, 0.4).values)
        np.testing.assert_allclose(told.by_symmetric @ along, by_symmetric, atol=1e-7)
        by_radius = difference(lambda h, s=symmetric: conditions(s, 0.4 + h).values)
        np.testing.assert_allclose(told.by_radius, by_radius, atol=1e-6)


def test_a_condition_is_kept_too_well_by_three_tenths_of_its_error_within_a_range():
    """By 1e-7 at least, of what is known exactly, and by 1e-5 at most."""
    values = np.array([0.5, 0.08, 0.004])
    known = (dict(zip(SYMMETRIC, values, strict=True)),) * 4
    for place, along in enumerate(conditions(values, 0.4).by_symmetric):
        for error, margin in ((0.0, 1e-7), (1e-5, 3e-6), (1e-3, 1e-5)):
            errors = np.full(3, error / np.abs(along).sum())
            row = ClusterRow("spectral_radius", 0.4, -1.0, False, place, tuple(errors))
            assert row.margin(known) == pytest.approx(margin)


def test_a_radius_is_least_where_two_multipliers_meet():
    """λ = 0.6 ± √(u₁ − ½ + (u₂ − ½)²) + (u₂ − 0.7)²: least, 0.6, at u₂ = 0.7 on the parabola."""

    def function(u):
        mean, by_mean = 0.6 + (u[1] - 0.7) ** 2, np.array([0.0, 2.0 * (u[1] - 0.7)])
        inside, by_inside = u[0] - 0.5 + (u[1] - 0.5) ** 2, np.array([1.0, 2.0 * (u[1] - 0.5)])
        product, by_product = mean**2 - inside, 2.0 * mean * by_mean - by_inside
        roots = np.roots([1.0, -2.0 * mean, product])
        return {  # beside a third multiplier of 0.1
            "symmetric_1": (2.0 * mean + 0.1, 2.0 * by_mean),
            "symmetric_2": (product + 0.2 * mean, by_product + 0.2 * by_mean),
            "symmetric_3": (0.1 * product, 0.1 * by_product),
            "spectral_radius": (np.max(np.abs([*roots, 0.1])), np.full(2, np.nan)),
            "next_modulus": (0.0, np.zeros(2)),
        }

    runs = best_of(2, function, "spectral_radius")
    # A conjugate pair's modulus is √(mean² − inside): it is least where `inside` is zero.
    assert runs.best.known.values["spectral_radius"] == pytest.approx(0.6, abs=1e-4)
    assert runs.best.u == pytest.approx([0.46, 0.7], abs=0.02)
    assert runs.outcome() is Outcome.CONVERGED


def test_a_bound_holds_at_a_triple_multiplier_to_a_millionth():
    """(λ − ½)³, all three coefficients free: the best design within |λ| ≤ ½ is the vertex."""

    def function(u):
        w = u - 0.5  # of (λ − ½)³ − w₁ (λ − ½)² − w₂ (λ − ½) − w₃
        three = np.roots([1.0, -w[0], -w[1], -w[2]]) + 0.5
        one = (1.5 + w[0], np.array([1.0, 0.0, 0.0]))
        two = (0.75 + w[0] - w[1], np.array([1.0, -1.0, 0.0]))
        last = (0.125 + 0.25 * w[0] - 0.5 * w[1] + w[2], np.array([0.25, -0.5, 1.0]))
        return {
            "symmetric_1": one, "symmetric_2": two, "symmetric_3": last,
            "spectral_radius": (float(np.max(np.abs(three))), np.full(3, np.nan)),
            "next_modulus": (0.0, np.zeros(3)),
            "speed": (2.0 - w[0] - 0.5 * w[1] - 0.2 * w[2], np.array([-1.0, -0.5, -0.2])),
        }  # fmt: skip

    runs = best_of(3, function, "speed", "spectral_radius<0.5")
    assert runs.best.known.values["spectral_radius"] <= 0.5 * (1.0 + 1e-6)
    assert runs.best.known.values["speed"] == pytest.approx(2.0, abs=0.01)
    told = optimality_of(runs.problem, runs.best)
    assert told.residual < 1e-3
    # The vertex moves with the bound ρ as λ = ρ does: w = (3, 0, 0) (ρ − ½) to first order.
    (held, _) = told.requirements
    assert held.multiplier == pytest.approx(-3.0, rel=0.05)


@pytest.mark.nightly
def test_a_walkers_radius_is_least_on_the_ridge_where_its_multipliers_meet():
    """No design round it is better by what the radius there is known to.

    At balanced, the residual is known to 1.007e-3 of the objective, which is too little.
    """
    best = jb.optimise_gait(
        SCENE,
        vary={"d": (0.05, 0.2), "J": (0.003, 0.02)},
        minimise="spectral_radius",
        accuracy="tight",
    )
    assert best.outcome is Outcome.CONVERGED
    assert best.objective < 0.180696  # of a grid of 61 by 121 designs about it
    assert best.optimality.residual < 1e-3
    d, J = best.variables["d"], best.variables["J"]
    for size in (1e-4, 1e-3, 1e-2):
        for angle in np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False):
            there = {
                "d": d * 4.0 ** (size * np.cos(angle)),
                "J": J * (20.0 / 3.0) ** (size * np.sin(angle)),
            }
            gait = jb.find_gait(
                jb.with_parameters(SCENE, there), best.gait.measures.state,
                parameters=(), radius_sensitivities=False,
            )  # fmt: skip
            assert float(gait.measures.spectral_radius) > best.objective * (1.0 - 1e-5)


@pytest.mark.nightly
def test_a_walkers_bound_is_kept_where_three_multipliers_meet():
    """Its certificate by central differences of the multipliers' symmetric functions."""
    scene = jb.seed_scene()
    own = {name: float(jb.parameter_values(scene)[name]) for name in ("d", "r", "J")}
    best = jb.optimise_gait(
        scene,
        vary={name: (0.5 * value, 2.0 * value) for name, value in own.items()},
        maximise="speed",
        subject_to="spectral_radius<0.4",
    )
    assert best.outcome is Outcome.CONVERGED
    assert best.known.values["spectral_radius"] <= 0.4 * (1.0 + 1e-6)
    assert best.optimality.residual < 1e-3
    tight = jb.find_gait(best.scene, best.gait.measures.state, accuracy="tight", parameters=())
    assert float(tight.measures.spectral_radius) <= 0.4 * (1.0 + 1e-6)
    names = list(own)

    def told(shift):
        values = {n: best.variables[n] * np.exp(x) for n, x in zip(names, shift, strict=True)}
        gait = jb.find_gait(
            jb.with_parameters(scene, values), best.gait.measures.state, accuracy="tight",
            parameters=(), radius_sensitivities=False,
        )  # fmt: skip
        three = np.sort_complex(np.asarray(gait.multipliers))[::-1]
        three = three[np.argsort(-np.abs(three))][:3]
        return np.append(np.real(np.poly(three))[1:] * [-1, 1, -1], float(gait.measures.speed))

    slopes = np.stack([difference(lambda h, e=e: told(h * e), 1e-3) for e in np.eye(3)], axis=1)
    centre = conditions(told(np.zeros(3))[:3], 0.4)
    # Multipliers of the active conditions, at least zero, balance the speed.
    active = centre.by_symmetric[centre.values < 0.1]
    left = lsq_linear((active @ slopes[:3]).T, -slopes[3], (0.0, np.inf))
    assert np.max(np.abs(left.fun)) < 1e-3
