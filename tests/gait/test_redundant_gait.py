"""The periodic gait found in redundant coordinates is the minimal one."""

import jax
import numpy as np
import pytest

import jaxbiped as jb


@pytest.fixture(scope="module")
def gaits():
    """The seed's gait: by lanes in minimal coordinates, and by diffrax in redundant ones."""
    scene = jb.seed_scene()
    how = dict(parameters=("K", "c"), radius_sensitivities=False, accuracy="tight")
    minimal = jb.find_gait(scene, **how)
    redundant = jb.find_gait(jb.RedundantScene(scene), minimal.measures.state, **how)
    return minimal, redundant


def test_gait_multipliers_and_sensitivities_agree(gaits):
    minimal, redundant = gaits
    assert redundant.outcome is jb.Search.FOUND
    assert redundant.engine == "xla"
    assert redundant.multipliers.shape == (6,)
    ours, expected = redundant.measures, minimal.measures
    for name in ("period", "step_length", "speed", "spectral_radius"):
        assert float(getattr(ours, name)) == pytest.approx(float(getattr(expected, name)), abs=1e-6)
    for a, b in zip(jax.tree.leaves(ours.state), jax.tree.leaves(expected.state), strict=True):
        assert abs(float(a - b)) < 1e-6
    gaps = np.abs(np.asarray(redundant.multipliers) - np.asarray(minimal.multipliers))
    assert gaps.max() < 1e-6
    for name in ("sensitivities", "elasticities"):
        ours, expected = (np.asarray(getattr(gait, name).period) for gait in (redundant, minimal))
        np.testing.assert_allclose(ours, expected, atol=1e-6)
        # These are small numbers: to digits of their own as well.
        np.testing.assert_allclose(ours, expected, rtol=1e-5)


def test_orbit_is_told_in_minimal_coordinates(gaits):
    _, redundant = gaits
    times, states = redundant.orbit
    assert isinstance(states, jb.State)
    alive = np.isfinite(np.asarray(times[0]))
    assert np.isfinite(np.asarray(states.hip_x[0])[alive]).all()


def test_other_engines_are_refused():
    with pytest.raises(jb.ArgumentError, match="redundant coordinates are diffrax's"):
        jb.find_gait(jb.RedundantScene(jb.seed_scene()), engine="lanes")
