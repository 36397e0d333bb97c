"""What surfaces of a mode do within a step, against motions whose crossings are known."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.polynomial import Polynomial

from jaxbiped.hybrid._landing_system import SurfaceCourse
from jaxbiped.solve._step_events import (
    ModeEvents,
    StepEvents,
    mode_events,
    onto_surface,
    with_changes,
)

RTOL, STEP = 1e-6, 0.5
told = jax.jit(lambda before, after, length=0.1: mode_events(STEP, before, after, RTOL, length))
onto = jax.jit(lambda at, which: onto_surface(at, which, jnp.asarray(RTOL), jnp.asarray(STEP)))


def falling(crossings, live=(True, True)):
    """Surfaces that fall steadily through zero at these shares of a step, at both of its ends."""
    rates = -np.array([1.0, 3.0])
    return [
        SurfaceCourse(
            *map(jnp.asarray, (rates * (t - np.array(crossings)) * STEP, rates, np.array(live))),
            jnp.zeros(0),
        )
        for t in (0.0, 1.0)
    ]


@pytest.mark.parametrize(
    ("crossings", "live", "which", "place"),
    [
        ((0.25, 0.625), (True, True), 0, 0.25),
        ((0.625, 0.25), (True, True), 1, 0.25),
        ((0.25, 0.625), (False, True), 1, 0.625),
        ((1.5, 0.75), (True, True), 1, 0.75),
    ],
)
def test_of_two_surfaces_the_first_in_time_is_landed_on(crossings, live, which, place):
    found = told(*falling(crossings, live))
    assert bool(found.crosses)
    assert int(found.which) == which
    assert float(found.place) == pytest.approx(place, rel=1e-12)
    assert not bool(found.unclear | found.grazes)


def test_what_is_not_reached_or_does_not_matter_ends_no_step():
    for crossings, live in (((1.5, 2.0), (True, True)), ((0.5, 0.5), (False, False))):
        found = told(*falling(crossings, live))
        assert not bool(found.crosses)
        assert float(found.place) == 1.0


def test_one_euler_step_leads_onto_a_surface_that_is_near():
    at = SurfaceCourse(
        jnp.array([0.05 * RTOL, 1.0]),
        jnp.array([-0.4, -1.0]),
        jnp.array([True, True]),
        jnp.zeros(0),
    )
    near, far = onto(at, 0), onto(at, 1)
    assert bool(near.near)
    assert float(near.rest) == pytest.approx(0.05 * RTOL / 0.4, rel=1e-12)
    assert not bool(far.near)
    assert float(far.rest) == pytest.approx(1.0)


ROOT = float(jnp.sqrt(RTOL))


@pytest.mark.parametrize(
    ("rate", "lies"),
    [(0.0, True), (0.5 * ROOT, True), (ROOT, True), (-ROOT, True), (1.1 * ROOT, False)],
)
def test_what_is_near_its_surface_and_moves_by_no_more_than_the_tolerances_root_lies_on_it(
    rate, lies
):
    value = -0.05 * RTOL
    near, far = (
        onto(SurfaceCourse(*(jnp.array([x]) for x in (at, rate, True)), jnp.zeros(0)), 0)
        for at in (value, 1e3 * value)
    )
    assert bool(near.near)
    assert float(near.rest) == pytest.approx(0.0 if lies else -value / rate, rel=1e-12)
    assert not bool(far.near)


@pytest.mark.parametrize("bend", [0.0, -3.0, 3.0])
def test_a_gap_is_met_from_farther_away_by_what_is_known_of_its_bend(bend):
    """A parabola, which one step meets to the third order of the time that is left."""
    rest, rate = 2e-5, -3.0
    value = -rate * rest - 0.5 * bend * rest**2
    there = (jnp.array([each]) for each in (value, rate, True, bend))
    found = onto(SurfaceCourse(*there), 0)
    assert bool(found.near)
    assert float(found.rest) == pytest.approx(rest, abs=1e-14)
    for far in (
        SurfaceCourse(*(jnp.array([each]) for each in (value, rate, False, bend))),
        SurfaceCourse(*(jnp.array([each]) for each in (value, rate, True)), jnp.zeros(0)),
        SurfaceCourse(*(jnp.array([each]) for each in (value, rate, True, 1e4))),
        SurfaceCourse(*(jnp.array([each]) for each in (1e2 * value, rate, True, bend))),
        SurfaceCourse(*(jnp.array([each]) for each in (-1.2e-3, rate, True, 0.0))),
    ):
        assert not bool(onto(far, 0).near)


def gap(curve, live=True):
    """A gap that is a polynomial of the share of a step of STEP, at both of its ends."""
    slope, bend = curve.deriv() / STEP, curve.deriv(2) / STEP**2
    return [
        SurfaceCourse(*(jnp.array([each]) for each in (curve(s), slope(s), live, bend(s))))
        for s in (0.0, 1.0)
    ]


def parabola(start, middle):
    return Polynomial([start, -4.0 * (start - middle), 4.0 * (start - middle)])


DIPS, COMES_NEAR = parabola(1.0, -0.2), parabola(1.5 * RTOL, 0.1 * RTOL)
RISES = Polynomial([0.0, 0.8, -1.0])
AT_REST = Polynomial([0.0, 0.0, 1.0])
"""Gaps: open, then closed and open again; nearly closed; open from closed, and closed again."""


@pytest.mark.parametrize(
    ("curve", "length", "crosses", "unclear", "grazes"),
    [
        (DIPS, 0.1, False, True, False),
        (DIPS, 1.0, False, True, False),
        (parabola(0.8, 0.2), 0.1, False, False, False),
        (COMES_NEAR, 0.1, False, False, True),
        (COMES_NEAR, 1.0, False, True, False),
        (parabola(0.8, 0.4), 0.1, False, False, False),
        (RISES, 0.1, True, False, False),
        (Polynomial([0.0, 0.8, -0.8 - 0.5 * RTOL]), 0.1, True, False, False),
        (AT_REST, 0.1, False, False, False),
        (-AT_REST, 0.1, True, False, False),
        (-RTOL * AT_REST, 0.1, True, False, False),
        (Polynomial([0.0, 0.8, -0.5]), 0.1, False, False, False),
        (Polynomial([0.5 * RTOL, -1.0, 1.0]), 0.1, False, False, False),
    ],
)
def test_a_gap_that_bends_is_followed_through_a_step(curve, length, crosses, unclear, grazes):
    found = told(*gap(curve), length)
    seen = bool(found.crosses), bool(found.unclear), bool(found.grazes)
    assert seen == (crosses, unclear, grazes)
    dead = told(*gap(curve, live=False), length)
    assert not bool(dead.crosses | dead.unclear | dead.grazes)


def test_what_begins_on_its_surface_is_followed_from_behind():
    """Along the tangent at the end, from a gap of −0.2 that falls by 1.2 a step."""
    found = told(*gap(RISES), 0.1)
    assert float(found.place) == pytest.approx(1.0 - 0.2 / 1.2, rel=1e-12)


def test_what_comes_behind_the_first_change_of_mode_does_not_happen():
    yes, no = jnp.asarray(True), jnp.asarray(False)
    strike = StepEvents(yes, no, jnp.asarray(0.5), no, yes, no)
    fall = StepEvents(no, yes, jnp.asarray(0.5), no, yes, no)
    nothing = StepEvents(no, no, jnp.asarray(1.0), no, yes, yes)
    for happens, crosses, place, changes in (
        (strike, yes, 0.3, True),
        (strike, yes, 0.7, False),
        (strike, no, 0.3, False),
        (fall, yes, 0.3, True),
        (fall, yes, 0.7, False),
        (nothing, yes, 0.7, True),
    ):
        modes = ModeEvents(crosses, jnp.asarray(0), jnp.asarray(place), no, no)
        found = with_changes(happens, modes)
        assert bool(found.changes) == changes
        kept = [flag and not changes for flag in map(bool, (happens.arrives, happens.ends))]
        assert [bool(found.arrives), bool(found.ends)] == kept
        assert float(found.place) == (place if changes else float(happens.place))
        assert bool(found.above)
        assert bool(found.grazes) == (bool(happens.grazes) and not changes)
    for flags in ((yes, no), (no, yes), (no, no)):
        modes = ModeEvents(no, jnp.asarray(0), jnp.asarray(1.0), flags[0], no)
        found = with_changes(strike._replace(unclear=flags[1]), modes)
        assert bool(found.unclear) == any(map(bool, flags))
