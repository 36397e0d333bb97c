"""A trajectory between its steps, against diffrax's own; at its ends, and beyond them."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb


def _oscillation(solver):
    solved = diffrax.diffeqsolve(
        diffrax.ODETerm(lambda t, y, args: {"x": y["v"], "v": -y["x"]}),
        solver,
        t0=0.5,
        t1=3.0,
        dt0=0.1,
        y0={"x": jnp.asarray(1.0), "v": jnp.asarray(0.0)},
        saveat=diffrax.SaveAt(dense=True),
        stepsize_controller=diffrax.PIDController(rtol=1e-5, atol=1e-7),
        max_steps=300,
    )
    whole = jnp.zeros((), int)
    ends = np.asarray(solved.interpolation.ts)[: int(solved.interpolation.ts_size)]
    return jb.Trajectory(ends, None, whole, whole, whole, dense=solved.interpolation)


@pytest.mark.parametrize(
    "solver", [jb.solvers.Rodas4(), jb.solvers.Rodas5P(), diffrax.Tsit5(), diffrax.Bosh3()]
)
def test_states_are_those_of_diffrax(solver):
    walk = _oscillation(solver)
    times = np.concatenate([np.linspace(0.5, 3.0, 37), walk.t])
    expected, found = jax.vmap(walk.dense.evaluate)(jnp.asarray(times)), walk.at(times)
    for name in ("x", "v"):
        np.testing.assert_allclose(found[name], expected[name], rtol=1e-14, atol=1e-15)
    # The closed form of the oscillation, to what this tolerance and dense output are good for.
    np.testing.assert_allclose(found["x"], np.cos(times - 0.5), atol=3e-4)
    np.testing.assert_allclose(found["v"], -np.sin(times - 0.5), atol=3e-4)


def test_both_ends_belong_to_it(seed_walk):
    _, walk = seed_walk
    ends = walk.at([0.0, 2.0])
    np.testing.assert_allclose(np.array(ends)[:, 0], [leaf[0] for leaf in walk.state], atol=1e-12)
    np.testing.assert_allclose(np.array(ends)[:, 1], np.array(walk.final), atol=1e-12)


@pytest.mark.parametrize("t", [-0.1, 2.001, float("nan"), [0.5, 2.5], np.nextafter(2.0, 3.0)])
def test_a_time_outside_is_refused_with_the_span(t, seed_walk):
    _, walk = seed_walk
    with pytest.raises(ValueError, match=r"lasts from 0\.0 to 2\.0 s"):
        walk.at(t)


def test_a_traced_time_outside_is_nan(seed_walk):
    _, walk = seed_walk
    inside, outside = jax.jit(lambda t: walk.at(t).theta_1)(np.array([1.0, 2.5]))
    assert np.isfinite(inside)
    assert np.isnan(outside)
