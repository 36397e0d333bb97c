"""Equations of motion of a tree against maximal coordinates, and each parameter's effect."""

import jax
import jax.numpy as jnp
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import jaxbiped as jb
from jaxbiped.dynamics._joint_loads import motion_of, with_constraint_torques, with_joint_loads
from jaxbiped.dynamics._tree import point_motion, pose_of
from jaxbiped.dynamics._tree_inertia import centrifugal_loads, composites, eliminate
from jaxbiped.scene._bodies import Body, Foot, Point
from jaxbiped.scene._joint_parts import Coupling, Latch, Spring, Stop
from jaxbiped.scene._mechanism import Mechanism
from tests.random_mechanisms import maximal_accelerations, mechanisms, motions

SLOPE, GRAVITY = 0.1, 9.8
PLACE = Point(0.3, -0.1)


def tree_accelerations(mechanism, motion, slope, g, force):
    """Those of the root point and all angles, with a force on a point of the last body."""
    structure = mechanism.structure
    pose, known = pose_of(mechanism, motion), composites(mechanism)
    loads = with_joint_loads(centrifugal_loads(structure, known, pose), mechanism, motion, slope)
    last = len(structure.bodies) - 1
    loads = loads.with_force(point_motion(structure, pose, last, PLACE), *force)
    factors = eliminate(structure, known, pose)
    found = with_constraint_torques(structure, mechanism.joints, factors, loads)
    found[0] = found[0] + g * jnp.sin(slope)
    found[1] = found[1] - g * jnp.cos(slope)
    return jnp.stack(found)


@settings(deadline=None, max_examples=25)
@given(st.data())
def test_accelerations_equal_those_in_maximal_coordinates(data):
    mechanism = data.draw(mechanisms())
    places, rates = data.draw(motions(mechanism))
    force = data.draw(st.tuples(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0)))
    ground = jb.Ground(slope=SLOPE, g=GRAVITY)
    motion = motion_of(mechanism, ground, *(list(map(jnp.asarray, x)) for x in (places, rates)))
    found = tree_accelerations(mechanism, motion, SLOPE, GRAVITY, force)
    forces = [(len(mechanism.structure.bodies) - 1, PLACE, *force)]
    expected = maximal_accelerations(mechanism, motion, SLOPE, GRAVITY, forces)
    size = max(1.0, np.abs(expected).max())
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-10 * size)


def test_every_parameter_moves_the_accelerations():
    law = jb.laws.HuntCrossley(K=20.0, hysteresis=0.5, n=1.5)
    mechanism = Mechanism(
        root_mass=0.5,
        bodies=[
            Body("a", mass=1.0, inertia=0.02, centre=(0.1, 0.02)),
            Body("b", mass=0.6, inertia=0.01, centre=(0.2, 0.01), parent="a", at=(0.3, 0.02)),
            Body("c", mass=0.4, inertia=0.01, centre=(-0.2, 0.03)),
            Body("d", mass=0.4, inertia=0.01, centre=(-0.2, 0.03)),
        ],
        feet=[Foot("a", centre=0.1)],
        joints=[
            Spring("b", stiffness=2.0, damping=0.1, rest=0.2),
            Latch({"c": 1, "a": -1}, at=0.1, width=0.3, torque=0.5, damping=0.2),
            Stop({"b": 1, "normal": -1}, upper=0.1, lower=-3.0, law=law, name="up"),
            Stop({"a": 1, "normal": -1}, upper=3.0, lower=0.4, law=law, name="down"),
            Coupling({"d": 1, "a": -1}, rest=0.3),
        ],
    )

    def accelerations(mechanism):
        ground = jb.Ground(slope=SLOPE)
        places = jnp.array([0.0, 0.4, 0.2, 0.5, -0.1])
        rates = jnp.array([0.3, 0.1, -1.0, 0.5, 0.5])
        motion = motion_of(mechanism, ground, list(places), list(rates))
        return tree_accelerations(mechanism, motion, SLOPE, GRAVITY, (0.0, 0.0))

    slopes = jax.jacfwd(accelerations)(mechanism)
    by_name = dict(zip(mechanism.parameter_names(), jax.tree.leaves(slopes), strict=True))
    felt = {name for name, slope in by_name.items() if np.abs(slope).max() > 1e-9}
    # A limit that is not passed and a foot in the air are felt where they touch.
    idle = {"a.foot.centre", "b.up.lower", "a.down.upper"}
    assert set(by_name) - felt == idle
