"""The start without a guess, against walkers of any size."""

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.gait._search_starts import default_guess
from tests.solve.test_units import sized


def test_the_seeds_own_start_is_the_papers():
    assert [float(x) for x in default_guess(jb.seed_scene())] == [float(x) for x in jb.seed_state()]


@pytest.mark.parametrize(("length", "time"), [(1e-3, 1e-3**0.5), (1e3, 2.0)])
def test_a_walker_of_any_size_starts_alike(length, time):
    scene, start, _ = sized(length, time)
    fitted = default_guess(scene)
    np.testing.assert_allclose(np.array(fitted), np.array(start), rtol=1e-12)
    walk = jb.simulate(scene, fitted, duration=0.45 * time, save="end", engine="lanes")
    assert walk.outcome == jb.Ending.WALKING
