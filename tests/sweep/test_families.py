"""Families of gaits and where searches begin, against small families that are written down."""

from types import SimpleNamespace

import jax
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.basins._labels import Label
from jaxbiped.sweep import _gait_family as families
from jaxbiped.sweep._gait_family import Family, find_family, with_gaits, with_radius
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


def test_each_search_begins_at_the_nearest_gait_and_then_without_a_guess(monkeypatch):
    """Of slopes 1 to 5 % the third alone has a gait from the start; then its neighbours have."""
    slopes, asked = [0.01, 0.02, 0.03, 0.04, 0.05], []

    def stable_gaits(scene, guesses, least):
        slope = float(scene.ground.slope)
        near, nothing = guesses
        asked.append((slope, float(near.theta_2), nothing, least))
        is_near = abs(float(near.theta_2) - slope) < 0.011
        return (gait(1, slope),) if slope == 0.03 or is_near else ()

    monkeypatch.setattr(families, "_stable_gaits", stable_gaits)
    monkeypatch.setattr(families, "with_radius", lambda scene, own, effort: own)
    guess = STATE._replace(theta_2=np.asarray(9.0))
    found = find_family(SCENE, LABELLING.effort, parameters={"slope": slopes}, guess=guess)
    assert [(round(slope, 2), near) for slope, near, _, _ in asked] == [
        (0.01, 9.0), (0.02, 9.0), (0.03, 9.0), (0.04, 0.03), (0.05, 0.04), (0.02, 0.03),
        (0.01, 0.02),
    ]  # fmt: skip
    assert {(nothing, least) for _, _, nothing, least in asked} == {(None, 1)}
    assert [float(state.theta_2) for state in found.states] == slopes
    assert found.table.tolist() == [[slope] for slope in slopes]
    assert all(len(row) == 1 for row in found.rows)
    monkeypatch.setattr(families, "_stable_gaits", lambda scene, *_: (
        (gait(1, 0.5),) if scene.ground.slope == 0.05 else ()))  # fmt: skip
    lone = find_family(SCENE, LABELLING.effort, parameters={"slope": slopes}, guess=guess)
    assert [len(row) for row in lone.rows] == [0, 0, 0, 0, 1]
    assert [float(state.theta_2) for state in lone.states] == [0.5] * 5
    plain = find_family(SCENE, LABELLING.effort, parameters={}, guess=guess)
    assert (plain.names, plain.table.shape, plain.rows) == ((), (1, 0), ((),))
    assert float(plain.states[0].theta_2) == 9.0


def test_a_gait_that_is_known_is_not_taken_again(monkeypatch):
    """Another crossing of a known orbit is no other gait; another cycle's length is."""
    moved = KNOWN.point + np.array([0.0, 0.0, 0.1, 0.0])
    orbit = gait(2, 0.2, crossings=np.stack([moved, KNOWN.point]))
    found = {1: gait(1, 0.2), 2: gait(2, float(STATE.theta_2)), 3: gait(3, 0.3)}
    monkeypatch.setattr(families, "_stable_gaits", lambda scene, starts, n: (found[n],))
    monkeypatch.setattr(
        families, "with_radius", lambda scene, own, effort: own._replace(radius=0.5)
    )
    family = Family((), np.zeros((1, 0)), ((orbit,),), (STATE,), np.ones((1, 4)))
    guesses = {0: [(3, KNOWN.point), (2, KNOWN.point), (1, KNOWN.point)]}
    after = with_gaits(SCENE, family, LABELLING.effort, guesses)
    assert [own.cycle_footsteps for own in after.rows[0]] == [1, 2, 3]
    assert [own.radius for own in after.rows[0]] == [0.5, orbit.radius, 0.5]
    assert after.states is family.states


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


def test_a_search_goes_on_to_the_minimal_cycle_and_to_the_next_guess(monkeypatch):
    asked = []

    def find_gait(scene, near, *, footsteps, parameters):
        asked.append((None if near is None else float(near.theta_2), footsteps))
        stable = near is None or float(near.theta_2) != 0.1
        least = 2 if footsteps == 4 else footsteps
        measures = SimpleNamespace(state=STATE._replace(theta_2=0.7))
        return SimpleNamespace(stable=stable, cycle_footsteps=least, measures=measures)

    monkeypatch.setattr(families, "find_gait", find_gait)
    monkeypatch.setattr(families, "attractor_without_radius", lambda scene, own: own)
    first = STATE._replace(theta_2=0.1)
    (found,) = families._stable_gaits(SCENE, [first, None], 4)
    assert asked == [(0.1, 4), (None, 4), (0.7, 2)]
    assert found.cycle_footsteps == 2
    assert families._stable_gaits(SCENE, [first], 1) == ()


@pytest.mark.parametrize("limit", [0.0, 2e-5, 1e-4, 3e-3, 0.5, 9.0])
def test_a_radius_is_a_share_of_the_last_distance_that_is_drawn_in(limit, monkeypatch):
    monkeypatch.setattr(families, "_draws_in", lambda scene, own, shells, *_: shells < limit)
    radius = with_radius(SCENE, KNOWN, LABELLING.effort).radius
    last = min(limit, 1e-5 * 1.5**29)
    assert radius == -1.0 if limit == 0.0 else 0.7 / 1.5 * last <= radius <= 0.7 * last * 1.001


@pytest.mark.parametrize(("rho", "cycles"), [(0.0, 1), (0.49, 1), (0.9, 7), (0.999, 16)])
def test_slow_gaits_are_followed_until_half_is_left(rho, cycles, monkeypatch):
    asked = []
    monkeypatch.setattr(families, "_draws_in", lambda *given: asked.append(given[3]) or [False])
    with_radius(SCENE, KNOWN._replace(multipliers=np.array([-rho, 0.0])), LABELLING.effort)
    assert set(asked) == {cycles}


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

    monkeypatch.setattr(families, "follow_starts", follow)
    effort = LABELLING.effort._replace(rtol=1e-12)
    found = families._draws_in(SCENE, KNOWN, shells, 1, effort)
    assert found.tolist() == [drawn] * 2
    states, cycles, footsteps, goals = seen[0]
    distances = KNOWN.distance(states)
    np.testing.assert_allclose(distances, np.repeat(shells, len(states) // 2), rtol=1e-9)
    assert (cycles, footsteps) == ((1,), 1)
    assert np.isinf(np.asarray(goals.models)).all()
    again = families._draws_in(SCENE, KNOWN, shells, 1, effort)
    assert again.tolist() == [False, drawn]
    tangents = families.section_tangents(SCENE, KNOWN.state)
    np.testing.assert_allclose(
        tangents @ tangents.T @ (states - KNOWN.point).T, (states - KNOWN.point).T, atol=1e-12
    )
