"""Pseudo-arclength continuation, against curves in closed form, in sizes of their own."""

import itertools

import numpy as np
import pytest

from jaxbiped.gait._pseudo_arclength import (
    Change,
    Curve,
    StepControl,
    _interpolated,
    correct,
    follow,
    locate,
)

UNITS = (1.0, 1.0)
SIZES = [UNITS, (4.0, 1.0), (0.25, 1.0), (4.0, 0.2)]


def circle(sizes=UNITS, code=lambda x, s: 0):
    """The unit circle in a component and s, each in its size."""
    of_x, of_s = sizes

    def change(point, s):
        x, t = point[0] / of_x, s / of_s
        return Change(
            value=np.array([of_x * (x * x + t * t - 1.0)]),
            by_point=np.array([[2.0 * x]]),
            by_s=np.array([2.0 * of_x * t / of_s]),
            code=code(x, t),
            seen=(point[0], s),
        )

    return Curve(change, np.array(sizes), 1e-9)


@pytest.mark.parametrize("sizes", SIZES)
def test_places_are_in_sizes_and_what_is_evaluated_is_not(sizes):
    found = correct(circle(sizes), np.array([0.85, 0.6]))
    np.testing.assert_allclose(found.found.place, [0.8, 0.6], atol=1e-12)
    np.testing.assert_allclose(found.found.tangent, [-0.6, 0.8], atol=1e-6)
    x, s = found.found.change.seen
    assert (x / sizes[0], s / sizes[1]) == pytest.approx((0.8, 0.6), abs=1e-6)


def test_a_tangent_points_on_or_towards_larger_s():
    for way in (1.0, -1.0):
        begin = np.array([0.79, 0.61])
        along = way * np.array([-0.6, 0.8])
        there = correct(circle(), begin, along).found
        np.testing.assert_allclose(there.tangent, along, atol=0.03)
        assert (there.place - begin) @ along == pytest.approx(0.0, abs=1e-12)
        held = correct(circle(), begin, along, holds_s=True).found
        assert held.place[-1] == pytest.approx(0.61, abs=1e-12)
        assert held.tangent @ along > 0.9


def test_corrections_that_get_no_smaller_end_unless_one_is_patient():
    """Newton's method for the arctangent's zero leaps over it from beyond 1.39."""

    def change(point, s):
        x = point[0]
        shifted = np.array([np.arctan(x) + 0.3 * np.sin(x)])
        return Change(shifted, np.array([[1.0 / (1.0 + x * x)]]), np.zeros(1), 0, None)

    curve = Curve(change, np.ones(2), 1e-9)
    assert correct(curve, np.array([2.0, 0.0])).found is None
    assert correct(circle(), np.array([0.8001, 0.6])).quick
    assert not correct(circle(), np.array([2.5, 0.6])).quick


def test_a_failure_is_told_by_its_code_and_a_singular_matrix_is_none():
    lost = correct(circle(code=lambda x, s: 7), np.array([0.8, 0.6]))
    assert (lost.found, lost.code) == (None, 7)
    flat = Curve(
        lambda point, s: Change(np.ones(1), np.zeros((1, 1)), np.zeros(1), 0, None),
        np.ones(2),
        1e-9,
    )
    assert correct(flat, np.array([0.8, 0.6])).found is None


CONTROL = StepControl(first=0.05, largest=0.2, smallest=1e-5, least_cosine=0.95, aside=0.05)


@pytest.mark.parametrize("sizes", SIZES)
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_curve_is_followed_from_bound_to_bound(sizes, way):
    curve = circle(sizes)
    begin = correct(curve, np.array([1.0, 0.0])).found
    begin = begin._replace(tangent=way * begin.tangent)
    bounds = dict(low=-0.9 * sizes[1], high=0.9 * sizes[1])
    points = [each.found for each in follow(curve, begin, CONTROL, **bounds)]
    assert points[-1].place[-1] == pytest.approx(0.9 * way, abs=1e-12)
    angles = [0.0, *(way * np.arctan2(point.place[1], point.place[0]) for point in points)]
    steps = np.diff(angles)
    assert steps[0] == pytest.approx(0.05, abs=1e-3)
    assert (steps > 0.0).all()
    assert steps.max() < 0.21
    assert steps[:3] == pytest.approx(0.05 * 1.7 ** np.arange(3), rel=0.02)
    assert max(steps) > 0.18
    for point in points:
        np.testing.assert_allclose(np.linalg.norm(point.place), 1.0, atol=1e-9)
        assert point.tangent @ point.place == pytest.approx(0.0, abs=1e-5)


def test_a_fold_is_passed_and_steps_are_short_where_a_curve_bends():
    curve, control = circle(), CONTROL._replace(largest=2.0)
    begin = correct(curve, np.array([1.0, 0.0])).found
    points = [each.found for each in itertools.islice(follow(curve, begin, control), 40)]
    places = np.stack([point.place for point in points])
    turns = np.diff(np.unwrap(np.arctan2(places[:, 1], places[:, 0])))
    assert (turns > 0.0).all()
    assert turns.sum() > 2.0 * np.pi
    assert np.cos(turns).min() > 0.95


def test_what_is_unlikely_is_tried_with_shorter_steps():
    curve = circle()
    begin = correct(curve, np.array([1.0, 0.0])).found
    asked = []

    def is_likely(here, there):
        asked.append(np.linalg.norm(there.place - here.place))
        return asked[-1] < 0.01

    first = next(follow(curve, begin, CONTROL, is_likely=is_likely))
    assert np.linalg.norm(first.found.place - begin.place) < 0.01
    assert asked == pytest.approx([0.05, 0.02, 0.008], rel=1e-2)


def test_a_curve_that_ends_is_told_by_what_came_there():
    curve = circle(code=lambda x, s: 5 if s > 0.5 else 0)
    begin = correct(curve, np.array([1.0, 0.0])).found
    *points, last = follow(curve, begin, CONTROL)
    assert (last.found, last.code) == (None, 5)
    assert points[-1].found.place[-1] == pytest.approx(0.5, abs=1e-3)
    assert points[-1].found.place[-1] < 0.5


@pytest.mark.parametrize("sizes", SIZES)
def test_a_zero_is_located_between_two_points(sizes):
    curve = circle(sizes)
    begin = correct(curve, np.array([1.0, 0.0])).found
    step = next(follow(curve, begin, CONTROL._replace(first=0.3, largest=0.3, aside=np.inf)))
    test = lambda point: point.place[1] ** 3 - 0.1**3
    found = locate(curve, begin, step.found, test)
    assert found.place == pytest.approx((np.sqrt(0.99), 0.1), abs=1e-6)
    assert found.tangent @ found.place == pytest.approx(0.0, abs=1e-5)


@pytest.mark.parametrize("sizes", SIZES)
def test_a_zero_is_interpolated_between_points_beside_it(sizes):
    curve = circle(sizes)
    begin = correct(curve, np.array([1.0, 0.0])).found
    step = next(follow(curve, begin, CONTROL._replace(first=0.3, largest=0.3, aside=np.inf)))
    test = lambda point: point.place[1] - 0.15
    found = _interpolated(curve, begin, step.found, 0.148, test, 0.05)
    assert found.place == pytest.approx((np.sqrt(1.0 - 0.15**2), 0.15), abs=1e-5)
    assert found.tangent == pytest.approx((-0.15, np.sqrt(1.0 - 0.15**2)), abs=1e-4)
    assert found.change.seen == pytest.approx(tuple(found.place * sizes))
    assert _interpolated(curve, begin, step.found, 0.25, test, 0.01) is None


def test_of_several_components_the_parameter_is_the_last():
    """(s², s³) in sizes of their own: a guess's own s is kept."""
    sizes = np.array([4.0, 0.5, 1.0])

    def change(point, s):
        x, y = point
        by_point, by_s = np.diag([-1.0, -1.0]), np.array([2.0 * s, 3.0 * s * s])
        return Change(np.array([s * s - x, s**3 - y]), by_point, by_s, 0, None)

    there = correct(Curve(change, sizes, 1e-9), np.array([0.0, 0.1, 0.7])).found
    np.testing.assert_allclose(there.place, np.array([0.49, 0.343, 0.7]) / sizes, atol=1e-12)
    along = np.array([1.4, 1.47, 1.0]) / sizes
    np.testing.assert_allclose(there.tangent, along / np.linalg.norm(along), atol=1e-9)
