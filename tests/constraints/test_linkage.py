"""Φ, J and J̇q̇ of linkages against derivatives taken by JAX."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.constraints._constraint_methods import correct_step
from jaxbiped.constraints._linkage import constraints_of, masses_of
from tests.linkages import (
    four_bar,
    four_bar_state,
    hanging,
    pinned_pendulum,
    with_euler_parameters,
)


def held_pendulum(orientation):
    """The pendulum with a sum of both angles that is held."""
    held = jb.constraints.LinkAngle(0.3, ((0, 1.0), (1, -0.5)))
    return dataclasses.replace(pinned_pendulum(orientation), angles=(held,))


LINKAGES = {"pendulum": pinned_pendulum, "four-bar": four_bar, "held": held_pendulum}


@pytest.mark.parametrize("orientation", ["angle", "euler"])
@pytest.mark.parametrize("kind", LINKAGES)
def test_derivatives_are_exact(kind, orientation):
    linkage = LINKAGES[kind](orientation)
    size = linkage.coordinates * len(linkage.bodies)
    generator = np.random.default_rng(1)
    q, v = jnp.asarray(generator.normal(size=(2, size)))

    def off(q):
        return jnp.stack(constraints_of(linkage, list(q), [jnp.zeros(())] * size).violation)

    @jax.jit
    def both(q, v):
        at = constraints_of(linkage, list(q), list(v))
        dense = [jnp.stack([row.get(c, jnp.zeros(())) for c in range(size)]) for row in at.rows]
        written = jnp.stack(dense), jnp.stack(at.rate), jnp.stack(at.bias)
        jacobian = jax.jacfwd(off)(q)
        turned = jax.jvp(lambda q: jax.jvp(off, (q,), (v,))[1], (q,), (v,))[1]
        return written, (jacobian, jacobian @ v, -turned)

    written, expected = both(q, v)
    for a, b in zip(written, expected, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-13, atol=1e-13)


def test_states_of_the_linkages_are_consistent():
    for orientation in ("angle", "euler"):
        for linkage, state in (
            (pinned_pendulum(orientation), hanging(0.3, -0.7, rates=(1.0, -2.0))),
            (four_bar(orientation), four_bar_state(1.1, 2.0)),
        ):
            state = with_euler_parameters(state) if orientation == "euler" else state
            at = constraints_of(linkage, *(list(map(jnp.asarray, part)) for part in state))
            np.testing.assert_allclose(np.array(at.violation), 0.0, atol=1e-15)
            np.testing.assert_allclose(np.array(at.rate), 0.0, atol=1e-9)


def test_euler_parameters_have_the_same_energy():
    state = hanging(0.4, -0.9, rates=(1.3, -2.1))
    masses, euler_masses = (
        np.array(masses_of(pinned_pendulum(kind))) for kind in ("angle", "euler")
    )
    energy = 0.5 * masses @ np.array(state.v) ** 2
    other = 0.5 * euler_masses @ np.array(with_euler_parameters(state).v) ** 2
    assert other == pytest.approx(energy, rel=1e-14)


def test_a_projected_step_is_on_its_constraints_with_its_rates():
    linkage = jb.constraints.Linkage(
        (jb.constraints.LinkBody(1.0, 0.1),),
        (jb.constraints.Pin((0.0, 0.5), (0.0, 0.0), 0, None),),
    )
    off = [np.float64(value) for value in (0.01, -0.48, 0.05)], [np.float64(1.0)] * 3
    q, v = correct_step(linkage, jb.constraints.Index1(iterations=4), *off)
    at = constraints_of(linkage, q, v)
    np.testing.assert_allclose([*at.violation, *at.rate], 0.0, atol=1e-12)


@pytest.mark.parametrize(("old", "new"), [("Body", "LinkBody"), ("Joint", "Pin")])
def test_the_names_of_the_last_release_stay_for_this_one(old, new):
    with pytest.warns(DeprecationWarning, match=rf"jaxbiped\.constraints\.{new}"):
        assert getattr(jb.constraints, old) is getattr(jb.constraints, new)
