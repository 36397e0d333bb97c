"""Scenes of any kind, against their leaves and a kind of one's own."""

import dataclasses
import warnings
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped import Mechanism, Stop
from jaxbiped.hybrid import RedundantWalking, Walking
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.scene._scene import AbstractScene, is_compliant, is_rigid
from jaxbiped.scene._state_types import state_type_of
from tests.mechanisms import FEET, LEGS, WALKERS, scene_of

PARAMETERS = "m J l d r hip slope g K c n mu_s mu_k v0 xi".split()  # noqa: SIM905


def test_seed_scene_holds_the_papers_parameters():
    scene = jb.seed_scene()
    values = [float(leaf) for leaf in jax.tree_util.tree_leaves(scene)]
    expected = [1.0, 0.0096, 0.4, 0.1, 0.08, 0.0, 0.02, 9.8, 1e6, 1e7, 1.5, 0.5, 0.4, 1e-4, 1000.0]
    np.testing.assert_allclose(values, expected)


def test_every_leaf_is_differentiable_and_vmappable():
    """Acceleration of a foot in contact and slipping depends on all that is modelled."""
    state = jb.seed_state()._replace(hip_x=jnp.asarray(0.3), omega_2=jnp.asarray(-1.2565))
    scene = jb.seed_scene(hip_mass=0.5)

    def hip_acceleration(scene):
        return jb.dynamics.accelerations(scene, state).hip_ax

    gradient = jax.grad(hip_acceleration)(scene)
    leaves = dict(zip(PARAMETERS, _leaves(gradient), strict=True))
    assert all(np.isfinite(value) for value in leaves.values())
    idle = {name for name, value in leaves.items() if value == 0.0}
    assert idle <= {"mu_k", "xi"} or idle <= {"mu_s"}
    many = jax.vmap(lambda K: eqx.tree_at(lambda s: s.normal.K, scene, K))(jnp.array([1e5, 1e6]))
    both = jax.vmap(hip_acceleration)(_broadcast(many, 2))
    np.testing.assert_allclose(both[1], hip_acceleration(scene), rtol=1e-12)


def _leaves(tree):
    return [float(leaf) for leaf in jax.tree_util.tree_leaves(tree)]


def _broadcast(tree, n):
    return jax.tree_util.tree_map(lambda leaf: jnp.broadcast_to(leaf, (n,)), tree)


def test_frictionless_forces_have_no_tangential_part():
    seed = jb.seed_scene()
    scene = jb.Scene(seed.walker, seed.ground, seed.normal, jb.laws.Frictionless())
    assert jb.dynamics.foot_forces(scene, jb.seed_state())[0].tangential is None


SEED = jb.seed_scene()
BRISTLES = jb.ladder()["bristles"]
RIGID = jb.RigidScene(SEED.walker, SEED.ground)


@pytest.mark.parametrize(
    ("scene", "compliant", "redundant", "state", "field"),
    [
        (SEED, True, False, jb.State, Walking.vector_field),
        (BRISTLES, True, False, jb.dynamics.BristleState, Walking.vector_field),
        (RIGID, False, False, jb.dynamics.RigidState, jb.hybrid.Rolling().vector_field),
        (
            jb.RedundantScene(SEED),
            True,
            True,
            jb.dynamics.RedundantState,
            RedundantWalking.vector_field,
        ),
        (
            jb.RedundantScene(BRISTLES, "penalty", "euler"),
            True,
            True,
            state_type_of((*jb.dynamics.EulerState._fields, "bristle_1", "bristle_2")),
            RedundantWalking.vector_field,
        ),
    ],
)
def test_every_scene_says_of_what_kind_it_is(scene, compliant, redundant, state, field):
    assert (scene.compliant, scene.redundant) == (compliant, redundant)
    assert (is_compliant(scene), is_rigid(scene)) == (compliant, not compliant)
    assert (scene.state_type, system_of(scene).vector_field) == (state, field)
    assert scene.has_bristles == (scene.minimal.state_type is jb.dynamics.BristleState)
    assert scene.minimal.minimal is scene.minimal
    assert not scene.minimal.redundant


@pytest.mark.parametrize("scene", [SEED, RIGID, jb.RedundantScene(SEED, "penalty")])
def test_parameters_are_those_of_the_minimal_scene(scene):
    changed = jb.with_parameters(scene, {"slope": 0.03})
    assert type(changed) is type(scene)
    assert float(jb.parameter_values(changed)["slope"]) == 0.03
    assert jb.parameter_names(scene) == jb.parameter_names(scene.minimal)
    assert jtu.tree_structure(changed) == jtu.tree_structure(scene)


def test_what_is_no_scene_is_of_no_kind():
    assert not is_compliant(3.0)
    assert not is_rigid(None)
    with pytest.raises(jb.ArgumentError, match="scene is a float"):
        system_of(3.0)


class Wheel(AbstractScene):
    """A kind of scene of one's own, without a walker: a rimless wheel on its slope."""

    compliant: ClassVar[bool] = False
    redundant: ClassVar[bool] = False
    state_type: ClassVar[type[tuple]] = tuple
    spokes: float = jb.laws.parameter("spokes", "$n$", positive=True)

    @property
    def minimal(self):
        return self

    def with_minimal(self, minimal):
        return minimal


def test_a_kind_of_ones_own_needs_no_walker():
    wheel = Wheel(8.0)
    assert not is_rigid(wheel)
    assert jb.parameter_names(wheel) == ("spokes",)
    assert jb.parameter_quantities(wheel)["spokes"].words == "spokes"
    assert float(jb.with_parameters(wheel, {"spokes": 9.0}).spokes) == 9.0


def test_a_scene_takes_any_mechanism_and_knows_its_rules():
    """By the clearance rule of the walker's own; a stop without law and an unknown leg refused."""
    seed = jb.seed_scene()
    assert isinstance(seed.clearance, jb.laws.StanceRotation)
    assert scene_of("torso").mechanism is WALKERS["torso"]
    assert isinstance(scene_of("torso").clearance, jb.laws.AlwaysTouching)
    assert dataclasses.replace(seed, clearance=jb.laws.OneFoot(2)).clearance.leg == "2"
    with pytest.raises(jb.ArgumentError, match="leg"):
        scene_of("kneed", clearance=jb.laws.OneFoot("thigh_1"))
    bare = Mechanism(bodies=LEGS, feet=FEET, joints=(Stop("leg_1", upper=1.0),))
    with pytest.raises(jb.ArgumentError, match="no law"):
        scene_of("torso", walker=bare)
    with pytest.raises(jb.ArgumentError, match="without a mirror"):
        scene_of("unequal", actuation=jb.actuation.HipSpring(k=1.0))
    with pytest.raises(jb.ArgumentError, match="without a mirror"):
        jb.RigidScene(WALKERS["unequal"], seed.ground, jb.actuation.HipTorque(torque=0.1))
    with pytest.raises(jb.ArgumentError, match="walker"):
        scene_of("torso", walker=3.0)


def test_a_slope_that_no_friction_holds_is_asked_about_at_the_callers_line():
    asked = r"slope = 1\.15 rad .* at most 0\.5 .* in degrees\?"
    with pytest.warns(RuntimeWarning, match=asked) as told:
        scene = jb.seed_scene(slope=1.15)
    with pytest.warns(RuntimeWarning, match=asked) as told_again:
        dataclasses.replace(scene, normal=scene.normal)
    assert [each.filename for each in (*told, *told_again)] == [__file__, __file__]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        jb.seed_scene(slope=0.46)
        dataclasses.replace(scene, friction=jb.laws.Frictionless())


def test_a_known_scene_is_checked_where_its_first_use_is_within_a_trace():
    """The height of its feet is known there, too, though JAX traces all that it computes."""
    legs = tuple(jb.Body(f"leg_{i}", mass=1.0, inertia=0.01, centre=0.1) for i in (1, 2))
    feet = tuple(jb.Foot(f"leg_{i}", centre=0.3) for i in (1, 2))
    scene = jb.RigidScene(jb.Mechanism(bodies=legs, feet=feet), jb.Ground(slope=0.03))
    start = scene.state(theta_leg_1=-0.2, theta_leg_2=0.2)

    def lasts(rate):
        return jb.simulate(scene, start._replace(omega_leg_2=rate), footsteps=1).t[-1]

    assert jax.eval_shape(lasts, -1.1).shape == ()
