"""Events of branches, errors, cascades and deflation, against numbers that are written down."""

from itertools import islice
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest

from jaxbiped.continuation import (
    Axis,
    Branch,
    BranchEvent,
    BranchStop,
    DoublingCascade,
    _switch_branch,
)
from jaxbiped.continuation._bifurcation_curve import _extended_curve
from jaxbiped.continuation._bifurcations import (
    _with_multiplier_errors,
    critical_multiplier,
    multiplier_test,
)
from jaxbiped.continuation._continue_gait import _events_at
from jaxbiped.continuation._deflation import _DeflatedNewton, _scattered_about
from jaxbiped.continuation._switch_branch import _NEARER
from jaxbiped.continuation._trace import _closes, is_bound, leaves_range
from jaxbiped.gait import BranchEnd
from jaxbiped.gait._pseudo_arclength import CurvePoint
from tests.continuation.maps import twice


def at(*multipliers, value=0.0, errors=0.01):
    values = np.array(multipliers, complex)
    return SimpleNamespace(
        multipliers=values, multiplier_errors=np.full(len(values), errors), value=value
    )


@pytest.mark.parametrize(
    ("kind", "multipliers"),
    [
        (BranchEvent.FOLD, (1.0, 0.3, -0.2)),
        (BranchEvent.BRANCH_POINT, (1.0, 0.3, -0.2)),
        (BranchEvent.PERIOD_DOUBLING, (-1.0, 0.3, -0.2)),
        (BranchEvent.NEIMARK_SACKER, (0.6 + 0.8j, 0.6 - 0.8j, 0.3)),
    ],
)
def test_a_test_function_vanishes_and_changes_sign_at_its_event_alone(kind, multipliers):
    values = np.array(multipliers, complex)
    assert multiplier_test(kind, values) == pytest.approx(0.0, abs=1e-12)
    inside, outside = (values.copy() for _ in range(2))
    inside[abs(values) > 0.99] *= 0.99
    outside[abs(values) > 0.99] *= 1.01
    assert multiplier_test(kind, inside) * multiplier_test(kind, outside) < 0.0
    for other in set(BranchEvent) - {kind, BranchEvent.LIMIT, BranchEvent.NOT_LOCATED}:
        if multipliers[0] != 1.0:
            assert multiplier_test(other, values) != pytest.approx(0.0, abs=1e-6)
    told, error, distance = critical_multiplier(kind, at(*values))
    assert (told, error) == (values[0], 0.01)
    assert distance == pytest.approx(0.0, abs=1e-12)


def test_the_error_of_a_value_is_that_of_the_multiplier_over_its_rate():
    """A multiplier that falls from −0.9 to −1.1 over 0.4 of the parameter: two for each one."""
    ends = [at(-0.9, 0.2, value=1.0, errors=0.02), at(-1.1, 0.2, value=1.4, errors=0.01)]
    middle = at(-1.0001, 0.2, value=1.2, errors=0.005)
    error = lambda shift: _with_multiplier_errors(shift, BranchEvent.PERIOD_DOUBLING, middle, ends)
    assert error(1e-9) == pytest.approx(2.0 * 0.02 + 2.0 * 1e-4)
    assert error(0.7) == pytest.approx(0.7 + 2.0 * 1e-4)
    assert error(float("nan")) == pytest.approx(2.0 * 0.02 + 2.0 * 1e-4)


def test_the_rate_of_a_pair_on_the_circle_is_that_of_its_modulus():
    """It grows from 0.9 to 1.1 over 0.4 of the parameter, while its angle turns by more."""
    pair = lambda one, **how: at(one, np.conj(one), **how)
    before, after = 0.9 * np.exp(1.2j), 1.1 * np.exp(1.9j)
    ends = [pair(before, value=1.0, errors=0.02), pair(after, value=1.4, errors=0.01)]
    for middle in (1j, np.exp(1.5j)):
        there = pair(middle, value=1.2, errors=0.005)
        error = _with_multiplier_errors(1e-9, BranchEvent.NEIMARK_SACKER, there, ends)
        assert error == pytest.approx(2.0 * 0.02)


def point(*place, tangent):
    return CurvePoint(*[None] * len(CurvePoint._fields))._replace(
        place=np.array(place), tangent=np.array(tangent)
    )


def test_a_branch_leaves_its_range_where_it_leads_out_of_it():
    for s, inwards in ((0.0, 1.0), (1.0, -1.0)):
        assert is_bound(point(0.3, s, tangent=[0.0, inwards]))
        assert not leaves_range(point(0.3, s, tangent=[0.0, inwards]))
        assert leaves_range(point(0.3, s, tangent=[0.0, -inwards]))
    assert not leaves_range(point(0.3, 0.5, tangent=[0.0, 1.0]))


def test_a_branch_is_closed_where_it_passes_its_beginning_the_same_way():
    here, there = point(0.0, 0.4, tangent=[0, 1.0]), point(0.0, 0.5, tangent=[0, 1.0])
    assert _closes(point(0.001, 0.45, tangent=[0, 1.0]), here, there)
    assert not _closes(point(0.001, 0.45, tangent=[0, -1.0]), here, there)
    assert not _closes(point(0.02, 0.45, tangent=[0, 1.0]), here, there)
    assert not _closes(point(0.0, 0.55, tangent=[0, 1.0]), here, there)
    assert not _closes(point(0.0, 0.35, tangent=[0, 1.0]), here, there)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_geometric_cascade_has_its_ratio_and_its_limit(way):
    """Doublings at ±(2 − 4⁻ᵏ): intervals shrink by 4 and add up to 2, and so does the search."""
    values, distances = [way * (2.0 - 0.25**k) for k in range(4)], []

    def doubling(k):
        place = np.array([0.1 * k, values[k]])
        return SimpleNamespace(
            kind=BranchEvent.PERIOD_DOUBLING, value=values[k], point=SimpleNamespace(place=place)
        )

    def branch(k):
        ends = [SimpleNamespace(place=np.array([0.0, v])) for v in (values[k - 1], values[k])]
        known = dict(points=ends, bifurcations=[doubling(k)], footsteps=2**k)
        return Mock(spec=Branch, **known)

    following = iter([branch(1), branch(2), branch(3)])

    def doubled(branch, doubling, step, near):
        distances.append(near)
        return next(following)

    found = _switch_branch._cascade_from(branch(0), doubling(0), 4, 0.02, 1.0, doubled)
    assert isinstance(found, DoublingCascade)
    assert found.values == pytest.approx(values)
    assert found.ratios == pytest.approx([4.0, 4.0])
    assert found.accumulation == pytest.approx(way * 2.0)
    assert distances[1:] == pytest.approx([0.75 / _NEARER, 0.75 / 4.0 / _NEARER])
    assert [each.footsteps for each in found.branches] == [1, 2, 4, 8]


def test_the_derivatives_of_a_curve_of_doublings_are_those_of_its_values():
    """Of x → r x (1 − x) + q, r by factors; the witness of a cycle is off by a tenth."""
    first, second = Axis("g", 2.0, 4.0, True, 0), Axis("slope", -0.1, 0.3, False, 1)

    def cycle(point, leaves, values, arrivals):
        (x, _), (r, q) = point, values
        jacobian = np.array([[r * (1.0 - 2.0 * x), 0.0, x * (1.0 - x), 1.0], np.zeros(4)])
        seen = twice(
            recurring=[r * x * (1.0 - x) + q, 0.0], jacobian=jacobian, monodromy=np.eye(2),
            velocity=[0.0, 1.0], period=1.0, advance=1.0, peak=0.0, code=0, sound=True, grazes=0,
        )  # fmt: skip
        return seen._replace(jacobian=np.stack([jacobian, 0.9 * jacobian]))

    setup = SimpleNamespace(
        curve=SimpleNamespace(sizes=np.array([0.5, 2.0, 1.0])), axis=first, arrivals=1,
        cycle_with=cycle,
    )  # fmt: skip
    curve = _extended_curve(setup, second, BranchEvent.PERIOD_DOUBLING)
    place, step = np.array([0.6, 0.1, 0.4, 0.7]), 1e-5
    change = curve.change(place[:-1], place[-1])
    ends = [
        [curve.change((place + h)[:-1], (place + h)[-1]).value for h in (shift, -shift)]
        for shift in step * np.eye(4)
    ]
    quotients = np.array([(more - less) / (2.0 * step) for more, less in ends]).T
    given = np.column_stack([change.by_point, change.by_s])
    np.testing.assert_allclose(given, quotients, rtol=0.0, atol=1e-3)


def test_starts_of_deflation_scatter_about_the_gait_by_five_sizes_in_turn():
    middle = np.array([2.0, -0.5])
    first, *others = islice(_scattered_about(middle, 0), 1001)
    np.testing.assert_array_equal(first, middle)
    off = np.abs(np.array(others) / middle - 1.0).reshape(-1, 5, 2)
    spreads = np.array([0.003, 0.01, 0.03, 0.1, 0.3])
    reach = np.max(off, axis=(0, 2))
    assert np.all((0.98 * spreads < reach) & (reach <= spreads * (1.0 + 1e-12)))


def test_deflated_newton_finds_the_roots_one_after_the_other():
    """Of x² = 1 and y = 0: both roots from one start, and then no more."""

    def change(p):
        value = np.array([p[0] ** 2 - 1.0, p[1]])
        by_point = np.array([[2.0 * p[0], 0.0], [0.0, 1.0]])
        return SimpleNamespace(value=value, by_point=by_point, code=0)

    class Search(_DeflatedNewton):
        def __init__(self):
            self._sizes, self._crossings, self._value = np.ones(2), [], 0.0
            curve = SimpleNamespace(converged=1e-9, change=lambda point, s: change(point))
            axis = SimpleNamespace(place=float)
            self._setup = SimpleNamespace(curve=curve, axis=axis, arrivals=1)

        def _walk(self, point, arrivals):
            return np.asarray(point), 0

    search, found = Search(), []
    while (root := search.from_start(np.array([0.7, 0.1]))) is not None:
        found.append(root)
        search._crossings.append(root)
    np.testing.assert_allclose(found, [[1.0, 0.0], [-1.0, 0.0]], atol=1e-8)


def test_a_deflated_step_is_that_of_the_residual_over_the_squared_distance():
    """Newton's step of (1/|x − a|² + 1) f(x), by its derivative in full."""
    a, x = np.array([0.4, -0.1]), np.array([0.5, 0.1])
    f = lambda z: np.array([z[0] ** 2 - 0.3 * z[1], z[1] + 0.2 * z[0]])
    slope = np.array([[2.0 * x[0], -0.3], [0.2, 1.0]])
    search = _DeflatedNewton.__new__(_DeflatedNewton)
    search._crossings = [a]
    found = search._deflated_step(x, np.linalg.solve(slope, -f(x)))
    away = x - a
    square = away @ away
    factor = 1.0 / square + 1.0
    whole = factor * slope + np.outer(f(x), -2.0 * away / square**2)
    expected = np.linalg.solve(whole, -factor * f(x))
    np.testing.assert_allclose(found, expected * min(1.0, 0.1 / np.linalg.norm(expected)))


@pytest.mark.parametrize(("forward", "left"), [(True, [0, 1]), (False, [1, 2])])
def test_a_limit_at_the_end_that_goes_on_is_no_event_any_more(forward, left):
    kinds = (BranchEvent.LIMIT, BranchEvent.PERIOD_DOUBLING, BranchEvent.LIMIT)
    points = [SimpleNamespace(place=np.array([float(k)])) for k in range(3)]
    events = [SimpleNamespace(kind=k, point=p) for k, p in zip(kinds, points, strict=True)]
    stop = BranchStop(BranchEnd.WALK_ENDS, "fell", 0.0)
    branch = SimpleNamespace(bifurcations=tuple(events), stops=(stop, stop))
    assert _events_at(branch, points, forward=forward) == [events[k] for k in left]
    assert _events_at(branch, points[1:2], forward=forward) == [events[1]]
