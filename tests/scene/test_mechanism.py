"""Mechanisms as data against the rules of their interface: names, mirror images, refusals."""

import functools
import gc
import math
import pickle
import weakref

import jax
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped import Body, Coupling, Foot, Latch, Mechanism, Motor, Spring, Stop
from tests.mechanisms import BISECTING, FEET, LEGS, PAIR, TORSO, leg

LAW = jb.laws.RistowSchafer(K=300.0, c=3000.0, n=1.0)


def kneed(**changes):
    given = dict(
        root_mass=1.352,
        bodies=(*leg(1), *leg(2)),
        feet=tuple(Foot(f"shank_{i}", centre=0.136, radius=0.08) for i in (1, 2)),
        joints=tuple(Stop(f"shank_{i}", upper=0.2, law=LAW) for i in (1, 2)),
        mirror=(("thigh_1", "thigh_2"), ("shank_1", "shank_2")),
    )
    return Mechanism(**(given | changes))


def two_legs(*joints, bodies=LEGS, feet=FEET, mirror=PAIR, root_mass=None):
    return Mechanism(root_mass=root_mass, bodies=bodies, feet=feet, joints=joints, mirror=mirror)


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


def test_height_is_that_of_the_lowest_foot():
    assert np.isclose(kneed().height, 0.184 + 0.136 + 0.08)
    uneven = two_legs(feet=(FEET[0], Foot("leg_2", centre=0.5)), mirror=())
    assert float(uneven.height) == 0.5


def test_the_normal_is_an_angles_other_side_only_where_its_weights_need_one():
    """A knee's angle is the difference of two bodies', a leg's is one from the slope's normal."""
    walker = two_legs(
        Spring({"leg_1": 1, "leg_2": -1}, stiffness=1.0, name="a"),
        Spring("leg_1", stiffness=2.0, rest=0.1, name="b"),
        Spring({"leg_1": 1, "vertical": -1}, stiffness=3.0, rest=0.2, name="c"),
        mirror=(),
    )
    angles = [dict(joint.angle) for joint in walker.arguments()["joints"]]
    assert angles[0] == {"leg_1": 1.0, "leg_2": -1.0}
    assert angles[1] == {"leg_1": 1.0, "normal": -1.0}
    assert angles[2] == {"leg_1": 1.0, "vertical": -1.0}


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
    bodies = tuple(jb.Body(name, mass=1.0, inertia=0.01, centre=0.1) for name in (first, second))
    feet = tuple(jb.Foot(name, centre=0.3) for name in (first, second))
    walker = jb.Mechanism(bodies=bodies, feet=feet, mirror=((first, second),))
    assert f"{expected}.mass" in jb.parameter_names(walker)


ONE_FOOT = Foot("x", centre=0.3)


def spokes(bodies=(), joints=()):
    """A rimless wheel of four spokes."""
    ends = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)]
    return Mechanism(
        bodies=(Body("wheel", mass=1.0, inertia=0.5, centre=0.0), *bodies),
        feet=[Foot("wheel", centre=end, leg=f"spoke_{k}") for k, end in enumerate(ends)],
        joints=joints,
        turn={"wheel": 4},
    )


REFUSED = {
    "weights sum to 0.5": lambda: Spring({"leg_1": 1, "leg_2": -0.5}, stiffness=1.0),
    "weight 0": lambda: Spring({"leg_1": 1, "leg_2": 0, "normal": -1}, stiffness=1.0),
    "neither stiffness nor damping": lambda: Spring("leg_1"),
    "it would have no effect": lambda: Spring("leg_1", damping=1.0, rest=0.0),
    "no limit": lambda: Stop("leg_1", law=None),
    "it must be below": lambda: Stop("leg_1", upper=0.0, lower=0.1),
    "holds = 'always' is not known": lambda: Stop("leg_1", upper=0.0, holds="always"),
    "has no parent": lambda: Body("a", mass=1, inertia=1, centre=0, at=0.1),
    "letters, digits and underscores": lambda: Body("a b", mass=1, inertia=1, centre=0),
    "takes a reaction": lambda: Body("vertical", mass=1, inertia=1, centre=0),
    "(along, ahead)": lambda: Foot("a", centre=(1, 2, 3)),
    "whose mass differ": lambda: two_legs(
        bodies=(LEGS[0], Body("leg_2", mass=2, inertia=0.0096, centre=0.1))
    ),
    "it must be 0": lambda: two_legs(Spring({"leg_1": 1, "leg_2": -1}, stiffness=1.0, rest=0.1)),
    "minus upper": lambda: two_legs(Stop({"leg_1": 1, "leg_2": -1}, upper=0.3, lower=-0.2)),
    "no counterpart on the other side": lambda: two_legs(Spring("leg_1", stiffness=1.0)),
    "which is not a body": lambda: two_legs(Spring("knee", stiffness=1.0)),
    "mirror names 'leg_3'": lambda: two_legs(mirror=(("leg_1", "leg_3"),)),
    "mirror leaves out 'shank_1'": lambda: kneed(mirror=(("thigh_1", "thigh_2"),)),
    "do not hang on each other's images": lambda: kneed(
        mirror=(("thigh_1", "shank_2"), ("shank_1", "thigh_2"))
    ),
    "1 and 0 feet": lambda: two_legs(feet=FEET[:1]),
    "both sides of the mirror": lambda: two_legs(
        feet=tuple(Foot(f"leg_{i}", centre=0.3, leg="both") for i in (1, 2))
    ),
    "needs at least one foot": lambda: two_legs(feet=()),
    "needs at least one body": lambda: two_legs(bodies=(), mirror=()),
    "have the shapes (2,) and (3,)": lambda: two_legs(
        bodies=[
            Body(f"leg_{i}", mass=np.ones(2), inertia=np.full(3, 0.01), centre=0.1) for i in (1, 2)
        ]
    ),
    "it must be an AbstractJointPart": lambda: two_legs("spring"),
    "held = 'leg_1' is not allowed: the walker has no stops": lambda: jb.RigidScene(
        two_legs(), jb.Ground(slope=0.03)
    ).state(held="leg_1"),
    "names are unique": lambda: two_legs(bodies=(LEGS[0], LEGS[0])),
    "stands before its parent 'torso'": lambda: two_legs(
        bodies=(*LEGS, Body("torso", mass=1, inertia=1, centre=0, parent="torso"))
    ),
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
    "Body('leg_1') can turn without any inertia where all angles": lambda: two_legs(
        bodies=tuple(
            Body(f"leg_{i}", mass=1, inertia=np.array([1e-3, 0.0]), centre=0.1) for i in (1, 2)
        )
    ),
    "1e-4 kg m^2": lambda: Mechanism(
        bodies=(LEGS[0], Body("sole", mass=0, inertia=0, centre=0, parent="leg_1", at=0.2)),
        feet=(Foot("sole", centre=0.1),),
    ),
    "the body's feet are not where they were": lambda: Mechanism(
        bodies=(LEGS[0],), feet=(FEET[0],), turn={"leg_1": 5}
    ),
    "a body on 'wheel' would not be where it was": lambda: spokes(
        bodies=(Body("arm", mass=1, inertia=1, centre=0.1, parent="wheel"),)
    ),
    "a Spring on 'wheel' would not act as before": lambda: spokes(
        joints=(Spring("wheel", stiffness=1.0),)
    ),
    "not above the ground": lambda: Mechanism(
        bodies=(LEGS[0],), feet=(Foot("leg_1", centre=-0.3),)
    ),
    "centre = None": lambda: Foot("leg_1", centre=None),
    "centre = None is not allowed for Body": lambda: Body("a", mass=1, inertia=1, centre=None),
    "begin with a letter": lambda: Mechanism(root="1st", bodies=(LEGS[0],), feet=(FEET[0],)),
    "would be called 'theta_x'": lambda: Mechanism(
        root="theta", bodies=(Body("x", mass=1, inertia=1, centre=0.1),), feet=(ONE_FOOT,)
    ),
    "not a finite number": lambda: Spring({"leg_1": np.nan, "leg_2": 1}, stiffness=1.0),
    "give a body's name, or weights": lambda: Spring(("leg_1", "leg_2"), stiffness=1.0),
    "at least 3": lambda: Mechanism(bodies=(LEGS[0],), feet=(FEET[0],), turn={"leg_1": 2}),
    "list them in this order": lambda: wheel((0, 2, 1)),
    "a leg of their own": lambda: wheel(leg="all"),
    "whose mass centre lies off its hinge": lambda: wheel(centre=0.1),
    "whose centre differ: leave the mirror out": lambda: two_legs(
        feet=(FEET[0], Foot("leg_2", centre=0.5))
    ),
    "mirror = 5": lambda: two_legs(mirror=5),
    "mirror = 'leg_1'": lambda: two_legs(mirror="leg_1"),
    "in angle = 1j": lambda: Spring({"leg_1": 1j, "leg_2": -1}, stiffness=1.0),
}


def wheel(order=range(3), *, leg=None, length=1.0, **body):
    """Three spokes; `leg` of all of them, or each is its own."""
    places = {f"leg_{k}": 2.0 * math.pi * k / 3.0 for k in order}
    tips = {k: (length * math.cos(a), length * math.sin(a)) for k, a in places.items()}
    return Mechanism(
        bodies=(Body("wheel", **(dict(mass=1.0, inertia=0.5, centre=0.0) | body)),),
        feet=tuple(Foot("wheel", centre=tip, leg=leg or k) for k, tip in tips.items()),
        turn={"wheel": 3},
    )


def test_feet_that_a_turn_takes_to_each_other_share_their_parameters():
    names = ("wheel.mass", "wheel.inertia", "wheel.foot.centre", "wheel.foot.centre_ahead")
    assert jb.parameter_names(wheel()) == names
    longer = jb.with_parameters(wheel(), {"wheel.foot.centre": 2.0})
    for foot, expected in zip(longer.feet, wheel(length=2.0).feet, strict=True):
        assert float(foot.centre.along) == pytest.approx(float(expected.centre.along), abs=1e-15)
        assert float(foot.centre.ahead) == pytest.approx(float(expected.centre.ahead), abs=1e-15)
    again = Mechanism(**longer.arguments())
    assert jb.parameter_names(again) == names
    assert again.structure == longer.structure


@pytest.mark.parametrize("words", REFUSED)
def test_what_is_no_mechanism_is_refused_in_one_sentence(words):
    with pytest.raises(jb.ArgumentError) as told:
        REFUSED[words]()
    assert words in str(told.value)


NUMBERS = [
    (Body, ("a",), dict(mass=1.0, inertia=1.0, centre=0.1)),
    (Foot, ("a",), dict(centre=0.1, radius=0.1)),
    (Spring, ("a",), dict(stiffness=1.0, damping=1.0, rest=0.1)),
    (functools.partial(Stop, law=LAW), ("a",), dict(upper=0.1)),
    (functools.partial(Stop, law=LAW), ("a",), dict(lower=0.1)),
    (Latch, ("a",), dict(width=0.1, torque=1.0, at=0.1, damping=1.0)),
    (Coupling, ("a",), dict(rest=0.1)),
    (Motor, ("a", jb.actuation.Constant(1.0)), dict(share=1.0)),
    (jb.actuation.Constant, (), dict(torque=1.0)),
    (jb.actuation.PD, (), dict(kp=1.0, kd=1.0, target=0.1)),
    (jb.actuation.Pulse, (), dict(torque=1.0, at=0.1, width=0.1)),
    (functools.partial(jb.actuation.Spline, torque=(1.0, 2.0)), (), dict(first=0.0, last=1.0)),
    (two_legs, (), dict(root_mass=1.0)),
]
"""What makes each piece, and its numbers."""
NOT_NEGATIVE = ("mass", "inertia", "radius", "stiffness", "damping", "width", "share", "root_mass")
EACH = [(*piece, name) for piece in NUMBERS for name in piece[-1]]


@pytest.mark.parametrize(("made", "words", "numbers", "name"), EACH)
def test_numbers_of_pieces_are_finite_and_in_their_range(made, words, numbers, name):
    """Each in one sentence that begins with the number's name, or with its place in a point."""
    wrong = [np.nan, np.inf, -np.inf, "x", True, 1j]
    # The torque of a latch holds; that of a motor's law has a sign.
    wrong += [-1.0] if name in NOT_NEGATIVE or (made, name) == (Latch, "torque") else []
    wrong += [0.0] if name == "width" else []
    for value in wrong:
        with pytest.raises(jb.ArgumentError) as told:
            made(*words, **numbers | {name: value})
        said = str(told.value)
        assert said.startswith(("along" if name == "centre" else name) + " = ")
        assert ". " not in said


def test_pairs_that_share_their_tokens_are_told_apart():
    legs = tuple(Body(f"leg_{i}", mass=1.0, inertia=0.01, centre=0.1) for i in (1, 2, 3, 4))
    feet = tuple(Foot(each.name, centre=0.3) for each in legs)
    walker = Mechanism(bodies=legs, feet=feet, mirror=(("leg_1", "leg_2"), ("leg_3", "leg_4")))
    names = walker.parameter_names()
    assert len(set(names)) == len(names) == len(jax.tree.leaves(walker))
    assert {"leg_1+leg_2.mass", "leg_3+leg_4.foot.centre"} <= set(names)


def test_the_limits_of_a_stop_that_the_mirror_ties_stay_apart():
    walker = two_legs(Stop({"leg_1": 1, "leg_2": -1}, upper=0.5, lower=-0.5, law=LAW))
    with pytest.raises(jb.ArgumentError, match="must be below"):
        jb.with_parameters(walker, {"leg.stop.upper": -0.1})


def test_parts_on_one_angle_are_no_mirror_images_where_they_have_other_parameters():
    parts = (
        Spring({"leg_1": 1, "leg_2": -1}, stiffness=1.0),
        Spring({"leg_2": 1, "leg_1": -1}, damping=0.1, name="damper"),
    )
    assert {"leg.spring.stiffness", "leg.damper.damping"} <= set(two_legs(*parts).parameter_names())


def test_what_a_mechanism_is_asked_for_is_not_kept():
    walker = kneed()
    told = [weakref.ref(each) for each in (*walker.bodies, *walker.feet, walker.untied())]
    gc.collect()
    assert [each() for each in told] == [None] * len(told)
