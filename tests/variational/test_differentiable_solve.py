"""Derivatives through the lane engine, against central differences and in every mode."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb

pytestmark = pytest.mark.slow

LEAVES = {
    "K": lambda scene: scene.normal.K,
    "c": lambda scene: scene.normal.c,
    "slope": lambda scene: scene.ground.slope,
    "l": lambda scene: scene.walker.l,
}


def _final(logs, omega=0.0, *, duration=0.8, **options):
    """The final state as a function of the logarithms of some parameters and of a leg's rate."""
    scene = jb.seed_scene()
    for name, log in logs.items():
        value = LEAVES[name](scene) * jnp.exp(log)
        scene = eqx.tree_at(LEAVES[name], scene, value)
    seed = jb.seed_state()
    state = seed._replace(omega_1=seed.omega_1 + omega)
    options = {"accuracy": "tight", "engine": "lanes", "save": "end", **options}
    return jnp.stack(jb.simulate(scene, state, duration=duration, **options).final)


ZEROS = {name: jnp.asarray(0.0) for name in LEAVES}


def test_forward_mode_against_central_differences():
    by_log = jax.jacfwd(_final)(ZEROS)
    for name in LEAVES:
        h = 3e-5
        # Tighter by far: their errors are divided by h.
        exact = dict(rtol=1e-12, atol=1e-14)
        ends = [np.array(_final({name: jnp.asarray(s * h)}, **exact)) for s in (1.0, -1.0)]
        difference = (ends[0] - ends[1]) / (2.0 * h)
        scale = np.max(np.abs(difference))
        np.testing.assert_allclose(by_log[name], difference, atol=1e-4 * scale)


def test_derivatives_by_the_start_against_central_differences():
    by_rate = jax.jacfwd(lambda omega: _final({}, omega))(jnp.asarray(0.0))
    h = 1e-6
    ends = [np.array(_final({}, jnp.asarray(s * h))) for s in (1.0, -1.0)]
    difference = (ends[0] - ends[1]) / (2.0 * h)
    np.testing.assert_allclose(by_rate, difference, atol=1e-3 * np.max(np.abs(difference)))


def test_reverse_mode_is_forward_modes_transpose():
    forward = jax.jacfwd(_final)(ZEROS)
    reverse = jax.jacrev(_final)(ZEROS)
    for name in LEAVES:
        np.testing.assert_allclose(reverse[name], forward[name], rtol=1e-12)


def test_a_looser_solve_has_derivatives_within_its_own_tolerance():
    tight, loose = (
        jax.jacfwd(lambda log, a=accuracy: _final({"K": log}, accuracy=a))(jnp.asarray(0.0))
        for accuracy in ("tight", "balanced")
    )
    np.testing.assert_allclose(loose, tight, atol=1e-3 * float(jnp.max(jnp.abs(tight))))


def test_derivative_by_the_duration_is_the_rate():
    last, by_time = jax.jvp(
        lambda time: _final({}, duration=time), (jnp.asarray(0.8),), (jnp.asarray(1.0),)
    )
    rates = jb.dynamics.vector_field(0.0, jb.State(*last), jb.seed_scene())
    np.testing.assert_allclose(by_time, jnp.stack(rates), rtol=1e-12)


def test_gradients_under_vmap_and_jit():
    def gradient(log):
        return jax.grad(lambda log: _final({"K": log}, accuracy="balanced")[0])(log)

    logs = jnp.linspace(0.0, 0.1, 3)
    together = jax.jit(jax.vmap(gradient))(logs)
    np.testing.assert_allclose(together, [gradient(log) for log in logs], rtol=1e-12)


def test_saved_times_have_no_derivatives():
    def run(log):
        return _final({"K": log}, save=jnp.array([0.4, 0.8]))

    with pytest.raises(TypeError, match=r"cannot differentiate what the lane engine computes"):
        jax.jacfwd(run)(jnp.asarray(0.0))
