"""The periodic gait in redundant coordinates, against the minimal one."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb

pytestmark = pytest.mark.slow

HOW = dict(parameters=("K", "c"), radius_sensitivities=False, accuracy="tight")


@pytest.fixture(scope="module")
def gaits():
    """The seed's gait in minimal coordinates, and in redundant ones."""
    scene = jb.seed_scene()
    minimal = jb.find_gait(scene, **HOW)
    redundant = jb.find_gait(jb.RedundantScene(scene), minimal.measures.state, **HOW)
    return minimal, redundant


@pytest.mark.nightly
def test_gait_multipliers_and_sensitivities_agree(gaits):
    minimal, redundant = gaits
    assert redundant.outcome is jb.gait.Search.FOUND
    assert redundant.engine == "lanes"
    assert redundant.multipliers.shape == (6,)
    ours, expected = redundant.measures, minimal.measures
    for name in ("period", "step_length", "speed", "spectral_radius"):
        assert float(getattr(ours, name)) == pytest.approx(float(getattr(expected, name)), abs=1e-6)
    for a, b in zip(jax.tree.leaves(ours.state), jax.tree.leaves(expected.state), strict=True):
        assert abs(float(a - b)) < 1e-6
    times, states = redundant.orbit
    assert isinstance(states, jb.State)
    assert np.isfinite(np.asarray(states.hip_x[0])[np.isfinite(np.asarray(times[0]))]).all()
    gaps = np.abs(np.asarray(redundant.multipliers) - np.asarray(minimal.multipliers))
    assert gaps.max() < 1e-6
    for name in ("sensitivities", "elasticities"):
        ours, expected = (np.asarray(getattr(gait, name).period) for gait in (redundant, minimal))
        np.testing.assert_allclose(ours, expected, atol=1e-6)
        # These are small numbers: to digits of their own as well.
        np.testing.assert_allclose(ours, expected, rtol=1e-5)


@pytest.mark.nightly
def test_measures_differentiate_in_both_modes(gaits):
    """By the leaves of what is modelled; the method's own have no part in the gait."""
    minimal, redundant = gaits
    scene, start = jb.RedundantScene(jb.seed_scene()), redundant.measures.state

    def period(scene):
        return jb.gait_measures(scene, start, accuracy="tight").period

    value, slopes = jax.value_and_grad(period)(scene)
    assert float(value) == pytest.approx(float(minimal.measures.period), abs=1e-9)
    modelled = slopes.scene.normal
    for name, slope, at in zip(
        HOW["parameters"], minimal.sensitivities.period, (1e6, 1e7), strict=True
    ):
        assert float(getattr(modelled, name)) == pytest.approx(float(slope), rel=1e-5)
        along = jax.jvp(
            lambda x, name=name: period(jb.with_parameters(scene, {name: x})),
            (jnp.asarray(at),),
            (jnp.asarray(1.0),),
        )
        assert float(along[1]) == pytest.approx(float(getattr(modelled, name)), rel=1e-9)


def test_return_map_takes_tangents_in_redundant_coordinates():
    """Traced, not run: bristles that a state lacks have no tangents, and nothing asks for any."""

    def lasting(stiffness):
        scene = jb.with_parameters(jb.RedundantScene(jb.seed_scene()), {"K": stiffness})
        return jb.return_map(scene, jb.seed_state())

    one = jnp.asarray(1.0)
    arrived, slope = jax.eval_shape(lambda k: jax.jvp(lasting, (k,), (one,)), 1e6 * one)
    assert isinstance(arrived.state, jb.State)
    assert slope.time.shape == slope.state.hip_x.shape == ()


@pytest.mark.nightly
def test_a_return_is_diffraxs():
    """In redundant coordinates from the start, of a method that projects."""
    scene = jb.RedundantScene(jb.seed_scene(), "described")
    start = jb.dynamics.redundant_state(scene, jb.seed_state())
    lanes, xla = (jb.return_map(scene, start, engine=engine) for engine in ("lanes", "xla"))
    assert float(lanes.time) == pytest.approx(float(xla.time), abs=1e-6)
    for a, b in zip(jax.tree.leaves(lanes.state), jax.tree.leaves(xla.state), strict=True):
        assert float(a) == pytest.approx(float(b), abs=1e-5)
