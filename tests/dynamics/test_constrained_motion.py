"""Starts put on their constraints, against the constraints and difference quotients."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.compiler import host_jit

SCENE = jb.RedundantScene(jb.seed_scene())
BRISTLES = jb.RedundantScene(jb.ladder()["bristles"])


M, J, D = (float(jb.parameter_values(SCENE)[name]) for name in "mJd")


def apart(q):
    """What is zero on the constraints: where leg 1 has the hip beside where leg 2 has it."""
    hips, lengths = [], []
    for x, z, *turned in jnp.split(q, 2):
        if len(turned) == 1:
            sine, cosine = jnp.sin(turned[0]), jnp.cos(turned[0])
        else:  # by the cosine and the sine of half the angle
            sine, cosine = 2.0 * turned[0] * turned[1], turned[0] ** 2 - turned[1] ** 2
            lengths.append(turned[0] ** 2 + turned[1] ** 2 - 1.0)
        hips.append(jnp.stack([x - D * sine, z + D * cosine]))
    return jnp.stack([*(hips[0] - hips[1]), *lengths])


def pulled(size):
    """The seed's start with leg 1 pulled off the hip by about `size` [m], and as many m/s."""
    start = jb.dynamics.redundant_state(SCENE, jb.seed_state())
    return start._replace(x_1=start.x_1 + size, z_1=start.z_1 - size, vx_2=start.vx_2 + size)


def test_a_correction_is_minimal_in_the_mass_metric():
    """What was moved is M⁻¹Jᵀ times something, with J where it ended: the first-order condition."""
    given = pulled(4e-3)
    found = jb.dynamics.consistent_state(SCENE, given)
    assert float(found.violation.position) == pytest.approx(4e-3 * np.sqrt(2.0), rel=1e-9)
    off = jb.dynamics.violation(SCENE, found.state)
    assert float(off.position) < 1e-15
    assert float(off.rate) < 1e-15
    masses = np.array([M, M, J] * 2)
    jacobian = np.asarray(jax.jacfwd(apart)(jnp.stack(found.state[:6])))
    for part, size in ((slice(0, 6), found.position), (slice(6, 12), found.velocity)):
        moved = np.array(found.state[part]) - np.array(given[part])
        force = masses * moved
        left = force - jacobian.T @ np.linalg.lstsq(jacobian.T, force, rcond=None)[0]
        assert np.abs(left).max() < 1e-12
        assert float(size) == pytest.approx(np.sqrt(moved @ force / 2.0), rel=1e-9)
        assert float(size) > 1e-3


def test_a_start_on_its_constraints_is_left_alone():
    found = jb.dynamics.consistent_state(SCENE, jb.seed_state())
    assert float(found.position) < 1e-16
    assert float(found.velocity) < 1e-15


@pytest.mark.parametrize(
    ("state", "said"),
    [
        (lambda: pulled(0.03), "violates its constraints by 0.0424 m"),
        (
            lambda: jb.dynamics.redundant_state(SCENE, jb.seed_state())._replace(vx_1=3.0),
            "m/s (rate)",
        ),
        (lambda: pulled(float("nan")), "state.x_1 = nan"),
        (
            lambda: jb.dynamics.redundant_state(
                jb.RedundantScene(jb.seed_scene(), orientation="euler"), jb.seed_state()
            ),
            "EulerState",
        ),
        (lambda: jb.dynamics.RigidState(0.0, 0.1, 0.1, 0.0, 0.0), "must be a State"),
        (
            lambda: jb.dynamics.redundant_state(
                BRISTLES, jb.dynamics.BristleState(*jb.seed_state(), 0.0, 0.0)
            ),
            "state has bristles",
        ),
    ],
)
def test_what_cannot_be_corrected_is_refused(state, said):
    with pytest.raises(jb.ArgumentError) as refused:
        jb.dynamics.consistent_state(SCENE, state())
    assert said in str(refused.value)


def test_only_projecting_methods_project():
    scene = jb.RedundantScene(jb.seed_scene(), "standard")
    with pytest.raises(jb.ArgumentError, match="Standard"):
        jb.dynamics.project(scene, pulled(0.0))


# Not compiled: XLA takes minutes over derivatives of an unrolled elimination standing alone.
@pytest.mark.parametrize("orientation", ["angle", pytest.param("euler", marks=pytest.mark.slow)])
def test_derivatives_pass_through_every_projection_exactly(orientation):
    """On the constraints, what a projection lets through obeys them, and passes unchanged."""
    for name in ("index1", "index1aug", "described"):
        scene = jb.RedundantScene(jb.seed_scene(), name, orientation)
        start = jb.dynamics.redundant_state(scene, jb.seed_state())
        size = 4 * scene.linkage.coordinates
        unit = np.eye(size)

        def project(y, scene=scene, size=size, like=start):
            state = type(like)(*y)
            return jnp.stack(list(jb.dynamics.project(scene, state)[:size]))

        at = jnp.stack(list(start[:size]))
        jacobian = np.asarray(host_jit()(jax.jacfwd(project))(at))
        backwards = np.asarray(host_jit()(jax.jacrev(project))(at))
        np.testing.assert_allclose(backwards, jacobian, atol=1e-12)
        np.testing.assert_allclose(jacobian @ jacobian, jacobian, atol=1e-10)

        def off(y):
            return jnp.concatenate(jax.jvp(apart, *[(half,) for half in jnp.split(y, 2)]))

        normal = np.asarray(host_jit()(jax.jacfwd(off))(at))
        np.testing.assert_allclose(normal @ jacobian, 0.0, atol=1e-10)
        free = unit - np.linalg.pinv(normal) @ normal
        np.testing.assert_allclose(jacobian @ free, free, atol=1e-10)
        assert np.linalg.matrix_rank(jacobian, tol=1e-8) == 8
