"""Equations of motion of a tree against maximal coordinates, and each parameter's effect."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import jaxbiped as jb
from jaxbiped import Body, Coupling, Foot, Latch, Mechanism, Spring, Stop
from jaxbiped.compiler import host_jit
from jaxbiped.dynamics._force_balance import force_balance, free_mass_entries
from jaxbiped.dynamics._joint_loads import motion_of, with_constraint_torques, with_joint_loads
from jaxbiped.dynamics._tree import Loads, point_motion, pose_of
from jaxbiped.dynamics._tree_inertia import composites, eliminate, inertial_loads
from jaxbiped.scene._bodies import Point
from tests.random_mechanisms import maximal_accelerations, mechanisms, motions

SLOPE, GRAVITY = 0.1, 9.8
PLACE = Point(0.3, -0.1)
GROUND = jb.Ground(slope=SLOPE, g=GRAVITY)


@host_jit(within=True)
def moved(mechanism, places, rates, force):
    motion = motion_of(mechanism, GROUND, places, rates)
    return motion, tree_accelerations(mechanism, motion, SLOPE, GRAVITY, force)


def tree_accelerations(mechanism, motion, slope, g, force):
    """Those of the root point and all angles, with a force on a point of the last body."""
    structure = mechanism.structure
    pose, known = pose_of(mechanism, motion), composites(mechanism)
    loads = with_joint_loads(
        inertial_loads(structure, known, pose), mechanism, motion, slope, stops=True
    )
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
    motion, found = moved(mechanism, *(list(map(np.float64, x)) for x in (places, rates, force)))
    forces = [(len(mechanism.structure.bodies) - 1, PLACE, *force)]
    expected = maximal_accelerations(mechanism, motion, SLOPE, GRAVITY, forces)
    size = max(1.0, np.abs(expected).max())
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-12 * size)


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


def _balance(mechanism, places, rates, accelerations):
    """F − M a of the free coordinates, and its mass matrix."""
    motion = motion_of(mechanism, GROUND, list(places), list(rates))
    structure = mechanism.structure
    pose, known = pose_of(mechanism, motion), composites(mechanism)
    loads = with_joint_loads(Loads.none(structure), mechanism, motion, SLOPE, stops=True)
    found = force_balance(structure, known, pose, loads, list(accelerations))
    n = 2 + len(structure.free)
    entries = free_mass_entries(structure, known, pose)
    mass = [[entries.get((i, j), 0.0) for j in range(n)] for i in range(n)]
    return jnp.stack(found), jnp.array(mass)


@host_jit(within=True)
def _balanced(mechanism, places, rates, accelerations):
    """The same, and how it changes with the accelerations."""
    balance = functools.partial(_balance, mechanism, places, rates)
    return *balance(accelerations), jax.jacfwd(lambda a: balance(a)[0])(accelerations)


@settings(deadline=None, max_examples=25)
@given(st.data())
def test_forces_balance_at_the_accelerations_of_maximal_coordinates(data):
    mechanism = data.draw(mechanisms(most_bodies=6))
    places, rates = map(np.array, data.draw(motions(mechanism)))
    motion, _ = moved(mechanism, list(places), list(rates), [np.float64(0.0)] * 2)
    expected = maximal_accelerations(mechanism, motion, SLOPE, 0.0)
    free = np.array([*expected[:2], *(expected[2 + j] for j in mechanism.structure.free)])
    missing, mass, by_rates = _balanced(mechanism, places, rates, free)
    assert np.abs(missing).max() < 1e-9 * max(1.0, np.abs(mass).max() * np.abs(free).max())
    # It is linear in the accelerations, by minus the mass matrix.
    np.testing.assert_allclose(mass, -by_rates, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(mass, mass.T)
    assert np.linalg.eigvalsh(mass).min() > 0.0
