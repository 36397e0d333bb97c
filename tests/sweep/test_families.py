"""Families of gaits and where searches begin, against small families that are written down."""

from types import SimpleNamespace

import jax
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.basins import Label
from jaxbiped.sweep import _attractor as attractors
from jaxbiped.sweep import _gait_family as families
from jaxbiped.sweep.labels import Family
from tests.rigid_walkers import STABLE, simplest_state, simplest_walker
from tests.sweep.walkers import gaitless, with_attractor

SCENE = simplest_walker(0.009)
STATE = jax.tree.map(np.asarray, simplest_state(*STABLE))
LABELLING = gaitless(SCENE, STATE)
KNOWN = with_attractor(LABELLING).family.rows[0][0]


def gait(cycle, angle=0.0, **changes):
    """A gait of so many footsteps, its angle told apart from others' by a number."""
    state = STATE._replace(theta_2=np.asarray(angle))
    return KNOWN._replace(cycle_footsteps=cycle, state=state, **changes)


TABLE = np.array([[0.01, 1.0], [0.01, 2.0], [0.02, 1.0], [0.02, 2.0]])
ROWS = ((gait(1), gait(1), gait(2)), (), (gait(2), gait(4)), (gait(1),))
FAMILY = Family(("slope", "g"), TABLE, ROWS, (STATE,) * 4, np.tile([1.0, 2.0, 3.0, 4.0], (4, 1)))


def test_starts_have_the_row_of_their_parameters_whatever_their_order():
    given = dict(g=np.array([2.0, 1.0, 2.0]), slope=np.array([0.02, 0.01, 0.01]))
    assert FAMILY.row_of(given).tolist() == [3, 0, 1]
    with pytest.raises(jb.ArgumentError, match=r"parameters = \['slope'\] is not allowed"):
        FAMILY.row_of(dict(slope=np.array([0.01])))
    with pytest.raises(jb.ArgumentError, match=r"slope = 0\.03, g = 1 is not allowed: no gait was"):
        FAMILY.row_of(dict(g=np.array([1.0]), slope=np.array([0.03])))


def test_there_is_room_for_the_gaits_of_every_row():
    assert FAMILY.cycles == (1, 1, 2, 4)
    assert FAMILY._replace(rows=((),) * 4).cycles == (1,)
    more = FAMILY._replace(rows=((*ROWS[0], gait(2)), *ROWS[1:]))
    assert FAMILY.places_in(more).tolist() == [0, 1, 2, 4]
    assert FAMILY._replace(rows=((),) * 4).places_in(more).tolist() == [0]


def test_goals_stand_at_the_places_of_their_cycles_and_the_others_are_none():
    goals, cycles = FAMILY.goals(dict(g=np.array([2.0, 1.0]), slope=np.array([0.01, 0.02])), 2)
    assert cycles == (1, 1, 2, 4)
    assert np.isneginf(goals.radii[0]).all()
    assert np.isneginf(goals.radii[1]).tolist() == [True, True, False, False]
    np.testing.assert_array_equal(goals.points[1, 2], ROWS[2][0].point)
    np.testing.assert_array_equal(goals.points[1, 0], np.zeros(4))
    np.testing.assert_array_equal(goals.metrics[1, 3], KNOWN.metric)
    np.testing.assert_array_equal(goals.scales[1], [1.0, 2.0, 3.0, 4.0])


def test_each_search_begins_at_the_nearest_gait():
    """Of slopes 1 to 5 % the third alone has a gait from the start; then its neighbours have."""
    slopes, asked = np.array([[0.01], [0.02], [0.03], [0.04], [0.05]]), []

    def seek(k, near):
        asked.append((k, float(near.theta_2)))
        is_near = abs(float(near.theta_2) - slopes[k, 0]) < 0.011
        return (gait(1, slopes[k, 0]),) if k == 2 or is_near else ()

    guess = STATE._replace(theta_2=np.asarray(9.0))
    rows, states = families._rows_from_neighbours(slopes, seek, guess)
    assert asked == [(0, 9.0), (1, 9.0), (2, 9.0), (3, 0.03), (4, 0.04), (1, 0.03), (0, 0.02)]
    assert [float(state.theta_2) for state in states] == slopes[:, 0].tolist()
    assert all(len(row) == 1 for row in rows)
    last = lambda k, near: (gait(1, 0.5),) if k == 4 else ()
    rows, states = families._rows_from_neighbours(slopes, last, guess)
    assert [len(row) for row in rows] == [0, 0, 0, 0, 1]
    assert [float(state.theta_2) for state in states] == [0.5] * 5
    rows, states = families._rows_from_neighbours(np.zeros((1, 0)), lambda *_: (), guess)
    assert rows == ((),)
    assert float(states[0].theta_2) == 9.0


def test_a_gait_that_is_known_is_not_taken_again():
    """Another crossing of a known orbit is no other gait; another cycle's length is."""
    moved = KNOWN.point + np.array([0.0, 0.0, 0.1, 0.0])
    orbit = gait(2, 0.2, crossings=np.stack([moved, KNOWN.point]))
    found = [gait(3, 0.3), gait(2, float(STATE.theta_2)), gait(1, 0.2)]
    fresh = families._unknown_among(found, (orbit,), np.ones(4))
    assert [own.cycle_footsteps for own in fresh] == [3, 1]
    after = families._in_order((orbit, *fresh))
    assert [own.cycle_footsteps for own in after] == [1, 2, 3]
    assert after[1] is orbit


@pytest.mark.parametrize(
    ("off", "contraction", "same"),
    [(0.9e-5, 0.0, True), (1.1e-5, 0.0, False), (0.9e-3, 0.99, True), (1.1e-3, 0.99, False)],
)
def test_two_finds_of_a_slow_gait_may_lie_farther_apart(off, contraction, same):
    scales = np.array([1.0, 1.0, 10.0, 1.0])
    other = KNOWN._replace(
        crossings=KNOWN.point[None] + off * np.array([0, 0, 10.0, 0]), contraction=contraction
    )
    assert families._is_same_orbit(KNOWN, other, scales) is same


def test_a_search_goes_on_to_the_minimal_cycle_and_to_the_next_guess():
    asked = []

    def find(near, footsteps):
        asked.append((None if near is None else float(near.theta_2), footsteps))
        stable = near is None or float(near.theta_2) != 0.1
        least = 2 if footsteps == 4 else footsteps
        measures = SimpleNamespace(state=STATE._replace(theta_2=0.7))
        return SimpleNamespace(stable=stable, cycle_footsteps=least, measures=measures)

    first = STATE._replace(theta_2=0.1)
    found = families._stable_gait(find, [first, None], 4)
    assert asked == [(0.1, 4), (None, 4), (0.7, 2)]
    assert found.cycle_footsteps == 2
    assert families._stable_gait(find, [first], 1) is None


@pytest.mark.parametrize("limit", [0.0, 2e-5, 1e-4, 3e-3, 0.5, 9.0])
def test_a_radius_is_a_share_of_the_last_distance_that_is_drawn_in(limit):
    radius = attractors._radius_of(lambda shells: shells < limit)
    last = min(limit, 1e-5 * 1.5**29)
    assert radius == -1.0 if limit == 0.0 else 0.7 / 1.5 * last <= radius <= 0.7 * last * 1.001


@pytest.mark.parametrize(("rho", "cycles"), [(0.0, 1), (0.49, 1), (0.9, 7), (0.999, 16)])
def test_slow_gaits_are_followed_until_half_is_left(rho, cycles):
    assert attractors._cycles_to_halve(np.array([-rho, 0.0])) == cycles


@pytest.mark.parametrize(("left", "drawn"), [(0.74, True), (0.87, True), (0.885, False)])
def test_samples_lie_on_their_shells_and_come_as_near_as_half_of_what_is_promised(
    left, drawn, monkeypatch
):
    """The contraction is 3/4: what is left may be 7/8. One that fails is enough to say no."""
    shells, seen = np.array([1e-3, 1e-2]), []

    def follow(scene, starts, goals, cycles, effort):
        states = np.stack([np.asarray(leaf) for leaf in starts[1:]], axis=1)
        seen.append((states, cycles, effort.footsteps, goals))
        final = KNOWN.point + left * (states - KNOWN.point)
        label = np.full(len(states), int(Label.UNRESOLVED))
        if len(seen) == 2:
            label[0] = int(Label.STUMBLED)
        return SimpleNamespace(label=label, final=final)

    monkeypatch.setattr(attractors, "follow_starts", follow)
    effort = LABELLING.effort._replace(rtol=1e-12)
    found = attractors._draws_in(SCENE, KNOWN, shells, 1, effort)
    assert found.tolist() == [drawn] * 2
    states, cycles, footsteps, goals = seen[0]
    distances = KNOWN.distance(states)
    np.testing.assert_allclose(distances, np.repeat(shells, len(states) // 2), rtol=1e-9)
    assert (cycles, footsteps) == ((1,), 1)
    assert np.isinf(np.asarray(goals.models)).all()
    again = attractors._draws_in(SCENE, KNOWN, shells, 1, effort)
    assert again.tolist() == [False, drawn]
    tangents = attractors.section_tangents(SCENE, KNOWN.state)
    np.testing.assert_allclose(
        tangents @ tangents.T @ (states - KNOWN.point).T, (states - KNOWN.point).T, atol=1e-12
    )
