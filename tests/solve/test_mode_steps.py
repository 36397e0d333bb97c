"""What surfaces of a mode do within a step, against motions whose crossings are known."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxbiped.solve._rolling_step import SurfaceCourse, mode_events, onto_surface

RTOL, STEP = 1e-6, 0.5
told = jax.jit(lambda before, after: mode_events(STEP, before, after, RTOL, jnp.asarray(0.1)))
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
    ):
        assert not bool(onto(far, 0).near)
