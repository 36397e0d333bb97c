"""A trajectory between its steps, against diffrax's own; at its ends, and beyond them."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped._types import AT_ONCE, in_parts
from jaxbiped.solve._trajectory import evaluate_dense


def _oscillation(solver):
    return diffrax.diffeqsolve(
        diffrax.ODETerm(lambda t, y, args: {"x": y["v"], "v": -y["x"]}),
        solver,
        t0=0.5,
        t1=3.0,
        dt0=0.1,
        y0={"x": jnp.asarray(1.0), "v": jnp.asarray(0.0)},
        saveat=diffrax.SaveAt(dense=True),
        stepsize_controller=diffrax.PIDController(rtol=1e-5, atol=1e-7),
        max_steps=300,
    ).interpolation


@pytest.mark.parametrize(
    "solver", [jb.solvers.Rodas4(), jb.solvers.Rodas5P(), diffrax.Tsit5(), diffrax.Bosh3()]
)
def test_states_are_those_of_diffrax(solver):
    dense = _oscillation(solver)
    steps = np.asarray(dense.ts)[: int(dense.ts_size)]
    times = np.concatenate([[0.4, np.nan], np.linspace(0.5, 3.0, 37), steps, [3.1]])
    expected = jax.vmap(dense.evaluate)(jnp.asarray(times))
    found = evaluate_dense(dense, times)
    for name in ("x", "v"):
        np.testing.assert_allclose(found[name], expected[name], rtol=1e-14, atol=1e-15)
    assert np.isnan(found["x"][[0, 1, -1]]).all()
    # The closed form of the oscillation, to what this tolerance and dense output are good for.
    np.testing.assert_allclose(found["x"][2:-1], np.cos(times[2:-1] - 0.5), atol=3e-4)
    np.testing.assert_allclose(found["v"][2:-1], -np.sin(times[2:-1] - 0.5), atol=3e-4)


@pytest.mark.parametrize("size", [0, 1, AT_ONCE - 1, AT_ONCE, AT_ONCE + 1, 3 * AT_ONCE])
def test_parts_of_one_size_make_the_whole(size):
    values = np.arange(float(size))
    shapes = []

    def doubled(part):
        shapes.append((part["x"].shape, part["y"].shape))
        return 2.0 * part["x"], part["y"][:, 1]

    twice, second = in_parts(doubled, {"x": values, "y": np.stack([values, -values], axis=1)})
    assert shapes == [((AT_ONCE,), (AT_ONCE, 2))] * max(1, -(-size // AT_ONCE))
    np.testing.assert_array_equal(twice, 2.0 * values)
    np.testing.assert_array_equal(second, -values)


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
