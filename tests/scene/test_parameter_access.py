"""Names of parameters against the rules of mechanisms, and values set by name against leaves."""

import itertools
import warnings

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from tests.mechanisms import leg
from tests.scene.test_mechanism import BISECTING, LAW, LEGS, TORSO, kneed, two_legs
from tests.sweep.walkers import gaitless

SEED = jb.seed_scene()


class OwnKneed(eqx.Module):
    """McGeer's knees, as a user would write them: by numbers of his own."""

    m_thigh: float = jb.laws.parameter("thigh mass", "$m_t$", "kg", positive=True)
    g: float = jb.laws.parameter("a length that a ground's name has", "$g$", "m")
    epsilon: float = jb.laws.parameter("knee angle at the stop", "", "rad")
    stop: jb.laws.AbstractNormalLaw

    def mechanism(self):
        return kneed(
            bodies=(*leg(1, self.m_thigh), *leg(2, self.m_thigh)),
            feet=tuple(jb.Foot(f"shank_{i}", centre=self.g, radius=0.08) for i in (1, 2)),
            joints=tuple(jb.Stop(f"shank_{i}", upper=self.epsilon, law=self.stop) for i in (1, 2)),
        )


OWN = OwnKneed(0.2, 0.136, 0.2, LAW)


def scene_of(walker):
    return jb.Scene(walker, SEED.ground, SEED.normal, SEED.friction)


@pytest.mark.parametrize("walker", [OWN, kneed()])
def test_a_walkers_names_lengthen_none_of_the_scenes(walker):
    scene = scene_of(walker)
    names = jb.parameter_names(scene)
    assert names[:3] == ("K", "c", "xi")
    assert {"slope", "g", "n", "v0"} <= set(names)
    assert len(set(names)) == len(names) == len(jax.tree.leaves(scene))
    values = jb.parameter_values(scene)
    assert float(values["K"]) == 1e6
    assert float(values["g"]) == 9.8


def test_own_walkers_are_named_by_their_fields():
    values = jb.parameter_values(scene_of(OWN))
    assert {"m_thigh", "epsilon", "stop.K", "stop.c", "walker.g"} <= set(values)
    assert float(values["stop.K"]) == 300.0
    assert float(values["walker.g"]) == 0.136
    assert jb.parameter_names(OWN) == (
        "m_thigh", "g", "epsilon", "stop.K", "stop.c", "stop.n"
    )  # fmt: skip


def test_stops_have_angular_units():
    units = {name: q.unit for name, q in jb.parameter_quantities(scene_of(OWN)).items()}
    assert units["stop.K"] == "N m/rad^n"
    assert units["stop.c"] == "N m s/rad^2"
    assert units["K"] == "N/m^n"
    known = jb.parameter_quantities(scene_of(kneed()))
    assert known["shank.stop.K"].unit == "N m/rad^n"
    assert known["shank.stop.upper"].unit == "rad"
    assert known["K"].unit == "N/m^n"
    assert known["shank.centre_ahead"].unit == "m"
    words = [each.words for each in known.values()]
    assert len(set(words)) == len(words)
    assert "mass, thigh" in words


def test_values_are_set_by_name_whatever_makes_the_walker():
    walker = jb.with_parameters(kneed(), {"thigh.mass": 0.3, "shank.stop.K": 400.0})
    assert [float(body.mass) for body in walker.bodies] == [0.3, 0.124] * 2
    assert float(walker.joints[1].law.K) == 400.0
    scene = jb.with_parameters(scene_of(kneed()), {"shank.foot.radius": 0.05, "K": 2e6})
    assert float(scene.walker.feet[1].radius) == 0.05
    assert float(scene.normal.K) == 2e6
    many = jb.with_parameters(scene, {"thigh.mass": jnp.array([0.2, 0.4])})
    np.testing.assert_allclose(many.walker.total_mass, 1.352 + 2 * (0.124 + np.array([0.2, 0.4])))
    assert float(jb.with_parameters(scene_of(OWN), {"stop.K": 9.0}).walker.stop.K) == 9.0


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"thigh.mass": -1.0}, "mass = -1"),
        ({"shank.stop.K": -1.0}, "K = -1"),
        ({"thigh.weight": 1.0}, "'thigh.weight' is not known"),
        ({"hip.mass": 0.0, "thigh.mass": 0.0, "shank.mass": 0.0}, "without"),
    ],
)
def test_all_checks_on_the_way_are_run_again(values, words):
    with pytest.raises(jb.ArgumentError, match=words):
        jb.with_parameters(scene_of(kneed()), values)


def test_limits_that_are_set_together_are_checked_together():
    stop = jb.Stop("leg_1", upper=0.2, lower=0.1, law=LAW)
    walker = two_legs(stop, mirror=())
    moved = jb.with_parameters(walker, {"leg_1.stop.lower": 0.5, "leg_1.stop.upper": 0.6})
    assert float(moved.joints[0].lower) == 0.5


def test_one_side_alone_unties_the_mirror():
    scene = scene_of(kneed())
    with pytest.warns(UserWarning, match="stride"):
        uneven = jb.with_parameters(scene, {"thigh_1.mass": 0.25, "shank.mass": 0.1, "K": 2e6})
    assert [float(body.mass) for body in uneven.walker.bodies] == [0.25, 0.1, 0.2, 0.1]
    assert float(uneven.normal.K) == 2e6
    assert uneven.walker.structure.body_twins is None
    assert uneven.walker.structure.pairs == ((0, 2), (1, 3))
    assert {"thigh_1.mass", "shank_2.stop.K"} <= set(jb.parameter_names(uneven))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        again = jb.with_parameters(uneven, {"thigh_1.mass": 0.2})
    assert float(again.walker.total_mass) == pytest.approx(float(uneven.walker.total_mass) - 0.05)
    slopes = jax.grad(lambda walker: walker.total_mass)(uneven.walker)
    assert [float(body.mass) for body in slopes.bodies] == [1.0] * 4


def test_an_untied_mechanism_keeps_every_piece():
    walker = two_legs(
        jb.Stop({"leg_1": 1, "leg_2": -1}, upper=0.3, lower=-0.3, law=LAW),
        jb.Coupling(BISECTING),
        bodies=(*LEGS, TORSO),
    )
    alone = walker.untied()
    assert alone.structure.joints == walker.structure.joints
    assert alone.structure.fixed == walker.structure.fixed
    assert alone.structure.foot_names == walker.structure.foot_names
    again = jb.Mechanism(**walker.arguments())
    assert again.structure == walker.structure
    assert jax.tree.leaves(again) == jax.tree.leaves(walker)


def test_a_stop_that_is_its_own_image_has_one_limit():
    stop = jb.Stop({"leg_1": 1, "leg_2": -1}, upper=0.3, lower=-0.3, law=LAW)
    walker = two_legs(stop)
    assert "leg.stop.lower" not in walker.parameter_names()
    wider = jb.with_parameters(walker, {"leg.stop.upper": 0.4})
    assert (float(wider.joints[0].lower), float(wider.joints[0].upper)) == (-0.4, 0.4)
    assert {"leg_1.stop.lower", "leg_1.stop.upper"} <= set(walker.untied().parameter_names())
    spring = jb.Spring({"leg_1": 1, "leg_2": -1}, stiffness=1.0, rest=0.0)
    assert "leg.spring.rest" not in two_legs(spring).parameter_names()


def identity_of(walker):
    """A scene as settings of a labelling tell it: its numbers, and what it is made of."""
    scene = scene_of(walker)
    settings = gaitless(scene, scene.state()).settings()
    return settings["scene"], settings["models"]["scene"]


def test_identities_tell_mechanisms_apart():
    told = [identity_of(each) for each in (kneed(), kneed(root="pelvis"), OWN)]
    assert told[0][0]["shank.stop.K"] == 300.0
    assert "pelvis.mass" in told[1][0]
    assert told[0][1] != told[1][1]
    assert told == [identity_of(each) for each in (kneed(), kneed(root="pelvis"), OWN)]
    held = kneed(
        joints=tuple(
            jb.Stop(f"shank_{i}", upper=0.2, law=LAW, holds="until heel strike") for i in (1, 2)
        )
    )
    assert identity_of(held)[1] != told[0][1]


@pytest.mark.parametrize("scene", [jb.seed_scene(hip_mass=0.5), jb.ladder()["bristles"]])
def test_changed_leaves_are_those_of_the_names_in_their_order(scene):
    values, leaves = jb.parameter_values(scene), jax.tree.leaves(scene)
    assert len(jb.parameter_names(scene)) == len(leaves)
    for names in itertools.permutations(("slope", "K", "mu_static", "d"), 3):
        given = {name: 1.01 * float(values[name]) for name in names}
        changed = jb.with_parameters(scene, given)
        pairs = zip(jax.tree.leaves(changed), leaves, strict=True)
        assert sorted(float(a) for a, b in pairs if a != b) == sorted(given.values())
        known = jb.parameter_values(changed)
        assert {name: float(known[name]) for name in names} == given
