"""Mechanisms as data against the rules of their interface: names, mirror images, refusals."""

import pickle

import jax
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.scene._bodies import Body, Foot
from jaxbiped.scene._joint_parts import Coupling, Latch, Spring, Stop
from jaxbiped.scene._mechanism import Mechanism
from jaxbiped.scene._structure import pair_name

LEGS = tuple(Body(f"leg_{i}", mass=1.0, inertia=0.0096, centre=0.10) for i in (1, 2))
FEET = tuple(Foot(f"leg_{i}", centre=0.32, radius=0.08) for i in (1, 2))
PAIR = (("leg_1", "leg_2"),)
TORSO = Body("torso", mass=0.3, inertia=0.0015, centre=-0.10)
BISECTING = {"torso": 1, "leg_1": -0.5, "leg_2": -0.5}
LAW = jb.laws.RistowSchafer(K=300.0, c=3000.0, n=1.0)


def leg(i):
    return (
        Body(f"thigh_{i}", mass=0.2, inertia=5.8e-4, centre=0.080),
        Body(
            f"shank_{i}",
            mass=0.124,
            inertia=6.9e-4,
            centre=(0.096, -0.004),
            parent=f"thigh_{i}",
            at=0.184,
        ),
    )


def kneed(**changes):
    given = dict(
        root_mass=1.352,
        bodies=(*leg(1), *leg(2)),
        feet=tuple(Foot(f"shank_{i}", centre=0.136, radius=0.08) for i in (1, 2)),
        joints=tuple(Stop(f"shank_{i}", upper=0.2, law=LAW) for i in (1, 2)),
        mirror=(("thigh_1", "thigh_2"), ("shank_1", "shank_2")),
    )
    return Mechanism(**(given | changes))


def two_legs(*joints, bodies=LEGS, feet=FEET, mirror=PAIR):
    return Mechanism(bodies=bodies, feet=feet, joints=joints, mirror=mirror)


def test_mirror_images_share_their_parameters():
    walker = kneed()
    assert walker.parameter_names() == (
        "hip.mass",
        "thigh.mass",
        "thigh.inertia",
        "thigh.centre",
        "shank.mass",
        "shank.inertia",
        "shank.centre",
        "shank.centre_ahead",
        "shank.at",
        "shank.foot.centre",
        "shank.foot.radius",
        "shank.stop.upper",
        "shank.stop.K",
        "shank.stop.c",
        "shank.stop.n",
    )
    assert len(jax.tree.leaves(walker)) == len(walker.parameter_names())
    slopes = jax.grad(lambda walker: walker.total_mass)(walker)
    by_name = dict(zip(walker.parameter_names(), jax.tree.leaves(slopes), strict=True))
    assert float(by_name["thigh.mass"]) == 2.0
    assert float(by_name["hip.mass"]) == 1.0


def test_a_number_left_out_is_no_parameter():
    assert "leg.foot.radius" in two_legs().parameter_names()
    bare = two_legs(feet=tuple(Foot(f"leg_{i}", centre=0.4) for i in (1, 2)))
    assert "leg.foot.radius" not in bare.parameter_names()
    written = two_legs(feet=tuple(Foot(f"leg_{i}", centre=0.4, radius=0.0) for i in (1, 2)))
    assert "leg.foot.radius" in written.parameter_names()


def test_states_have_the_names_of_free_bodies():
    walker = two_legs(Coupling(BISECTING), bodies=(*LEGS, TORSO))
    assert walker.structure.coordinates == ("hip_x", "hip_z", "theta_leg_1", "theta_leg_2")
    assert walker.structure.rates == ("hip_vx", "hip_vz", "omega_leg_1", "omega_leg_2")


def test_height_is_that_of_the_lowest_foot():
    assert np.isclose(kneed().height, 0.184 + 0.136 + 0.08)
    uneven = two_legs(feet=(FEET[0], Foot("leg_2", centre=0.5)), mirror=())
    assert float(uneven.height) == 0.5


def test_structures_pickle_and_are_their_own_identity():
    walker = kneed()
    again = pickle.loads(pickle.dumps(walker))
    assert again.structure == walker.structure
    assert hash(again.structure) == hash(walker.structure)
    assert again.structure == kneed(root_mass=2.0).structure
    assert again.structure != kneed(mirror=()).structure


@pytest.mark.parametrize(
    ("first", "second", "expected"),
    [
        ("thigh_1", "thigh_2", "thigh"),
        ("thigh1", "thigh2", "thigh"),
        ("left_thigh", "right_thigh", "thigh"),
        ("1", "2", "1+2"),
    ],
)
def test_pairs_are_called_by_what_they_share(first, second, expected):
    assert pair_name(first, second) == expected


REFUSED = {
    "weights sum to 0.5": lambda: Spring({"leg_1": 1, "leg_2": -0.5}, stiffness=1.0),
    "weight 0": lambda: Spring({"leg_1": 1, "leg_2": 0, "normal": -1}, stiffness=1.0),
    "neither stiffness nor damping": lambda: Spring("leg_1"),
    "it would have no effect": lambda: Spring("leg_1", damping=1.0, rest=0.0),
    "no limit": lambda: Stop("leg_1", law=None),
    "it must be below": lambda: Stop("leg_1", upper=0.0, lower=0.1),
    "holds = 'always' is not known": lambda: Stop("leg_1", upper=0.0, holds="always"),
    "width = 0": lambda: Latch("leg_1", at=0.0, width=0.0, torque=1.0),
    "has no parent": lambda: Body("a", mass=1, inertia=1, centre=0, at=0.1),
    "letters, digits and underscores": lambda: Body("a b", mass=1, inertia=1, centre=0),
    "takes a reaction": lambda: Body("vertical", mass=1, inertia=1, centre=0),
    "mass = -1": lambda: Body("a", mass=-1, inertia=1, centre=0),
    "(along, ahead)": lambda: Foot("a", centre=(1, 2, 3)),
    "whose mass differ": lambda: two_legs(
        bodies=(LEGS[0], Body("leg_2", mass=2, inertia=0.0096, centre=0.1))
    ),
    "it must be 0": lambda: two_legs(Spring({"leg_1": 1, "leg_2": -1}, stiffness=1.0, rest=0.1)),
    "minus upper": lambda: two_legs(Stop({"leg_1": 1, "leg_2": -1}, upper=0.3, lower=-0.2)),
    "no equal on the other side": lambda: two_legs(Spring("leg_1", stiffness=1.0)),
    "which is no body": lambda: two_legs(Spring("knee", stiffness=1.0)),
    "mirror names 'leg_3'": lambda: two_legs(mirror=(("leg_1", "leg_3"),)),
    "mirror leaves out 'shank_1'": lambda: kneed(mirror=(("thigh_1", "thigh_2"),)),
    "do not hang on each other's images": lambda: kneed(
        mirror=(("thigh_1", "shank_2"), ("shank_1", "thigh_2"))
    ),
    "1 and 0 feet": lambda: two_legs(feet=FEET[:1]),
    "both sides of the mirror": lambda: two_legs(
        feet=tuple(Foot(f"leg_{i}", centre=0.3, leg="both") for i in (1, 2))
    ),
    "needs one foot": lambda: two_legs(feet=()),
    "names are unique": lambda: two_legs(bodies=(LEGS[0], LEGS[0])),
    "parents come first": lambda: kneed(bodies=(*leg(1)[::-1], *leg(2))),
    "called 'heel'": lambda: two_legs(
        feet=tuple(Foot(f"leg_{i}", centre=0.3, name="heel") for i in (1, 1, 2, 2))
    ),
    "another body first": lambda: two_legs(
        Coupling(BISECTING), Coupling(BISECTING), bodies=(*LEGS, TORSO)
    ),
    "repeat or contradict": lambda: two_legs(
        Coupling(BISECTING),
        Coupling({"leg_1": -1, "leg_2": -1, "torso": 2}),
        bodies=(*LEGS, TORSO),
        mirror=(),
    ),
    "two springs": lambda: two_legs(
        Spring("torso", stiffness=1.0), Spring("torso", damping=1.0), bodies=(*LEGS, TORSO)
    ),
    "'leg' stands for the pair": lambda: two_legs(
        bodies=(*LEGS, Body("leg", mass=1, inertia=1, centre=0))
    ),
    "Body('point') can turn without any inertia": lambda: two_legs(
        bodies=(*LEGS, Body("point", mass=1, inertia=0, centre=0.0))
    ),
    "Body('thigh') can turn without any inertia": lambda: Mechanism(
        root_mass=1.0,
        bodies=(
            Body("thigh", mass=0, inertia=0, centre=0.1),
            Body("shank", mass=1, inertia=0, centre=0.1, parent="thigh", at=0.2),
        ),
        feet=(Foot("shank", centre=0.1),),
    ),
    "can turn without any inertia where all angles": lambda: two_legs(
        bodies=tuple(Body(f"leg_{i}", mass=1, inertia=0, centre=0.1) for i in (1, 2))
    ),
    "1e-4 kg m^2": lambda: Mechanism(
        bodies=(LEGS[0], Body("sole", mass=0, inertia=0, centre=0, parent="leg_1", at=0.2)),
        feet=(Foot("sole", centre=0.1),),
    ),
    "at least 3": lambda: Mechanism(bodies=(LEGS[0],), feet=(FEET[0],), turn={"leg_1": 2}),
}


@pytest.mark.parametrize("words", REFUSED)
def test_what_is_no_mechanism_is_refused_in_one_sentence(words):
    with pytest.raises(jb.ArgumentError) as told:
        REFUSED[words]()
    assert words in str(told.value)


def test_under_tracing_a_mechanism_is_made_without_looking_at_numbers():
    def mass(m):
        legs = tuple(Body(f"leg_{i}", mass=m, inertia=0.0096, centre=0.10) for i in (1, 2))
        return two_legs(bodies=legs).total_mass

    assert float(jax.jit(jax.grad(mass))(1.0)) == 2.0
