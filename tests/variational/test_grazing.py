"""Grazing, against a closed form: a ball that is pulled up and barely touches the ground."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.gait import slopes_of
from jaxbiped.hybrid import Switch
from tests.systems import Plain

pytestmark = pytest.mark.slow

PULL, PUSH, HEIGHT = 1.3, 3.0, 0.5
"""Acceleration upwards, what the ground adds to it, and the height where the flight is over."""
ABOVE = jb.Section(lambda args, y: y[0] - HEIGHT)
DEPTHS = np.array([1e-3, 1e-6, 1e-7, 1e-8, -1e-8, -1e-7, -1e-3])
"""How deep it would come had there been no ground [m]; the solve knows its height to 1e-9."""
UNKNOWN = np.array([1e-10, 1e-13, -1e-13, -1e-10])


class Pulled(Plain):
    """y'' = a, and a + b under the ground, given as (a, b): its force jumps there."""

    def vector_field(self, t, y, args):
        pull, push = args
        return y[1], jnp.where(y[0] > 0.0, pull, pull + push)

    def switches(self, args, y):
        return (Switch(y[0], True, force_jumps=True),)


def start(depth):
    """At the height 1, so fast that the lowest point lies so deep."""
    return jnp.asarray(1.0), -jnp.sqrt(2.0 * PULL * (1.0 + jnp.asarray(depth)))


def truth(y, v, a, b):
    """Duration of the flight from y at the speed v, and the speed at its end."""
    square = v * v - 2.0 * a * y
    w = jnp.sqrt(jnp.maximum(square, 1e-300))  # at the ground
    out = jnp.sqrt(v * v + 2.0 * a * (HEIGHT - y))
    touching = (-v - w) / a + 2.0 * w / (a + b) + (out - w) / a
    return jnp.stack([jnp.where(square > 0.0, touching, (out - v) / a), out])


def flight(y, v, a, b, engine, gradient):
    r = jb.return_map(
        (a, b),
        (y, v),
        section=ABOVE,
        system=Pulled(),
        gradient=gradient,
        accuracy="tight",
        engine=engine,
    )
    return jnp.stack([r.time, r.state[1]])


def value_and_derivatives(function, depths, transform=jax.jacfwd):
    def both(depth):
        def twice(*at):
            value = function(*at)
            return value, value

        numbers = (*start(depth), jnp.asarray(PULL), jnp.asarray(PUSH))
        slopes, value = transform(twice, argnums=(0, 1, 2, 3), has_aux=True)(*numbers)
        return value, jnp.stack(slopes)

    return map(np.asarray, jax.vmap(both)(jnp.asarray(depths)))


@pytest.mark.parametrize(
    ("engine", "mode"),
    [
        ("lanes", "forward"),
        ("lanes", "reverse"),
        pytest.param("xla", "forward", marks=pytest.mark.nightly),
        pytest.param("xla", "reverse", marks=pytest.mark.nightly),
    ],
)
def test_contacts_between_two_steps_are_felt_or_told(engine, mode):
    gradient = jb.gait.Forward() if mode == "forward" else jb.gait.Reverse()
    transform = jax.jacfwd if mode == "forward" else jax.jacrev

    def ours(*numbers):
        return flight(*numbers, engine, gradient)

    depths = np.concatenate([DEPTHS, UNKNOWN])
    values, slopes = value_and_derivatives(ours, depths, transform)
    right, expected = value_and_derivatives(truth, depths)
    known = slice(len(DEPTHS))
    np.testing.assert_allclose(values[known], right[known], atol=1e-8)
    np.testing.assert_allclose(values, right, atol=1e-6)
    size = np.max(np.abs(expected), axis=(1, 2), keepdims=True)
    np.testing.assert_allclose((slopes / size)[known], (expected / size)[known], atol=1e-3)
    assert np.all(np.isnan(slopes[len(DEPTHS) :]))


@pytest.mark.parametrize("engine", ["lanes", "xla"])
def test_a_linearised_return_counts_its_grazes(engine):
    def grazes(depth):
        once = jb.gait.linearise_return_map(
            (jnp.asarray(PULL), jnp.asarray(PUSH)),
            start(depth),
            rtol=1e-9,
            tangent_rtol=1e-8,
            section=ABOVE,
            system=Pulled(),
            engine=engine,
        )
        return once.grazes, slopes_of(once).period

    counts, slopes = map(np.asarray, jax.vmap(grazes)(jnp.array([1e-3, 1e-7, 1e-12, -1e-12])))
    assert counts[:2].tolist() == [0, 0]
    assert np.all(counts[2:] > 0)
    assert np.all(np.isnan(slopes[2:]))
