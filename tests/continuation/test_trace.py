"""Branches of maps, against bifurcations that are known in closed form."""

import numpy as np
import pytest

from jaxbiped import Ending
from jaxbiped.continuation import BranchEvent
from jaxbiped.continuation._branch_point import is_stable
from jaxbiped.continuation._cycle import NO_WALK
from jaxbiped.continuation._trace import passed_before, trace
from jaxbiped.gait import BranchEnd
from tests.continuation.maps import (
    begin_at,
    curve_of,
    delayed_logistic,
    logistic,
    pitchfork,
    saddle_node,
)

USUAL = dict(largest_step=0.05, max_points=200)


def traced(curve, axis, point, value, *, way=1.0, **options):
    """The curve from the fixed point near a point, towards larger values or the other `way`."""
    begin = begin_at(curve, axis, point, value)
    return trace(curve, axis, begin._replace(tangent=way * begin.tangent), **USUAL | options)


LOWER_OF_TWO = (4.2 - np.sqrt(4.2 * 0.2)) / 6.4
"""A point of the logistic map's cycle of two at 3.2."""


@pytest.mark.parametrize(
    ("family", "start", "kind", "value", "multiplier", "tolerance"),
    [
        (logistic((2.0, 4.0)), ([0.5], 2.0), BranchEvent.PERIOD_DOUBLING, 3.0, -1.0, 1e-9),
        (
            logistic((3.2, 3.6), footsteps=2),
            ([LOWER_OF_TWO], 3.2),
            *(BranchEvent.PERIOD_DOUBLING, 1.0 + np.sqrt(6.0), -1.0, 1e-9),
        ),
        (saddle_node((-0.5, 0.5)), ([0.5], 0.25), BranchEvent.FOLD, 0.0, 1.0, 1e-12),
        (
            delayed_logistic((1.5, 2.2)),
            ([1.0 / 3.0] * 2, 1.5),
            *(BranchEvent.NEIMARK_SACKER, 2.0, np.exp(1j * np.pi / 3.0), 1e-9),
        ),
        # Where branches cross is no fold.
        (pitchfork((-0.5, 0.5)), ([0.0], -0.4), BranchEvent.BRANCH_POINT, 0.0, 1.0, 1e-8),
    ],
    ids=["doubling", "second doubling", "fold", "Neimark–Sacker", "crossing"],
)
def test_a_bifurcation_is_located(family, start, kind, value, multiplier, tolerance):
    (event,) = traced(*family, *start, way=-1.0 if kind is BranchEvent.FOLD else 1.0).bifurcations
    assert event.kind is kind
    assert event.value == pytest.approx(value, abs=tolerance)
    told = complex(event.multiplier.real, abs(event.multiplier.imag))
    assert told == pytest.approx(multiplier, abs=max(tolerance, 1e-9))


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize(("doubling", "crossing"), [(0.006, 0.002), (0.002, 0.006)])
def test_two_bifurcations_within_one_step_are_in_their_order(doubling, crossing, way):
    """(x, y) → (−x (1 + r − a), y (1 + r − b − y²)): a doubling at r = a, branches cross at b."""
    family = curve_of(
        lambda x, r: np.array(
            [-x[0] * (1.0 + r - doubling), x[1] * (1.0 + r - crossing) - x[1] ** 3]
        ),
        lambda x, r: np.array(
            [
                [doubling - r - 1.0, 0.0, -x[0]],
                [0.0, 1.0 + r - crossing - 3.0 * x[1] ** 2, x[1]],
            ]
        ),
        (-0.5, 0.5),
    )
    found = traced(*family, [0.0, 0.0], -0.4 * way, way=way)
    expected = [(doubling, BranchEvent.PERIOD_DOUBLING), (crossing, BranchEvent.BRANCH_POINT)]
    expected = sorted(expected, key=lambda event: way * event[0])
    assert [event.kind for event in found.bifurcations] == [kind for _, kind in expected]
    values = [event.value for event in found.bifurcations]
    assert values == pytest.approx([value for value, _ in expected], abs=1e-8)
    between = [min(values) < point.value < max(values) for point in found.points]
    assert sum(between) == 0


def test_the_points_beside_a_doubling_have_its_multipliers():
    found = traced(*logistic((2.0, 4.0)), [0.5], 2.0)
    assert found.bifurcations[0].value_error < 1e-9
    assert found.stop.end is BranchEnd.REACHED
    assert found.points[-1].value == pytest.approx(4.0, abs=1e-9)
    for point in found.points:
        assert point.recurring[0] == pytest.approx(1.0 - 1.0 / point.value, abs=1e-9)
        assert point.multipliers[0] == pytest.approx(2.0 - point.value, abs=1e-8)
    stable = [point.stable for point in found.points]
    assert stable.count(None) == 1
    assert stable == sorted(stable, key=[True, None, False].index)


def test_a_fold_is_passed():
    found = traced(*saddle_node((-0.5, 0.5)), [0.5], 0.25, way=-1.0)
    assert found.points[0].stable is True
    assert found.points[-1].stable is False
    assert found.points[-1].recurring[0] == pytest.approx(-np.sqrt(0.5), abs=1e-9)


def test_the_value_of_a_bifurcation_is_off_by_where_the_witness_has_it():
    """A witness whose multiplier is larger by a part of it doubles so much earlier."""
    curve, axis = logistic((2.0, 4.0))
    part = 1e-6

    def change(point, s):
        exact = curve.change(point, s)
        jacobian = exact.seen.jacobian.copy()
        jacobian[1, 0, 0] *= 1.0 + part
        return exact._replace(seen=exact.seen._replace(jacobian=jacobian))

    (event,) = traced(curve._replace(change=change), axis, [0.5], 2.0).bifurcations
    # The multiplier is 2 − r. Beside the bifurcation it is larger, and its error with it.
    assert event.value_error == pytest.approx(part, rel=0.1)


def test_two_real_multipliers_of_product_one_are_no_bifurcation():
    """Multipliers 2 and r: their product passes 1 at r = 1/2, where neither lies on the circle."""
    family = curve_of(
        lambda x, r: np.array([2.0 * x[0], r * x[1]]),
        lambda x, r: np.array([[2.0, 0.0, 0.0], [0.0, r, x[1]]]),
        (0.2, 0.8),
    )
    assert traced(*family, [0.0, 0.0], 0.3).bifurcations == []


@pytest.mark.parametrize(
    ("code", "end", "words"),
    [
        (int(Ending.FELL_FORWARD), BranchEnd.WALK_ENDS, "fell forward"),
        (int(Ending.STUMBLED), BranchEnd.WALK_ENDS, "scuffing"),
        (int(Ending.TIMED_OUT), BranchEnd.WALK_ENDS, "no touch"),
        (NO_WALK, BranchEnd.NO_WALK, "underground"),
    ],
)
def test_a_limit_of_the_model_is_named(code, end, words):
    family = logistic((2.0, 4.0), code=lambda x, r: code if r > 2.5 else 0)
    found = traced(*family, [0.5], 2.0)
    (limit,) = found.bifurcations
    assert limit.kind is BranchEvent.LIMIT
    assert found.stop.end is end
    assert words in found.stop.cause
    assert limit.value == pytest.approx(2.5, abs=1e-4)
    assert limit.value < 2.5


def test_a_jump_of_the_map_is_named_grazing():
    family = curve_of(
        lambda x, r: np.array([0.5 * x[0] + r + 10.0 * (r > 0.6)]),
        lambda x, r: np.array([[0.5, 1.0]]),
        (0.0, 1.0),
    )
    found = traced(*family, [0.0], 0.0)
    assert found.stop.end is BranchEnd.BREAKS_OFF
    assert "grazing" in found.stop.cause
    assert found.stop.value == pytest.approx(0.6, abs=1e-4)


def test_a_crossing_that_is_not_located_has_an_entry_all_the_same():
    """The multiplier jumps over 1 at r = 1/2: no point has it there."""
    slope = lambda r: 0.5 + (r > 0.5)
    family = curve_of(
        lambda x, r: np.array([slope(r) * x[0]]),
        lambda x, r: np.array([[slope(r), 0.0]]),
        (0.0, 1.0),
    )
    (event,) = traced(*family, [0.0], 0.01).bifurcations
    assert event.kind is BranchEvent.NOT_LOCATED
    assert event.beyond <= 0.5 <= event.value
    assert event.value_error == pytest.approx(event.value - event.beyond)
    assert str(event).startswith("not-located between 0.4")


def test_a_closed_curve_is_passed_once_from_a_point_of_it_that_is_no_fold():
    """Fixed points on the circle x² + (r − 1/2)² = 1/16, with a fold at either end."""
    curve, axis = curve_of(
        lambda x, r: np.array([x[0] + 0.1 * (x[0] ** 2 + (r - 0.5) ** 2 - 0.0625)]),
        lambda x, r: np.array([[1.0 + 0.2 * x[0], 0.2 * (r - 0.5)]]),
        (0.0, 1.0),
    )
    begin = begin_at(curve, axis, [-0.25], 0.45)
    found = trace(curve, axis, begin, **USUAL)
    assert found.stop.end is BranchEnd.CLOSED
    assert [event.kind for event in found.bifurcations] == [BranchEvent.FOLD] * 2
    np.testing.assert_allclose([event.value for event in found.bifurcations], [0.75, 0.25])
    np.testing.assert_array_equal(found.points[-1].place, begin.place)
    # From a gait that was passed a branch goes no further, and says in which sense it came to it.
    for way, end in ((1.0, BranchEnd.CLOSED), (-1.0, BranchEnd.JUMPED)):
        onto = begin._replace(tangent=way * begin.tangent)
        again = trace(curve, axis, onto, passed=found.points, **USUAL)
        assert (again.stop.end, len(again.points), again.bifurcations) == (end, 1, [])


def test_sheets_that_a_fold_joins_are_no_gait_twice():
    curve, axis = saddle_node((-1e-4, 0.5))
    found = traced(curve, axis, [0.5], 0.25, way=-1.0, largest_step=0.2)
    assert found.stop.end is BranchEnd.REACHED
    place = found.points[3].place + 1e-3 * found.points[3].tangent
    again = begin_at(curve, axis, place[:1], axis.value(place[-1]))
    assert passed_before(curve, found.points, again) == pytest.approx(-1.0, abs=1e-6)


def test_it_stops_at_the_first_of_a_kind():
    found = traced(*logistic((2.0, 4.0)), [0.5], 2.0, until=(BranchEvent.PERIOD_DOUBLING,))
    assert found.points[-1].value == pytest.approx(3.0, abs=1e-9)
    assert found.stop.end is BranchEnd.UNFINISHED


def test_neighbouring_branches_are_not_mixed_up():
    """Two branches close by, x = r² and x = r² + 0.02: large steps must not change over."""

    def step(x, r):
        a, b = r * r, r * r + 0.02
        return np.array([x[0] + 4.0 * (x[0] - a) * (x[0] - b)])

    def slopes(x, r):
        a, b = r * r, r * r + 0.02
        by_x = 1.0 + 4.0 * (2.0 * x[0] - a - b)
        return np.array([[by_x, -4.0 * 2.0 * r * (2.0 * x[0] - a - b)]])

    found = traced(*curve_of(step, slopes, (0.0, 1.0)), [0.0], 0.0, largest_step=0.2)
    assert found.stop.end is BranchEnd.REACHED
    for point in found.points:
        assert point.recurring[0] == pytest.approx(point.value**2, abs=1e-7)


@pytest.mark.parametrize(
    ("values", "errors", "expected"),
    [
        ([0.9, 0.1], [0.05, 0.0], True),
        ([0.9, 0.1], [0.2, 0.0], None),
        ([-1.1, 0.1], [0.05, 0.0], False),
        ([-1.1, 0.1], [0.2, 0.0], None),
        ([0.2, 0.99j, -0.99j], [0.0, 0.02, 0.02], None),
        ([1.5, 1.0], [0.1, 0.1], False),
    ],
)
def test_what_an_error_bar_leaves_open_is_undecided(values, errors, expected):
    assert is_stable(np.array(values, complex), np.array(errors)) is expected


def test_ctrl_c_ends_a_branch_with_the_points_so_far():
    told = []

    def tell(point):
        told.append(point)
        if len(told) == 5:
            raise KeyboardInterrupt

    whole = traced(*logistic((2.0, 4.0)), [0.5], 2.0)
    part = traced(*logistic((2.0, 4.0)), [0.5], 2.0, tell=tell, interruptible=True)
    assert part.stop.end is BranchEnd.INTERRUPTED
    assert [p.value for p in part.points] == [p.value for p in whole.points[: len(part.points)]]
    assert part.points[-1].value == told[-1].value
    told.clear()
    with pytest.raises(KeyboardInterrupt):
        traced(*logistic((2.0, 4.0)), [0.5], 2.0, tell=tell)
