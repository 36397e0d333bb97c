"""The smallest fatal push against nearest points in closed form."""

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.basins._label_oracle import LabelOracle
from jaxbiped.basins._rays import Brackets, GivenNormals, Surroundings, descend_rays
from tests.basins.known_basins import Recorded, ball, half_space

TOLERANCE = 1e-4
ORIGINS = {1: [0.3], 2: [0.3, -2.0], 6: [0.3, -2.0, 0.0, 5.0, 1.0, -0.4]}


def _plane(d):
    """A half-space 0.8 from the origin in scaled coordinates, its normal along no axis."""
    random = np.random.default_rng(d)
    origin, scales = np.asarray(ORIGINS[d]), random.uniform(0.1, 3.0, d)
    unit = random.normal(size=d)
    unit /= np.linalg.norm(unit)
    normal = unit / scales
    label_of = half_space(normal, normal @ origin + 0.8)
    return label_of, origin, scales, unit, (lambda x: np.tile(-7.0 * normal, (len(x), 1)))


def _push(label_of, origin, scales, normal=None, **options):
    right = {"max_distance": 3.0, "tolerance": TOLERANCE}
    return jb.basins.minimal_fatal_shock(
        label_of, origin, scales=scales, normal=normal, **(right | options)
    )


def _consistent(found, label_of, origin, scales, tolerance=TOLERANCE):
    """What holds of every push that was found."""
    np.testing.assert_allclose(found.push, scales * found.direction * found.distance)
    assert np.linalg.norm(found.direction) == pytest.approx(1.0)
    assert label_of((origin + found.push)[None])[0] == found.label != found.origin_label
    gap = np.linalg.norm((origin + found.push - found.boundary_point) / scales)
    assert gap <= 0.51 * tolerance
    assert found.distance <= found.bisected_distance
    assert found.found


@pytest.mark.parametrize("with_normal", [True, False])
@pytest.mark.parametrize("d", [1, 2, 6])
def test_nearest_point_of_a_plane(d, with_normal):
    label_of, origin, scales, unit, normal = _plane(d)
    asked = Recorded(label_of)
    found = _push(asked, origin, scales, normal if with_normal else None)
    _consistent(found, label_of, origin, scales)
    assert found.distance == pytest.approx(0.8, abs=1.5 * TOLERANCE)
    assert found.distance >= 0.8
    np.testing.assert_allclose(found.direction, unit, atol=0.02)
    np.testing.assert_allclose(found.push, 0.8 * unit * scales, atol=0.05)
    assert found.angle < (0.002 if with_normal else 0.012)
    assert (found.asked, found.calls) == (len(asked.points), len(asked.calls))
    assert (found.origin_label, found.label) == (0, 1)


@pytest.mark.parametrize("with_normal", [True, False])
@pytest.mark.parametrize("d", [1, 2, 6])
def test_shortest_axis_of_an_ellipsoid(d, with_normal):
    """The basin is {|A (x − origin)| < 1}: in scaled coordinates the distance is 1 / σ_max."""
    random = np.random.default_rng(10 + d)
    origin, scales = np.asarray(ORIGINS[d]), random.uniform(0.2, 2.0, d)
    axes = np.linalg.qr(random.normal(size=(d, d)))[0]
    A = np.diag(1.0 / np.linspace(0.7, 1.9, d)) @ axes.T
    label_of = lambda x: np.where(np.linalg.norm((x - origin) @ A.T, axis=1) < 1.0, 4, 2)
    normal = lambda x: (x - origin) @ A.T @ A
    found = _push(label_of, origin, scales, normal if with_normal else None, max_distance=20.0)
    true = 1.0 / np.linalg.svd(A * scales, compute_uv=False)[0]
    _consistent(found, label_of, origin, scales)
    assert true <= found.distance <= true + 1.5 * TOLERANCE
    assert (found.origin_label, found.label) == (4, 2)
    aligned = np.sqrt(TOLERANCE / true)
    assert found.angle <= (0.1 * aligned if with_normal else aligned)


@pytest.mark.parametrize("with_normal", [True, False])
@pytest.mark.parametrize("d", [2, 6])
def test_nearest_point_of_a_ball_that_bulges_inward(d, with_normal):
    """Full turns to the normal overshoot here: the boundary's radius is half its distance."""
    centre = np.random.default_rng(20 + d).normal(size=d)
    centre *= 1.2 / np.linalg.norm(centre)
    label_of, origin, scales = ball(centre, 0.4), np.zeros(d), np.ones(d)
    found = _push(label_of, origin, scales, (lambda x: x - centre) if with_normal else None)
    _consistent(found, label_of, origin, scales)
    assert 0.8 <= found.distance <= 0.8 + 1.5 * TOLERANCE
    if d == 6:
        assert found.bisected_distance > 0.81


def test_where_half_a_turn_passes_a_narrow_ball_by_a_quarter_meets_it_at_once():
    """Met near its edge, 0.24 rad from its centre: there the normal lies 72 degrees away."""
    centre, radius, angle = np.array([1.0, 0.0]), 0.25, -0.24
    distance = np.cos(angle) - np.sqrt(radius**2 - np.sin(angle) ** 2)
    asked = Recorded(ball(centre, radius))
    around = Surroundings(LabelOracle(asked, 100), np.zeros(2), np.ones(2), 0)
    direction = np.array([[np.cos(angle), np.sin(angle)]])
    near = np.array([distance - 0.5 * TOLERANCE]), np.array([distance + 0.5 * TOLERANCE])
    begin = Brackets(direction, *near, around.labels(direction, near[1]))
    found, _ = descend_rays(around, begin, GivenNormals(around, lambda x: x - centre), TOLERANCE)
    at_first = asked.calls[1]
    assert (asked(at_first) != 0).sum() == 1
    assert float(found.outside[0]) == pytest.approx(0.75, abs=2.0 * TOLERANCE)


@pytest.mark.parametrize("seed", range(6))
def test_an_edge_that_points_inward_is_found_roughly(seed):
    """No normal exists at the nearest point: rays beside the best one are tried."""
    one, two, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0].T
    label_of = lambda x: ((x @ one > 1.0) & (x @ two > 0.7)).astype(int)
    found = _push(label_of, np.zeros(3), np.ones(3))
    assert found.bisected_distance > np.hypot(1.0, 0.7) + 0.02
    assert found.distance == pytest.approx(np.hypot(1.0, 0.7), abs=0.02)


@pytest.mark.parametrize("seed", range(4))
def test_distance_by_bisection_alone_is_that_of_the_nearest_ray(seed):
    rays = np.random.default_rng(seed).normal(size=(300, 3))
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    normal = np.array([0.6, 0.0, 0.8])
    found = _push(half_space(normal, 0.9), np.zeros(3), np.ones(3), directions=rays, steps=8)
    nearest = 0.9 / np.max(rays @ normal)
    assert nearest <= found.bisected_distance <= nearest + TOLERANCE
    assert 0.9 <= found.distance <= 0.9 + 1.5 * TOLERANCE


def test_the_nearest_of_two_boundaries_and_its_label():
    def label_of(x):
        return np.where(x[:, 0] > 1.0, 3, np.where(x[:, 0] < -0.9, 5, 0))

    found = _push(label_of, np.zeros(2), np.ones(2))
    assert (found.label, found.distance) == (5, pytest.approx(0.9, abs=1.5 * TOLERANCE))
    np.testing.assert_allclose(found.direction, [-1.0, 0.0], atol=0.02)


@pytest.mark.parametrize(("steps", "distance"), [(60, 1.0), (6, 2.5)])
def test_a_ray_that_enters_the_basin_again_exits_first(steps, distance):
    """Another basin from 1.0 to 1.1 and beyond 2.5: seen by short steps, stepped over by long."""
    label_of = lambda x: (((x > 1.0) & (x < 1.1)) | (x > 2.5)).any(axis=1).astype(int)
    found = _push(label_of, [0.0], [1.0], max_distance=3.9, steps=steps)
    assert found.distance == pytest.approx(distance, abs=1.5 * TOLERANCE)


def test_marching_goes_on_past_the_first_exit():
    """The ray that exits farther out, askew, is the one that leads to the nearer boundary."""
    label_of = lambda x: ((x[:, 0] > 1.0) | (x[:, 0] < -0.9)).astype(int)
    found = _push(label_of, np.zeros(2), np.ones(2), directions=[[1.0, 0.0], [-1.0, 1.0]])
    assert found.bisected_distance == pytest.approx(1.0, abs=1.5 * TOLERANCE)
    assert found.distance == pytest.approx(0.9, abs=1.5 * TOLERANCE)


def test_nothing_found_says_so():
    label_of = Recorded(lambda x: np.full(len(x), 7))
    found = _push(label_of, np.zeros(2), np.ones(2), directions=32, steps=8)
    assert not found.found
    assert np.isinf([found.distance, found.bisected_distance]).all()
    assert found.label == found.origin_label == 7
    assert np.isnan([*found.push, *found.direction, *found.boundary_point, found.angle]).all()
    assert found.asked == len(label_of.points) == 1 + 32 * 8
    max_distance = np.linalg.norm(label_of.points, axis=1).max()
    assert max_distance == pytest.approx(3.0)


def test_rays_without_a_normal_are_left_as_they_are():
    label_of, origin, scales, _, _ = _plane(6)
    unknown = _push(label_of, origin, scales, lambda x: np.full_like(x, np.nan))
    unimproved = _push(label_of, origin, scales, improved=0)
    assert unknown.distance == unknown.bisected_distance == unimproved.distance > 0.81
    assert np.isnan([unknown.angle, unimproved.angle]).all()
    _consistent(unknown, label_of, origin, scales)


def test_batches_are_bounded_and_change_little():
    label_of, origin, scales, _, normal = _plane(6)
    small, large = Recorded(label_of), Recorded(label_of)
    one = _push(small, origin, scales, normal, batch=40)
    two = _push(large, origin, scales, normal, batch=10**6)
    assert max(map(len, small.calls)) == 40
    assert len(large.calls) < len(small.calls)
    assert one.distance == pytest.approx(two.distance, abs=1.5 * TOLERANCE)


def test_directions_may_be_given():
    label_of = half_space((0.0, 1.0), 0.5)
    found = _push(label_of, np.zeros(2), np.ones(2), directions=[[3.0, 3.0]], improved=0)
    assert found.distance == pytest.approx(0.5 * np.sqrt(2.0), abs=1.5 * TOLERANCE)
    np.testing.assert_allclose(found.direction, np.sqrt([0.5, 0.5]))
    turned = _push(label_of, np.zeros(2), np.ones(2), directions=[[3.0, 3.0]])
    assert turned.distance == pytest.approx(0.5, abs=1.5 * TOLERANCE)


def test_turns_that_never_help_are_given_up():
    """A square whose gradient is that of its diagonal: the nearest point stays that of a side."""
    points = []

    def outside(x):
        points.append(len(x))
        return (np.max(np.abs(x - 0.1), axis=1) > 1.0).astype(int)

    shock = jb.basins.minimal_fatal_shock(
        outside, np.zeros(2), scales=np.ones(2), max_distance=3.0, tolerance=1e-6,
        normal=lambda x: np.ones_like(x),
    )  # fmt: skip
    assert shock.distance == pytest.approx(0.9, abs=2e-6)
    # Thirty rounds of turns, of the kind that is halved each time, would ask for 17,000.
    assert sum(points) < 4000
