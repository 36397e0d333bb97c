"""Local models of designs, against quadratic programs with known solutions and scans of radii."""

from types import SimpleNamespace

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.optimise import Outcome, _runs
from jaxbiped.optimise._design_functions import radius_of
from jaxbiped.optimise._design_problem import Design, variables_of
from jaxbiped.optimise._local_model import Local, Model
from jaxbiped.optimise._runs import RunEnding, Runs, rank_of

MIDDLE = np.array([0.5, 0.4])
FREE = np.zeros(0), np.zeros((0, 2)), np.zeros(0, bool)


def symmetric(*multipliers):
    """Elementary symmetric functions."""
    a, b, c = multipliers
    return np.array([a + b + c, a * b + a * c + b * c, a * b * c])


def local(gradient, spare=FREE, u=MIDDLE, objective=1.0, **more):
    return Local(np.array(u), objective, np.array(gradient), *map(np.asarray, spare), **more)


CURVED = np.array([[4.0, 1.0], [1.0, 3.0]])


def test_a_step_without_requirements_is_newtons_or_ends_at_a_bound():
    gradient = np.array([0.2, -0.1])
    model = Model(local(gradient), [], CURVED)
    step, missed = model.step(1.0, 10.0)
    np.testing.assert_allclose(step, -np.linalg.solve(CURVED, gradient), atol=1e-6)
    assert missed == 0.0
    expected = 1.0 + gradient @ step + 0.5 * step @ CURVED @ step
    assert model.merit(step, 10.0) == pytest.approx(expected)
    short, _ = model.step(0.02, 10.0)
    assert np.max(np.abs(short)) == pytest.approx(0.02)
    flat = Model(local([1.0, -1.0]), [], np.zeros((2, 2)))
    np.testing.assert_allclose(flat.step(0.3, 1.0)[0], [-0.3, 0.3])
    np.testing.assert_allclose(flat.step(0.9, 1.0)[0], [-0.5, 0.6])  # the variables' own bounds
    assert flat.here.merit(3.0) == 1.0


@pytest.mark.parametrize("equal", [False, True])
@pytest.mark.parametrize("spare", [-0.1, 0.0, 0.2])
def test_a_requirement_is_kept_by_the_nearest_step_that_keeps_it(equal, spare):
    """Towards zero spare along (1, 1), against a bowl about the design."""
    there = [spare], [[1.0, 1.0]], [equal]
    model = Model(local([0.0, 0.0], there), [], np.eye(2))
    step, missed = model.step(0.9, 100.0)
    needed = -spare if equal else max(-spare, 0.0)
    np.testing.assert_allclose(step, [0.5 * needed] * 2, atol=1e-6)
    assert missed == pytest.approx(0.0, abs=1e-6)
    assert model.violation(np.zeros(2)) == pytest.approx(abs(spare) if equal else max(-spare, 0.0))
    assert model.violation(np.array([-0.3, 0.0])) == pytest.approx(
        abs(spare - 0.3) if equal else max(0.3 - spare, 0.0)
    )
    value = 0.5 * 0.09 + 1.0 + 7.0 * model.violation(np.array([-0.3, 0.0]))
    assert model.merit(np.array([-0.3, 0.0]), 7.0) == pytest.approx(value)


def test_two_requirements_miss_what_both_miss():
    there = [-0.1, 0.2], [[1.0, 0.0], [0.0, 1.0]], [False, True]
    model = Model(local([0.0, 0.0], there), [], np.eye(2))
    assert model.violation(np.zeros(2)) == pytest.approx(0.3)
    assert model.violation(np.array([0.1, -0.2])) == pytest.approx(0.0)


def test_other_designs_bound_the_sum_and_what_is_to_spare():
    """Cuts above its value are lowered to it, and by a thousandth of the squared distance."""
    here = local([1.0, 0.0])
    move = np.array([-0.2, 0.0])
    for value, lowered in ((0.5, 0.5), (3.0, 1.0 - 1e-3 * 0.04 + 0.2)):
        cut = local([-1.0, 0.0], u=MIDDLE - [0.2, 0.0], objective=value)
        model = Model(here, [cut], np.zeros((2, 2)))
        assert model.merit(move, 1.0) == pytest.approx(max(1.0 - 0.2, lowered))
        assert model.merit(np.array([-0.4, 0.0]), 1.0) == pytest.approx(max(0.6, lowered + 0.2))
    wedge = local([-1.0, 0.0], u=MIDDLE - [0.2, 0.0], objective=0.95)
    step, _ = Model(here, [wedge], np.zeros((2, 2))).step(0.4, 1.0)
    assert step[0] == pytest.approx(-0.125, abs=1e-6)  # where 1 + s = 0.95 − (s + 0.2)
    there = [0.3], [[1.0, 0.0]], [False]
    tight = local(
        [1.0, 0.0], ([0.05], [[1.0, 0.0]], [False]), u=MIDDLE - [0.1, 0.0], objective=-9.0
    )
    model = Model(local([1.0, 0.0], there), [tight], np.zeros((2, 2)))
    assert model.violation(np.array([-0.2, 0.0])) == pytest.approx(0.05)
    equal = tight._replace(equal=np.array([True]))
    both = Model(local([1.0, 0.0], ([0.3], [[1.0, 0.0]], [True])), [equal], np.zeros((2, 2)))
    assert both.violation(np.zeros(2)) == pytest.approx(0.3)


def test_linearisations_are_raised_to_what_another_design_has():
    here = local(
        [1.0, 2.0], ([0.3], [[1.0, -1.0]], [False]), cluster=symmetric(0.5, 0.2, 0.1),
        cluster_gradients=np.array([[1.0, 0.0], [0.0, 1.0], [0.5, 0.5]]), next=0.05,
        next_gradient=np.array([0.1, 0.2]),
    )  # fmt: skip
    move = np.array([0.1, -0.2])
    there = here._replace(u=here.u + move, spare=np.array([0.9]), cluster=np.ones(3), next=0.4)
    exact = here.exact_at(there)
    assert (exact.spare + exact.spare_gradients @ move).tolist() == pytest.approx([0.9])
    np.testing.assert_allclose(exact.cluster + exact.cluster_gradients @ move, 1.0)
    assert exact.next + exact.next_gradient @ move == pytest.approx(0.4)
    assert exact.objective == here.objective
    np.testing.assert_array_equal(exact.gradient, here.gradient)


def with_radius(**more):
    """Multipliers 0.6 and ±0.3, whose symmetric functions move along one variable."""
    return local(
        [0.0], (np.zeros(0), np.zeros((0, 1)), np.zeros(0, bool)), u=[0.5], objective=0.0,
        cluster=symmetric(0.6, 0.3, -0.3), cluster_gradients=np.array([[1.0], [-0.3], [0.2]]),
        next=0.1, next_gradient=np.array([-1.0]), **more,
    )  # fmt: skip


def test_the_radius_is_the_largest_modulus_of_the_cluster_or_of_the_others():
    here = with_radius(weight=1.0)
    assert here.has_radius
    assert here.radius(np.zeros(1)) == pytest.approx(0.6)
    assert here.radius(np.array([-0.9])) == pytest.approx(
        max(1.0, radius_of(here.cluster - 0.9 * here.cluster_gradients[:, 0]))
    )
    assert not with_radius().has_radius
    assert with_radius(bound=0.9).has_radius


def test_a_step_makes_the_radius_as_small_as_any_that_is_tried():
    here = with_radius(weight=2.0)
    model = Model(here, [], np.zeros((1, 1)))
    moves = np.linspace(-0.3, 0.3, 601)
    radii = [here.radius(np.array([move])) for move in moves]
    step, _ = model.step(0.3, 1.0)
    assert here.radius(step) == pytest.approx(min(radii), abs=1e-3)
    assert min(radii) < 0.55
    assert model.merit(step, 1.0) == pytest.approx(2.0 * here.radius(step))


def test_a_bound_of_the_radius_is_missed_relative_to_it():
    here = with_radius(bound=0.5)
    model = Model(here, [], np.eye(1))
    assert model.violation(np.zeros(1)) == pytest.approx(0.2)
    step, missed = model.step(0.4, 50.0)
    assert missed == pytest.approx(0.0, abs=1e-5)
    moves = np.linspace(-0.4, 0.4, 801)
    kept = [m for m in moves if here.radius(np.array([m])) <= 0.5]
    assert abs(step[0]) == pytest.approx(min(map(abs, kept)), abs=2e-3)


def problem_of(**more):
    usual = dict(
        excess=lambda known: known["excess"], allowance=lambda known: 0.1,
        objective=lambda known: SimpleNamespace(value=known["value"]), weights={"speed": 1.0},
    )  # fmt: skip
    return SimpleNamespace(**usual | more)


def design(excess, value):
    return Design(np.zeros(1), {"excess": excess, "value": value})


def test_designs_that_keep_requirements_come_before_better_ones_that_do_not():
    designs = [design(0.0, 3.0), design(0.0, 1.0), design(0.5, -9.0), design(0.2, 7.0)]
    ranked = sorted(designs, key=lambda each: rank_of(problem_of(), each))
    assert [each.known["value"] for each in ranked] == [1.0, 3.0, 7.0, -9.0]


@pytest.mark.parametrize(
    ("excess", "beyond", "converged", "doubt", "flat", "outcome"),
    [
        (0.2, ("speed",), True, "", False, Outcome.INFEASIBLE),
        (0.05, ("speed",), True, "", False, Outcome.BEYOND_RANGE),
        (0.05, ("period",), True, "", False, Outcome.CONVERGED),
        (0.0, (), False, "", False, Outcome.UNFINISHED),
        (0.0, (), True, "a doubt", False, Outcome.CORNER),
        (0.0, (), True, "", True, Outcome.FLAT),
    ],
)
def test_the_outcome_of_runs(excess, beyond, converged, doubt, flat, outcome):
    known = SimpleNamespace(excess=excess, value=1.0, beyond_range=beyond)
    problem = problem_of(
        asked=[Design(np.zeros(1), known)], excess=lambda known: known.excess,
        objective=lambda known: SimpleNamespace(value=known.value),
    )  # fmt: skip
    given = (problem.asked[0], converged, lambda: doubt, lambda: flat)
    assert _runs.outcome_of(problem, *given) is outcome
    runs = Runs(problem, 5, "trust-region", None, ended=RunEnding(converged, "words"))
    runs.interrupted = True
    assert runs.outcome() is Outcome.INTERRUPTED


def test_gaits_of_designs_are_followed_by_their_derivatives_in_four_steps():
    """A state that is quadratic in the variable, whose derivative is that where it was found."""
    scene = jb.ladder()["rigid"]
    names = jb.parameter_names(scene)
    variables = variables_of(scene, {"slope": (0.01, 0.05)})
    place = names.index("slope")
    seen = []

    def state(value):
        return np.array([value, 5.0 * value**2])

    def gaits(u, points):
        values = variables.values(u)[:, 0]
        seen.append((values, points))
        slopes = np.zeros((len(u), 2, len(names)))
        slopes[:, 0, place], slopes[:, 1, place] = 1.0, 10.0 * values
        return np.stack([state(value) for value in values]), slopes

    begin, u = np.array([0.5]), np.array([[0.1], [0.9]])
    first = float(variables.values(begin)[0])
    slopes = np.zeros((2, len(names)))
    slopes[0, place], slopes[1, place] = 1.0, 10.0 * first
    known = SimpleNamespace(state=state(first), state_slopes=slopes)
    found = _runs._followed(variables, Design(begin, known), u, gaits)
    before = np.full(2, first)
    for share, (values, points) in zip((0.25, 0.5, 0.75, 1.0), seen, strict=True):
        np.testing.assert_allclose(values, variables.values(begin + share * (u - begin))[:, 0])
        np.testing.assert_allclose(points[:, 0], values)
        guess = 5.0 * before**2 + 10.0 * before * (values - before)
        np.testing.assert_allclose(points[:, 1], guess)
        before = values
    np.testing.assert_allclose(found, [state(value) for value in variables.values(u)[:, 0]])
