"""The line of parameters from the seed's scene to another, against its two ends."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.gait._homotopy import homotopy_to

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
