"""Gait measures: all gradient modes, against each other."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb

pytestmark = pytest.mark.slow


SCENES = {"rigid": (jb.ladder()["rigid"], "dJl"), "seed": (jb.seed_scene(), "Kcl")}
"""And the parameters whose logarithms are moved."""


def gradients(which):
    """Period and step length as functions of three logarithms: with derivatives in every mode."""
    scene, names = SCENES[which]
    values = [float(jb.parameter_values(scene)[name]) for name in names]

    def measured(changes, gradient):
        moved = dict(zip(names, jnp.asarray(values) * jnp.exp(changes), strict=True))
        measures = jb.gait_measures(jb.with_parameters(scene, moved), gradient=gradient)
        return jnp.stack([measures.period, measures.step_length])

    def implicitly(point):
        # Value and derivative of one solve, which compiles sooner than one for each.
        both = lambda p: (measured(p, jb.gait.Implicit()),) * 2
        jacobian, value = jax.jacrev(both, has_aux=True)(point)
        return value, jacobian

    def forwards(point, direction):
        return jax.jvp(lambda p: measured(p, jb.gait.Forward()), (point,), (direction,))

    def in_reverse(point):
        return jax.jacrev(lambda p: measured(p, jb.gait.Reverse()))(point)

    return tuple(map(jax.jit, (implicitly, forwards, in_reverse)))


@pytest.mark.parametrize("which", ["rigid", pytest.param("seed", marks=pytest.mark.nightly)])
def test_all_gradient_modes_agree_on_random_scenes(which):
    implicitly, forwards, in_reverse = gradients(which)
    for changes in np.random.default_rng(5).uniform(-0.03, 0.03, (3, 3)):
        point, direction = jnp.asarray(changes), jnp.array([1.0, -0.5, 0.2])
        value, jacobian = implicitly(point)
        again, slope = forwards(point, direction)
        np.testing.assert_allclose(again, value, atol=1e-5)
        np.testing.assert_allclose(slope, jacobian @ direction, rtol=5e-4, atol=1e-6)
        np.testing.assert_allclose(in_reverse(point), jacobian, rtol=5e-4, atol=1e-6)


def test_gradient_must_be_a_mode():
    with pytest.raises(jb.ArgumentError, match="gradient"):
        jb.gait_measures(jb.seed_scene(), gradient="forward")


def test_second_derivatives_are_refused(monkeypatch, tmp_path):
    """Before a search, whose programs would be kept: no other test has this scene's actuators."""
    monkeypatch.setenv("JAXBIPED_CACHE", str(tmp_path))
    rigid = jb.ladder()["rigid"]
    pulses = tuple(jb.actuation.HipPulse(0.0, phase=phase) for phase in (0.1, 0.2, 0.3))
    rigid = jb.RigidScene(rigid.walker, rigid.ground, pulses)
    start = jb.dynamics.rigid_state(jb.seed_state())

    def period(slope):
        return jb.gait_measures(jb.with_parameters(rigid, {"slope": slope})).period

    def time(rate):
        return jb.return_map(rigid, start._replace(omega_1=rate)).time

    for function, at, said in (
        (period, 0.02, "Second derivatives of gait_measures"),
        (time, 1.5, "Second derivatives of a return map"),
    ):
        with pytest.raises(jb.ArgumentError, match=said):
            jax.make_jaxpr(jax.hessian(function))(at)
    assert not list(tmp_path.rglob("*"))


@pytest.mark.parametrize(
    ("gradient", "mode"),
    [
        (jb.gait.Reverse(), jax.jacrev),
        pytest.param(jb.gait.Forward(), jax.jacfwd, marks=pytest.mark.nightly),
    ],
)
def test_pieces_left_out_do_not_shift_a_scenes_leaves(gradient, mode):
    """Points for feet and no hinge's place: None among the leaves. The root has its own name."""
    legs = tuple(jb.Body(f"leg_{i}", mass=5.0, inertia=0.0, centre=0.5) for i in (1, 2))
    feet = tuple(jb.Foot(f"leg_{i}", centre=1.0) for i in (1, 2))
    pair = (("leg_1", "leg_2"),)
    walker = jb.Mechanism(root="pelvis", root_mass=10.0, bodies=legs, feet=feet, mirror=pair)
    scene = jb.RigidScene(walker=walker, ground=jb.Ground(slope=0.05))
    how = dict(accuracy="tight", parameters=("slope",), radius_sensitivities=False)
    gait = jb.find_gait(scene, **how)

    def measured(slope):
        moved = jb.with_parameters(scene, {"slope": slope})
        measures = jb.gait_measures(moved, gait.measures.state, gradient=gradient, accuracy="tight")
        return jnp.stack([measures.period, measures.step_length])

    own = [gait.sensitivities.period[0], gait.sensitivities.step_length[0]]
    np.testing.assert_allclose(mode(measured)(0.05), np.array(own), rtol=1e-6)
