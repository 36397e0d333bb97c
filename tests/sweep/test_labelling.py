"""Labels against known endings and gaits, whatever else is in the batch."""

import jax.tree_util as jtu
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import jaxbiped as jb
from jaxbiped.compiler import BY_NAME, XLA
from tests.rigid_walkers import FIRST_DOUBLING, STABLE, simplest_state, simplest_walker
from tests.sweep.walkers import gaitless, rows, same, simplest_grid, stacked

pytestmark = pytest.mark.slow

SEED_STARTS = [
    *[(0.0, -0.8), (0.02, -0.7), (-0.01, -0.65)],
    *[(0.05, -1.5), (0.11, -1.8), (0.11, -1.5), (0.17, -1.8)],
    *[(0.17, -0.4), (0.23, -0.7), (0.29, -0.6), (0.35, -1.2), (0.3, -1.0)],
]
"""Angle and rate of the stance leg: some that walk, some that fall, some that stop."""


def _seed_batch(labelling):
    parts = [
        jb.starts.grid(labelling.scene, {"theta_stance": [a], "omega_stance": [w]}, place=True)
        for a, w in SEED_STARTS
    ]
    return stacked([rows(part.batch(labelling, 0, 1).states, 0) for part in parts])


def test_a_walker_without_friction_slides():
    seed = jb.seed_scene()
    scene = jb.Scene(
        walker=seed.walker,
        ground=seed.ground,
        normal=jb.laws.Hertz(K=1e6),
        friction=jb.laws.Frictionless(),
        clearance=jb.laws.AlwaysTouching(),
    )
    labelling = gaitless(scene, jb.seed_state(), accuracy="draft")
    axes = {"theta_stance": [0.0], "theta_swing": [0.0], "omega_stance": [0.0], "hip_vx": [4.0]}
    axes["omega_swing"] = [0.0]
    found = labelling(jb.starts.grid(scene, axes, place=True).batch(labelling, 0, 1).states)
    assert found.names[0] == "slid"
    # It is over as soon as a foot has slid by a leg's length.
    assert found.distance[0] == pytest.approx(float(scene.walker.l), rel=0.3)
    assert found.time[0] == pytest.approx(float(scene.walker.l) / 4.0, rel=0.3)


def test_a_start_without_any_verdict_is_unresolved_and_a_cap_is_told(simplest):
    state = stacked([simplest_state(*STABLE)])
    none = gaitless(simplest.scene, simplest_state(*STABLE), footsteps=2)(state)
    assert (none.names[0], none.footsteps[0], none.cycle_footsteps[0]) == ("unresolved", 2, 0)
    again = gaitless(simplest.scene, simplest_state(*STABLE))(state)
    assert (again.names[0], again.cycle_footsteps[0], again.gait[0]) == ("unresolved", 1, -1)
    assert again.footsteps[0] < 12
    capped = gaitless(simplest.scene, simplest_state(*STABLE), max_solver_steps=5)(state)
    assert (capped.names[0], capped.attempted[0]) == ("out of steps", 5)


def test_a_walker_at_rest_is_given_up_after_the_longest_wait_for_a_footstep():
    walker = jb.Walker(m=1.0, J=0.01, l=0.4, d=0.3, r=0.35)
    scene = jb.RigidScene(walker=walker, ground=jb.Ground(slope=0.0))
    at_rest = jb.dynamics.RigidState(*[np.zeros(())] * 5)
    found = gaitless(scene, at_rest)(stacked([at_rest]))
    assert found.names[0] == "timed out"
    assert found.footsteps[0] == 0
    assert found.time[0] >= 50.0 * np.sqrt(0.4 / 9.8)


def test_every_ending_of_a_walk_is_a_label_and_stored_codes_keep_their_meaning():
    for ending in set(jb.Ending) - {jb.Ending.FINISHED}:
        assert jb.basins.Label[ending.name].value == ending.value
        assert str(jb.basins.Label(ending.value)) == str(ending)
    own = {
        label.name: int(label)
        for label in jb.basins.Label
        if label.name not in jb.Ending.__members__
    }
    assert own == {"SLID": 7, "UNRESOLVED": 8, "PENDING": -1}
    assert (int(jb.basins.Label.OUT_OF_STEPS), int(jb.basins.Label.SOLVER_FAILED)) == (5, 6)


def test_the_gait_itself_walks_and_its_rate_is_not_made_up(simplest, seed):
    for labelling in (simplest, seed):
        found = labelling(labelling.base({}, 1))
        assert found.names[0] == "walking period-1"
        assert found.gait[0] == 0
        assert found.closest[0] < 1e-3
        assert not found.rate[0] >= 1.0
        assert found.rate[0] != 0.0


def test_starts_just_within_the_radius_converge(simplest, seed):
    for labelling in (simplest, seed):
        gait = labelling.family.rows[0][0]
        tangents = np.linalg.pinv(gait.metric)
        directions = np.random.default_rng(3).standard_normal((16, len(gait.point) - 1))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        points = gait.point + 0.99 * gait.radius * directions @ tangents.T
        np.testing.assert_allclose(gait.distance(points), 0.99 * gait.radius, rtol=1e-9)
        states = type(gait.state)(np.zeros(16), *points.T)
        # Without a gait to compare with, all of 30 footsteps are walked.
        walked = gaitless(labelling.scene, gait.state, footsteps=30)
        walked = jb.labels.Labelling(
            walked.scene, walked.family, walked.effort._replace(gap_share=0.0)
        )
        final = walked(states)
        assert np.all(final.footsteps == 30)
        assert np.all(gait.distance(final.final) < 1e-2 * gait.radius)
        assert np.all(labelling(states).label == jb.basins.Label.WALKING)


POISON = [np.nan, np.inf, -np.inf, 1e300, -1e300, 1e-310, 50.0]


@given(st.sampled_from(POISON), st.integers(0, 7), st.integers(0, 15), st.booleans())
@settings(max_examples=12, deadline=None)
def test_a_poisoned_lane_changes_no_other(seed, value, leaf, lane, everything):
    states = rows(_seed_batch(seed), np.resize(np.arange(len(SEED_STARTS)), 16))
    good = seed(states)
    bad = [np.array(each) for each in states]
    for i, each in enumerate(bad):
        if i == leaf or everything:
            each[lane] = value
    found = seed(jb.State(*bad))
    others = np.arange(16) != lane
    same(rows(found, others), rows(good, others))
    assert int(found.label[lane]) in set(jb.basins.Label) - {jb.basins.Label.PENDING}
    if not np.isfinite(value) and leaf > 0:
        assert found.names[lane] == "solver failed"


def test_a_lone_start_is_labelled_as_in_any_batch(seed, simplest, monkeypatch):
    for labelling, states in (
        (seed, _seed_batch(seed)),
        (simplest, simplest_grid(simplest.scene, 4).batch(simplest, 0, 16).states),
    ):
        whole = labelling(states)
        count = len(whole.label)
        for i in (0, count // 2, count - 1):
            same(labelling(rows(states, [i])), rows(whole, [i]))
        same(labelling(rows(states, slice(None, None, -1))), rows(whole, slice(None, None, -1)))
        monkeypatch.setenv("JAXBIPED_THREADS", "3")
        same(labelling(states), whole)
        monkeypatch.delenv("JAXBIPED_THREADS")


@pytest.fixture
def few_slots():
    """The name of an engine like XLA's that follows 24 simulations at once."""
    name = "xla with few slots"
    BY_NAME[name] = type(XLA)(slots=24)
    yield name
    del BY_NAME[name]


def test_both_engines_give_the_same_labels(simplest, few_slots):
    effort = simplest.effort._replace(engine=few_slots)
    # More starts than slots, so that slots are filled anew.
    states = simplest_grid(simplest.scene, 7).batch(simplest, 0, 49).states
    states = states._replace(theta_2=np.where(np.arange(49) == 11, np.nan, states.theta_2))
    ours, theirs = (
        simplest(states),
        jb.labels.Labelling(simplest.scene, simplest.family, effort)(states),
    )
    for name in ("label", "gait", "cycle_footsteps", "footsteps"):
        np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name), err_msg=name)
    walks = ours.label == jb.basins.Label.WALKING
    assert walks.sum() > 3
    np.testing.assert_allclose(ours.time[walks], theirs.time[walks], rtol=1e-6)
    np.testing.assert_allclose(ours.closest[walks], theirs.closest[walks], rtol=1e-3)


@pytest.fixture(scope="module")
def beyond_doubling():
    """A labelling beyond the slope at which the walker's gait of one footstep loses stability."""
    guess = simplest_state(0.235, -0.235)
    scene = simplest_walker(0.0152)
    assert float(scene.ground.slope) > FIRST_DOUBLING
    with pytest.warns(RuntimeWarning, match="no stable gait was found: starts that walk there"):
        return jb.labelling(scene, guess=guess, accuracy="balanced", footsteps=60)


def test_a_gait_of_two_footsteps_is_met_and_named(beyond_doubling):
    assert beyond_doubling.family.rows == ((),)
    states = stacked([simplest_state(0.23 + 0.001 * i, -0.23 - 0.001 * i) for i in range(3)])
    before = beyond_doubling(states)
    assert (before.names[0], before.cycle_footsteps[0]) == ("unresolved", 2)
    known = jb.labels.with_gaits_met(beyond_doubling, jb.starts.GivenStarts(states))
    (gait,) = known.family.rows[0]
    assert gait.cycle_footsteps == 2
    radius = abs(gait.multipliers[0])
    assert 0.5 < radius < 1.0
    found = known(states)
    assert found.names[0] == "walking period-2"
    assert (found.gait[0], found.cycle_footsteps[0]) == (0, 2)
    # The last cycle of a walk that ends near a gait shrinks as its largest multiplier says.
    small = known.family._replace(rows=((gait._replace(radius=1e-5),),))
    found = jb.labels.Labelling(known.scene, small, known.effort)(states)
    assert found.names[0] == "walking period-2"
    assert found.rate[0] == pytest.approx(np.sqrt(radius), rel=0.03)


def test_gaits_are_those_of_each_parameter(simplest):
    slopes = [0.008, 0.009]
    guess = simplest.family.states[0]
    own = jb.labelling(
        simplest.scene, parameters={"slope": slopes}, guess=guess, accuracy="balanced"
    )
    assert len(own.family.rows) == 2
    low, high = (row[0] for row in own.family.rows)
    np.testing.assert_allclose(high.point, simplest.family.rows[0][0].point, atol=1e-7)
    assert low.point[1] < high.point[1] - 5e-3
    starts = jb.starts.grid(simplest.scene, {"slope": slopes, "omega_swing": [-0.17, -0.18]})
    found = jb.sweep(own, starts)
    assert np.all(found.label == jb.basins.Label.WALKING)
    # Starts take from the gait of their own slope what they are not told.
    np.testing.assert_array_equal(
        starts.batch(own, 0, 4).states.theta_2,
        low.point[[1] * 2].tolist() + high.point[[1] * 2].tolist(),
    )
    with pytest.raises(jb.ArgumentError, match=r"slope = 0\.0085 is not allowed: no gait was"):
        jb.sweep(own, jb.starts.grid(simplest.scene, {"slope": [0.0085]}))
    with pytest.raises(jb.ArgumentError, match="the gaits are known for"):
        own(starts.batch(own, 0, 4).states)
    # Without gaits for its parameters a sample is labelled by what repeats itself.
    sampled = jb.sweep(simplest, jb.starts.sample(simplest.scene, {"slope": (0.0085, 0.0095)}, 4))
    assert np.all(sampled.label == jb.basins.Label.WALKING)
    assert np.all(sampled.gait == -1)
    assert np.all(sampled.cycle_footsteps == 1)


def test_bristles_start_straight():
    seed = jb.seed_scene()
    scene = jb.Scene(
        walker=seed.walker,
        ground=seed.ground,
        normal=seed.normal,
        friction=jb.laws.LuGre(mu_static=0.5, mu_kinetic=0.4, v_s=1e-3, sigma_0=5e4, sigma_1=100.0),
        clearance=seed.clearance,
    )
    straight = jb.dynamics.BristleState(*jb.seed_state(), *[np.zeros(())] * 2)
    labelling = gaitless(scene, straight, accuracy="draft", footsteps=1)
    short, full = (stacked([state] * 2) for state in (jb.seed_state(), straight))
    same(labelling(short), labelling(full))
    found = jb.sweep(labelling, jb.starts.GivenStarts(short), look_for_gaits=False)
    assert found.start_hip_z.shape == (2,)
    assert jtu.tree_leaves(labelling.settings()["scene"])


def test_a_labelling_knows_the_stable_gait_where_the_seeds_start_leads_to_another():
    """At 0.03 rad Newton's method from the seed's start comes to an unstable gait."""
    label = jb.labelling(jb.seed_scene(slope=0.03))
    (gait,) = label.family.rows[0]
    assert gait.duration == pytest.approx(0.4464368, abs=1e-6)
