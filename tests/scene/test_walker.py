"""The walker's own numbers and parameters by name, against numbers written down."""

import itertools

import jax
import pytest

import jaxbiped as jb
from jaxbiped.scene._parameter_access import select_parameters

WALKER = dict(m=1.5, J=0.01, l=0.4, d=0.1, r=0.08, hip_mass=0.7)


def test_masses_and_lengths_are_sums_of_its_own():
    walker = jb.Walker(**WALKER)
    assert float(walker.total_mass) == pytest.approx(2 * 1.5 + 0.7)
    assert float(walker.hip_to_foot) == pytest.approx(0.4 - 0.08)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (dict(l=0.07), "l = 0.07 and r = 0.08 are not allowed together"),
        (dict(m=0.0), "m = 0 is not allowed"),
        (dict(l=0.0), "l = 0 is not allowed"),
        (dict(r=-0.01), "r = -0.01 is not allowed"),
        (dict(d=-0.01), "d = -0.01 is not allowed"),
        (dict(J=-1e-9), "J = -1e-09 is not allowed"),
        (dict(hip_mass=-0.1), "hip_mass = -0.1 is not allowed"),
        (dict(J=0.0, hip_mass=0.0), "J = 0 is not allowed where hip_mass = 0"),
        (dict(J=0.0, d=0.0), "J = 0 is not allowed where d = 0"),
    ],
)
def test_what_is_no_walker_is_refused(change, said):
    with pytest.raises(jb.ArgumentError) as refused:
        jb.Walker(**WALKER | change)
    assert said in str(refused.value)
    jb.Walker(**WALKER | {"l": 0.08, "d": 0.0})


@pytest.mark.parametrize("scene", [jb.seed_scene(hip_mass=0.5), jb.ladder()["bristles"]])
def test_selected_leaves_are_those_of_the_names_in_their_order(scene):
    values, leaves = jb.parameter_values(scene), jax.tree.leaves(scene)
    for names in itertools.permutations(("slope", "K", "mu_static", "d"), 3):
        told, active = select_parameters(scene, names)
        assert told == names
        assert [float(leaves[i]) for i in active] == [float(values[name]) for name in names]
    every, active = select_parameters(scene, None)
    assert every == jb.parameter_names(scene)
    assert sorted(active) == list(range(len(leaves)))
