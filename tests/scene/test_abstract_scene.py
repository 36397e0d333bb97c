"""What any kind of scene answers, against a kind of one's own."""

from typing import ClassVar

import jax.tree_util as jtu
import pytest

import jaxbiped as jb
from jaxbiped.dynamics._state import field_of, state_type
from jaxbiped.scene._scene import AbstractScene, is_compliant, is_rigid

SEED = jb.seed_scene()
BRISTLES = jb.ladder()["bristles"]
RIGID = jb.RigidScene(SEED.walker, SEED.ground)


@pytest.mark.parametrize(
    ("scene", "compliant", "redundant", "state", "field"),
    [
        (SEED, True, False, jb.State, jb.dynamics.vector_field),
        (BRISTLES, True, False, jb.dynamics.BristleState, jb.dynamics.vector_field),
        (RIGID, False, False, jb.dynamics.RigidState, jb.dynamics.rolling_field),
        (
            jb.RedundantScene(SEED),
            True,
            True,
            jb.dynamics.RedundantState,
            jb.dynamics.redundant_field,
        ),
        (
            jb.RedundantScene(BRISTLES, "penalty", "euler"),
            True,
            True,
            jb.dynamics.EulerState,
            jb.dynamics.redundant_field,
        ),
    ],
)
def test_every_scene_says_of_what_kind_it_is(scene, compliant, redundant, state, field):
    assert (scene.compliant, scene.redundant) == (compliant, redundant)
    assert (is_compliant(scene), is_rigid(scene)) == (compliant, not compliant)
    assert (state_type(scene), field_of(scene)) == (state, field)
    assert scene.has_bristles == (state_type(scene.minimal) is jb.dynamics.BristleState)
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
    with pytest.raises(TypeError, match="float has no formulation"):
        state_type(3.0)
    with pytest.raises(TypeError, match="float has no formulation"):
        field_of(3.0)


class Wheel(AbstractScene):
    """A kind of scene of one's own: a rimless wheel's hub on its slope."""

    compliant: ClassVar[bool] = False
    redundant: ClassVar[bool] = False
    walker: jb.Walker
    ground: jb.Ground
    spokes: float = jb.laws.parameter("spokes", "$n$", positive=True)

    @property
    def minimal(self):
        return self

    def with_minimal(self, minimal):
        return minimal

    @property
    def has_bristles(self):
        return False


def test_a_kind_of_ones_own_registers_its_formulation():
    @state_type.register
    def _(scene: Wheel):
        return tuple

    wheel = Wheel(SEED.walker, SEED.ground, 8.0)
    assert state_type(wheel) is tuple
    assert is_rigid(wheel)
    assert "spokes" in jb.parameter_names(wheel)
    assert jb.parameter_quantities(wheel)["spokes"].words == "spokes"
    assert float(jb.with_parameters(wheel, {"spokes": 9.0}).spokes) == 9.0
