"""Where a command starts that was not told otherwise, against the seed's own start."""

import jax
import numpy as np
import pytest

import jaxbiped as jb
from tests.cli.commands import walked


@pytest.mark.parametrize("slope", [0.02, 0.04])
def test_the_seed_s_scene_starts_as_the_seed_to_the_last_bit(slope):
    _, start = walked(f"--slope {slope}")
    assert jax.tree.leaves(start) == jax.tree.leaves(jb.seed_state())
    _, rolling = walked(f"--model rigid --slope {slope}")
    assert jax.tree.leaves(rolling) == jax.tree.leaves(jb.dynamics.rigid_state(jb.seed_state()))


def _load(scene, start):
    """The elastic force under the standing foot, in units of the weight."""
    foot = jb.dynamics.feet(scene, start)[1]
    force = scene.normal.elastic_force(foot.penetration)
    return float(force / (scene.walker.total_mass * scene.ground.g))


SCENES = {
    "stiff": "--K 1e12",
    "soft": "--K 1e4",
    "longer": "--l 0.8 --d 0.3",
    "heavier": "--m 3 --hip-mass 2",
    "on the moon": "--g 1.6",
    "linear": "--normal kelvin-voigt --K 3e4 --c 100",
    "smooth": "--normal smooth-ristow-schafer --K 1e7 --c 1e7",
}


@pytest.mark.parametrize("name", SCENES)
def test_another_scene_is_loaded_as_the_seed_s(name):
    expected = _load(jb.seed_scene(), jb.seed_state())
    assert _load(*walked(SCENES[name])) == pytest.approx(expected, rel=1e-6)


def test_a_ground_too_soft_to_stand_on_is_started_near_its_surface():
    foot = jb.dynamics.feet(*walked("--K 2"))[1]
    assert float(foot.penetration) == pytest.approx(0.04, rel=1e-6)


def test_a_stiff_ground_is_walked_on_from_there():
    """It used to stop after 2e-7 s, thrown up by 0.63 mm of a ground of 1e12 N/m^1.5."""
    walk = jb.simulate(*walked("--K 1e12"), duration=0.2, save="end")
    assert walk.outcome is jb.Ending.WALKING
    assert np.isfinite(np.array(walk.final)).all()
