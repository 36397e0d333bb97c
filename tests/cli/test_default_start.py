"""Where a command starts that was not told otherwise, against the seed's own start."""

import dataclasses

import jax
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.cli._start_options import default_start


@pytest.mark.parametrize("slope", [0.02, 0.04])
def test_the_seed_s_scene_starts_as_the_seed_to_the_last_bit(slope):
    start = default_start(jb.seed_scene(slope=slope))
    assert jax.tree.leaves(start) == jax.tree.leaves(jb.seed_state())
    seed = jb.seed_scene(slope=slope)
    rolling = default_start(jb.RigidScene(seed.walker, seed.ground))
    assert jax.tree.leaves(rolling) == jax.tree.leaves(jb.dynamics.rigid_state(jb.seed_state()))


def _load(scene, start):
    """The elastic force under the standing foot, in units of the weight."""
    foot = jb.dynamics.feet(scene, start)[1]
    force = scene.normal.elastic_force(foot.penetration)
    return float(force / (scene.walker.total_mass * scene.ground.g))


SCENES = {
    "stiff": jb.seed_scene(K=1e12),
    "soft": jb.seed_scene(K=1e4),
    "longer": jb.seed_scene(l=0.8, d=0.3),
    "heavier": jb.seed_scene(m=3.0, hip_mass=2.0),
    "on the moon": jb.seed_scene(g=1.6),
    "linear": dataclasses.replace(jb.seed_scene(), normal=jb.laws.KelvinVoigt(3e4, 100.0)),
    "smooth": dataclasses.replace(
        jb.seed_scene(), normal=jb.laws.SmoothRistowSchafer(K=1e7, c=1e7)
    ),
}


@pytest.mark.parametrize("name", SCENES)
def test_another_scene_is_loaded_as_the_seed_s(name):
    expected = _load(jb.seed_scene(), jb.seed_state())
    assert _load(SCENES[name], default_start(SCENES[name])) == pytest.approx(expected, rel=1e-6)


def test_a_ground_too_soft_to_stand_on_is_started_near_its_surface():
    scene = jb.seed_scene(K=2.0)
    foot = jb.dynamics.feet(scene, default_start(scene))[1]
    assert float(foot.penetration) == pytest.approx(0.04, rel=1e-6)


def test_a_stiff_ground_is_walked_on_from_there():
    """It used to stop after 2e-7 s, thrown up by 0.63 mm of a ground of 1e12 N/m^1.5."""
    scene = jb.seed_scene(K=1e12)
    walk = jb.simulate(scene, default_start(scene), duration=0.2, save="end")
    assert walk.outcome is jb.Ending.WALKING
    assert np.isfinite(np.array(walk.final)).all()
