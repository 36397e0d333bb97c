"""Curves of bifurcations, against straight lines and a map that doubles along one."""

from types import SimpleNamespace

import numpy as np
import pytest

from jaxbiped.continuation import Axis, BranchEvent
from jaxbiped.continuation._bifurcation_curve import _extended_curve, _follow
from jaxbiped.continuation._trace import BOUND
from jaxbiped.gait import BranchEnd
from jaxbiped.gait._pseudo_arclength import Change, Curve, correct
from tests.continuation.maps import twice


def line(steepness):
    """Of places (s, t): s, the first parameter's, goes `steepness` times as fast as t."""

    def change(point, t):
        off = np.array([point[0] - 0.5 - steepness * (t - 0.5)])
        return Change(off, np.eye(1), np.array([-steepness]), 0)

    return Curve(change, np.ones(2), 1e-11)


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize("steepness", [2.0, -2.0, 0.5])
def test_a_curve_ends_where_it_leaves_the_range_of_either_parameter(steepness, way):
    curve = line(steepness)
    begin = correct(curve, np.array([0.5, 0.5])).found
    tangent = way * np.sign(begin.tangent[-1]) * begin.tangent
    points, stop = _follow(curve, begin._replace(tangent=tangent), 0.1, 200)
    places = np.array([point.place for point in points])
    assert (stop.end, stop.cause) == (BranchEnd.REACHED, BOUND)
    assert stop.value == places[-1, 1]
    within = (np.abs(places - 0.5) < 0.5).all(axis=1)
    assert within[:-1].all()
    assert not within[-1]
    np.testing.assert_allclose(places[:, 0] - 0.5, steepness * (places[:, 1] - 0.5), atol=1e-9)
    # The second parameter's range is kept exactly, the first one's is left by less than a step.
    if abs(steepness) < 1.0:
        assert places[-1, 1] == pytest.approx(0.5 + 0.5 * way, abs=1e-9)
    else:
        assert 0.5 < abs(places[-1, 0] - 0.5) < 0.6


RATES, DRAINS = Axis("slope", 2.5, 4.0, log=False, leaf=0), Axis("r", 0.0, 0.5, log=False, leaf=1)
"""Of x → a x (1 − x) − b x, whose multiplier at 1 − (1 + b)/a is 2 + b − a."""


def _cycle(point, leaves, values, arrivals):
    x, (a, b) = point[0], values
    jacobian = np.zeros((2, 4))
    jacobian[0] = a * (1.0 - 2.0 * x) - b, 0.0, x * (1.0 - x), -x
    return twice(
        recurring=np.array([a * x * (1.0 - x) - b * x, 0.0]), jacobian=jacobian,
        monodromy=np.eye(2), velocity=np.eye(2)[-1], period=1.0, advance=1.0, peak=0.0, code=0,
        sound=True, grazes=0,
    )  # fmt: skip


def test_doublings_of_two_parameters_are_zeros_whose_derivatives_are_exact():
    """What doubles is the sum of the multiplier and one, here linear in each unknown."""
    sizes = np.array([0.5, 2.0, 1.0])
    setup = SimpleNamespace(
        curve=SimpleNamespace(sizes=sizes),
        axis=RATES,
        cycle_with=_cycle,
        arrivals=1,
    )
    curve = _extended_curve(setup, DRAINS, BranchEvent.PERIOD_DOUBLING)
    x, a, b = 0.6, RATES.value(0.4), DRAINS.value(0.3)
    found = curve.change(np.array([x, 0.0, 0.4]), 0.3)
    assert found.value[-1] == pytest.approx(a * (1.0 - 2.0 * x) - b + 1.0)
    np.testing.assert_allclose(
        found.by_point[-1], [-2.0 * a, 0.0, 1.5 * (1.0 - 2.0 * x)], atol=1e-8
    )
    np.testing.assert_allclose(found.by_s, [-0.5 * x, 0.0, -0.5], atol=1e-8)
    for b in (0.1, 0.4):
        place = np.array([0.6, 0.0, 0.3, DRAINS.place(b)])
        zero = correct(curve, place / curve.sizes, patient=True).found
        x, _, s, t = zero.place * curve.sizes
        a, b = RATES.value(s), DRAINS.value(t)
        assert (a, x) == pytest.approx((3.0 + b, 1.0 - (1.0 + b) / a), abs=1e-8)
