"""Homotopy: its scenes against both ends, branches along it against curves in closed form."""

import dataclasses
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.gait import BranchEnd
from jaxbiped.gait._branch_along import follow_branch
from jaxbiped.gait._homotopy import _is_ahead, homotopy_to
from jaxbiped.gait._pseudo_arclength import Change
from tests.mechanisms import seed_walker

SCENES = {
    "seed": jb.seed_scene(slope=0.05, K=1e8, hip_mass=2.0),
    "uphill": jb.seed_scene(slope=-0.01),
    "rigid": jb.RigidScene(
        walker=jb.Walker(m=5.0, J=0.0, l=1.0, d=0.5, r=0.0, hip_mass=9.0),
        ground=jb.Ground(slope=0.05),
    ),
    "other laws": jb.Scene(
        walker=jb.seed_scene().walker,
        ground=jb.Ground(slope=0.03),
        normal=jb.laws.normal_law_like("tsuji", K=1e5, c=1e6, n=1.5, mass=2.0, g=9.8),
        friction=jb.laws.friction_law_like(
            "lugre", mu_static=0.6, mu_kinetic=0.5, v0=1e-3, xi=10.0
        ),
    ),
}


@pytest.mark.parametrize("name", SCENES)
def test_the_line_joins_the_seed_to_the_scene(name):
    scene = jax.tree.map(lambda leaf: jnp.asarray(leaf, dtype=float), SCENES[name])
    line = homotopy_to(scene)
    assert jax.tree.structure(line.first) == jax.tree.structure(scene)
    for s, end in ((0.0, line.first), (1.0, scene)):
        for got, wanted in zip(jax.tree.leaves(line.at(s)), jax.tree.leaves(end), strict=True):
            np.testing.assert_allclose(got, wanted, rtol=1e-14, atol=0.0)
    assert float(line.first.walker.l) == float(jb.seed_scene().walker.l)
    assert float(line.first.ground.slope) == 0.02


def test_a_walker_without_a_mass_at_its_hip_has_none_on_the_line_either():
    scene = dataclasses.replace(jb.seed_scene(slope=0.05), walker=seed_walker())
    scene = jax.tree.map(lambda leaf: jnp.asarray(leaf, dtype=float), scene)
    line = homotopy_to(scene)
    assert jax.tree.structure(line.first) == jax.tree.structure(scene)
    assert line.first.walker.root_mass is None
    assert float(line.first.walker.total_mass) == pytest.approx(float(scene.walker.total_mass))


def test_the_line_ends_in_the_very_numbers_of_the_scene():
    """A ratio that is multiplied out again need not give its numerator back."""
    generator = np.random.default_rng(2)
    for stiffness, damping, mass in generator.uniform(1.0, 9.0, (10, 3)).tolist():
        scene = jb.seed_scene(K=1e7 * stiffness, c=1e7 * damping, hip_mass=mass)
        for got, wanted in zip(
            jax.tree.leaves(homotopy_to(scene).at(1.0)), jax.tree.leaves(scene), strict=True
        ):
            assert float(got) == float(wanted)


def test_positive_parameters_go_geometrically_and_slopes_are_derivatives():
    line = homotopy_to(SCENES["seed"])
    assert float(line.at(0.5).normal.K) == pytest.approx(1e7)
    assert float(line.at(0.5).walker.hip_mass) == pytest.approx(1.0)
    step = 1e-6
    ends = [np.array(jax.tree.leaves(line.at(0.3 + h))) for h in (-step, step)]
    slopes = (ends[1] - ends[0]) / (2.0 * step)
    np.testing.assert_allclose(line.slopes(0.3), slopes, rtol=1e-6, atol=1e-8)


def test_laws_resemble_the_seeds_at_the_beginning():
    seed = jb.seed_scene()
    begin = homotopy_to(SCENES["other laws"]).first
    like = jb.laws.normal_law_like("tsuji", K=1e6, c=1e7, n=1.5, mass=2.0, g=9.8)
    assert float(begin.normal.K) == pytest.approx(float(like.K))
    assert float(begin.friction.mu_static) == float(seed.friction.mu_static)


def branch_of(value, by_point, by_s, *, start=0.0, ends=lambda s: 0, scale=1.0):
    """The branch of zeros of a function of x and s from x = `start`."""

    def change(point, s):
        x = float(point[0])
        parts = np.array([value(x, s)]), np.array([[by_point(x)]]), np.array([by_s(s)])
        return Change(*parts, ends(s))

    return follow_branch(change, np.array([start]), scales=np.array([scale]))


def test_a_smooth_branch_is_followed_to_its_end():
    branch = branch_of(
        lambda x, s: x - np.exp(2 * s), lambda x: 1.0, lambda s: -2 * np.exp(2 * s), start=1.0
    )
    assert branch.end is BranchEnd.REACHED
    assert branch.s[-1] == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(branch.points[:, 0], np.exp(2.0 * branch.s), atol=1e-7)


def test_a_fold_is_told_with_its_place():
    """x² = 0.6 − s from x > 0 turns back at s = 0.6."""
    branch = branch_of(
        lambda x, s: x * x - 0.6 + s, lambda x: 2.0 * x, lambda s: 1.0, start=0.6**0.5
    )
    assert branch.end is BranchEnd.FOLD
    assert branch.s[branch.farthest] == pytest.approx(0.6, abs=1e-6)
    # The branch was followed around the fold, to the other sign of x.
    assert branch.points[-1, 0] < 0.0
    np.testing.assert_allclose(branch.points[:, 0] ** 2, 0.6 - branch.s, atol=1e-7)


def test_two_folds_on_the_way_are_passed():
    """A cubic in x: an S-shaped branch reaches s = 1 beyond both of its folds."""

    def s_of(x):
        return 8.0 * ((x - 0.5) ** 3 - 0.06 * (x - 0.5)) + 0.5

    def slope(x):
        return 8.0 * (3.0 * (x - 0.5) ** 2 - 0.06)

    start = float(np.roots([8.0, 0.0, -0.48, 0.5]).real.min()) + 0.5
    assert s_of(start) == pytest.approx(0.0, abs=1e-9)
    branch = branch_of(lambda x, s: s_of(x) - s, slope, lambda s: -1.0, start=start, scale=0.2)
    assert branch.end is BranchEnd.REACHED
    assert np.sum(np.diff(np.sign(np.diff(branch.s))) != 0) == 2
    assert s_of(branch.points[-1, 0]) == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize(
    ("jump", "ends", "end", "code", "place"),
    [
        (0.0, lambda s: 3 if s > 0.4 else 0, BranchEnd.WALK_ENDS, 3, 0.4),
        (50.0, lambda s: 0, BranchEnd.BREAKS_OFF, 0, 0.3),
        (0.0, lambda s: 2, BranchEnd.NO_BEGINNING, 2, 0.0),
    ],
    ids=["the walk ends", "the map jumps", "there is no beginning"],
)
def test_a_branch_ends_where_it_cannot_be_followed(jump, ends, end, code, place):
    branch = branch_of(
        lambda x, s: x - s - jump * (s > 0.3), lambda x: 1.0, lambda s: -1.0, ends=ends
    )
    assert (branch.end, branch.code) == (end, code)
    assert branch.s[branch.farthest] == pytest.approx(place, abs=1e-3)


def test_a_branch_of_several_components_is_in_their_own_units():
    """(s, s², 3 − s) from s = 1/4, whatever sizes arclength is measured in."""

    def change(point, s):
        x, y, z = point
        value = np.array([s - x, x * x - y, 3.0 - s - z])
        by_point = np.array([[-1.0, 0.0, 0.0], [2.0 * x, -1.0, 0.0], [0.0, 0.0, -1.0]])
        return Change(value, by_point, np.array([1.0, 0.0, -1.0]), 0)

    for scales in (np.ones(3), np.array([2.0, 0.5, 4.0])):
        branch = follow_branch(change, np.array([0.25, 0.0625, 2.75]), 0.25, scales=scales)
        assert branch.end is BranchEnd.REACHED
        assert branch.s[[0, -1]] == pytest.approx([0.25, 1.0], abs=1e-12)
        expected = np.stack([branch.s, branch.s**2, 3.0 - branch.s], axis=1)
        np.testing.assert_allclose(branch.points, expected, atol=1e-6)


@pytest.mark.parametrize(
    ("latest_s", "point", "ahead"),
    [
        (0.2, 1.4, True),
        (0.2, 1.3, True),
        (0.2, 1.2, False),
        (0.2, 1.0, False),
        (0.0, 1.0, True),
        (0.0, 0.8, True),
        (0.0, 1.2, False),
    ],
)
def test_a_gait_is_ahead_where_those_before_it_point_or_at_first_where_it_is_near(
    latest_s, point, ahead
):
    """From 0.9 they point to 1.4: a longer way may lead farther aside, by half its length."""
    way = SimpleNamespace(
        at=jnp.array([0.0, latest_s]), latest_point=jnp.array([0.9]), ahead=jnp.array([1.4])
    )
    assert bool(_is_ahead(way, jnp.array([point]))) is ahead
