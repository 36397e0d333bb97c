"""The search without a guess, against walks that settle and gaits that are known."""

import dataclasses
import warnings

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from tests.rigid_walkers import rigid_seed, simplest_walker

AT_THE_PEAK = (
    *(0.39938175678, -0.03094697743654, 0.0, 0.53105390071869, -0.00069004081888),
    *(3.19638276100159, -1.32769119739532, -1.03811444205348e-05, 0.00650604115799),
)
"""A gait of the bristles on 0.0592 rad, without hip_x."""
pytestmark = pytest.mark.slow

PLAIN = dict(parameters=(), radius_sensitivities=False)
# Periods of the stable gaits, by an independent integrator.
TRUTH = {0.01: 0.43236, 0.012: 0.43554, 0.03: 0.44644, 0.04: 0.45210, 0.06: 0.46361, 0.08: 0.47508}


@pytest.mark.parametrize("slope", TRUTH)
def test_the_stable_gait_is_found_on_every_slope(slope):
    gait = jb.find_gait(jb.seed_scene(slope=slope), **PLAIN)
    assert gait.outcome is jb.gait.Search.FOUND
    assert bool(gait.stable)
    assert float(gait.measures.period) == pytest.approx(TRUTH[slope], abs=1e-5)


@pytest.mark.parametrize(("stiffness", "options"), [
    pytest.param(
        10.0**8.25, [{"parameters": ("K",)}, {"parameters": ("c",), "radius_sensitivities": False}],
        marks=pytest.mark.nightly,
    ),
    (4e8, []),
])  # fmt: skip
def test_on_stiff_ground_the_gait_is_the_one_that_walks_settle_on(stiffness, options):
    """Feet bounce there, for thousands of steps. Which derivatives are asked for changes no bit."""
    scene = jb.seed_scene(slope=0.02, K=stiffness)
    gait = jb.find_gait(scene, **PLAIN)
    assert bool(gait.stable)
    for each in options:
        other = jb.find_gait(scene, **each)
        np.testing.assert_array_equal(other.multipliers, gait.multipliers)
        np.testing.assert_array_equal(other.measures.period, gait.measures.period)
    pushed = gait.measures.state._replace(omega_1=gait.measures.state.omega_1 * 1.001)
    walk = jb.simulate(scene, pushed, footsteps=14, max_solver_steps=400_000, accuracy="balanced")
    settled = np.asarray(jb.footsteps(scene, walk).period_s)[-4:]
    np.testing.assert_allclose(settled, float(gait.measures.period), atol=2e-6)


def test_the_unstable_gait_that_was_seen_is_told_and_found_from_its_state():
    scene = jb.seed_scene(slope=0.03)
    gait = jb.find_gait(scene, **PLAIN)
    assert gait.found_by is jb.gait.FoundBy.WALKING
    (other,) = gait.others
    assert other.period == pytest.approx(0.38827, abs=1e-5)
    assert other.spectral_radius == pytest.approx(2.39, abs=0.01)
    assert "0.388268 s (spectral radius 2.39)" in jb.gait.explain_search(scene, gait)
    near = jb.find_gait(scene, jax.tree.map(jnp.asarray, other.state), **PLAIN)
    assert float(near.measures.period) == pytest.approx(0.38827, abs=1e-5)
    assert near.found_by is jb.gait.FoundBy.GUESS
    assert not bool(near.stable)
    assert near.others == []


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        (jb.seed_scene(slope=0.005), ("fold", "slope = 0.0095")),
        (jb.seed_scene(slope=0.3), ("ends at slope = 0.26", "stops")),
        (
            eqx.tree_at(lambda s: s.friction, jb.seed_scene(), jb.laws.Frictionless()),
            ("seed's walker has no gait under these laws",),
        ),
    ],
    ids=["flat", "steep", "frictionless"],
)
def test_where_there_is_no_gait_the_end_of_the_branch_is_told(scene, words):
    gait = jb.find_gait(scene, **PLAIN)
    assert gait.outcome is not jb.gait.Search.FOUND
    said = jb.gait.explain_search(scene, gait)
    assert said.startswith("no gait found: ")
    for word in words:
        assert word in said


@pytest.mark.nightly
def test_a_walker_with_large_feet_that_stands_on_a_gentle_slope_has_only_an_unstable_gait():
    """A foot that chatters where it stands is no gait; the seed's walker tells which is one."""
    seed = jb.seed_scene(slope=0.005, r=0.2)
    scene = dataclasses.replace(seed, walker=seed.walker.mechanism())
    gait = jb.find_gait(scene, **PLAIN)
    assert not bool(gait.stable)
    assert float(gait.measures.period) == pytest.approx(0.406768, abs=1e-6)
    assert float(gait.measures.spectral_radius) == pytest.approx(1.3514, abs=1e-3)
    own = jb.find_gait(seed, **PLAIN)
    assert float(own.measures.period) == pytest.approx(float(gait.measures.period), abs=1e-6)


def test_the_nearest_scene_on_the_branch_has_a_gait():
    gait = jb.find_gait(jb.seed_scene(slope=0.005), **PLAIN)
    assert jb.gait.BranchEnd(int(gait.origin.branch_end)) is jb.gait.BranchEnd.FOLD
    near = jb.find_gait(
        jb.seed_scene(slope=float(gait.origin.nearest.ground.slope) + 1e-4), **PLAIN
    )
    assert near.outcome is jb.gait.Search.FOUND


def test_under_vmap_a_branch_is_followed_and_each_lane_says_how():
    slopes = jnp.array([0.02, 0.03, 0.04, 0.3])

    def one(slope):
        scene = eqx.tree_at(lambda s: s.ground.slope, jb.seed_scene(), slope)
        return jb.find_gait(scene, **PLAIN)

    gaits = jax.jit(jax.vmap(one))(slopes)
    np.testing.assert_allclose(
        gaits.measures.period[:3], [0.4408348, 0.4464368, 0.4521010], atol=1e-6
    )
    by = [jb.gait.FoundBy(int(code)) for code in gaits.origin.found_by[:3]]
    assert by == [jb.gait.FoundBy.START, jb.gait.FoundBy.CONTINUATION, jb.gait.FoundBy.CONTINUATION]
    assert int(gaits.ending[3]) != int(jb.gait.Search.FOUND)
    ends = [jb.gait.BranchEnd(int(code)) for code in gaits.origin.branch_end]
    reached = jb.gait.BranchEnd.REACHED
    assert ends == [jb.gait.BranchEnd.NOT_FOLLOWED, reached, reached, jb.gait.BranchEnd.WALK_ENDS]
    assert 0.2 < float(gaits.origin.nearest.ground.slope[3]) < 0.3


@pytest.mark.parametrize("slope", [0.005, 0.05, 0.1])
def test_rigid_gaits_are_found(slope):
    gait = jb.find_gait(rigid_seed(slope), **PLAIN)
    assert gait.outcome is jb.gait.Search.FOUND
    walk = jb.rigid_walk(
        rigid_seed(slope), gait.measures.state, footsteps=100, accuracy="tight", max_arrivals=100
    )
    assert walk.outcome is jb.Ending.WALKING
    if bool(gait.stable):
        last = float(walk.arrivals.t[-1] - walk.arrivals.t[-2])
        assert float(gait.measures.period) == pytest.approx(last, abs=1e-6)


def test_the_simplest_walker_is_found_with_its_cycles():
    """Stable cycles of one footstep at 0.009 and of two at 0.016 (Garcia et al. 1998)."""
    one = jb.find_gait(simplest_walker(0.009), **PLAIN)
    assert bool(one.stable)
    assert not bool(jb.find_gait(simplest_walker(0.016), **PLAIN).stable)
    two = jb.find_gait(simplest_walker(0.016), footsteps=2, **PLAIN)
    assert bool(two.stable)


def test_a_search_that_may_take_few_cycles_stays_at_its_start():
    gait = jb.find_gait(jb.seed_scene(slope=0.03), max_evaluations=3, **PLAIN)
    assert gait.outcome is jb.gait.Search.NOT_CONVERGED
    assert gait.found_by is jb.gait.FoundBy.START


def test_a_scene_with_bristles_is_searched_in_stages_too():
    """LuGre's bristles on the slope where Newton's method alone comes to an unstable gait."""
    like = jb.laws.friction_law_like("lugre", mu_static=0.5, mu_kinetic=0.4, v0=1e-4, xi=1e3)
    scene = eqx.tree_at(lambda s: s.friction, jb.seed_scene(slope=0.03), like)
    gait = jb.find_gait(scene, **PLAIN)
    assert bool(gait.stable)
    assert float(gait.measures.period) == pytest.approx(0.4464, abs=1e-3)
    assert gait.measures.state._fields[-1] == "bristle_2"


def test_multipliers_hold_where_the_load_peaks_as_the_clearance_rule_admits_a_foot():
    """An unstable gait of the bristles; central differences of the return map."""
    scene = jb.with_parameters(jb.ladder()["bristles"], {"slope": 0.0592})
    start = jb.dynamics.BristleState(0.0, *AT_THE_PEAK)
    gait = jb.find_gait(scene, start, **PLAIN)
    state = np.array([float(each) for each in gait.measures.state[1:]])

    def returned(point):
        found = jb.return_map(scene, jb.dynamics.BristleState(0.0, *point), accuracy="tight").state
        return np.array([float(each) for each in found[1:]])

    step = 1e-6 * np.eye(len(state))
    slopes = [(returned(state + h) - returned(state - h)) / 2e-6 for h in step]
    right = np.sort(np.abs(np.linalg.eigvals(np.stack(slopes, axis=1))))[::-1][:3]
    np.testing.assert_allclose(np.abs(gait.multipliers)[:3], right, rtol=1e-4)


def test_a_gait_that_grazes_a_switch_is_told():
    scene = jb.ladder()["rigid"]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        gait = jb.find_gait(scene, **PLAIN)
    assert int(gait.grazes) == 0
    assert "grazes" not in jb.gait.explain_search(scene, gait)
    grazing = eqx.tree_at(lambda each: each.grazes, gait, jnp.asarray(2))
    assert "the gait grazes a switch 2 times" in jb.gait.explain_search(scene, grazing)
