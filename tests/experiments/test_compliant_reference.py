"""The compliant reference, against two solvers of one motion and the package's laws."""

import dataclasses

import numpy as np
import pytest
from extreme_cases.case import check_numbers
from hypothesis import given, settings
from hypothesis import strategies as st
from reference.compliant import (
    FRICTION,
    NORMAL,
    START,
    derivative,
    friction_share,
    jacobian,
    normal_force,
    numbers,
)
from reference.scipy_solves import checked
from reference.walks import reference_states

import jaxbiped as jb

SCENE = jb.seed_scene()


def numbers_within(size):
    # XLA takes subnormal numbers for zero.
    return st.floats(-size, size, allow_subnormal=False)


def test_the_seeds_numbers_are_those_of_its_scene():
    np.testing.assert_array_equal(check_numbers(SCENE), numbers())


def test_the_seeds_walk_by_lsoda_is_that_by_radau():
    times, states = reference_states()
    found = checked(START, check_numbers(SCENE), float(times[10]))
    assert found.state == pytest.approx(states[10], abs=1e-8)
    assert found.doubt < 1e-8
    assert found.lowest > 0.3


def test_the_jacobian_is_that_of_the_field():
    p = check_numbers(jb.seed_scene(v0=1e-2, c=1e4))
    slopes = jacobian(0.0, START, p)
    for k in range(1, 8):
        step = 1e-7 * np.eye(8)[k]
        moved = derivative(0.0, START + step, p) - derivative(0.0, START - step, p)
        assert slopes[:, k] == pytest.approx(moved / 2e-7, rel=1e-4, abs=1e-3)


@pytest.mark.parametrize("name", NORMAL)
def test_a_normal_law_is_the_packages(name):
    law = jb.laws.normal_law_like(name, K=1e6, c=1e5, n=1.6, mass=2.0)
    p = check_numbers(dataclasses.replace(SCENE, normal=law))

    @settings(deadline=None, max_examples=50)
    @given(numbers_within(2e-2), numbers_within(2.0))
    def check(depth, rate):
        ours = float(law.force(np.asarray(depth), np.asarray(rate)))
        assert normal_force(depth, rate, p[9:15]) == pytest.approx(ours, rel=1e-12, abs=1e-9)

    check()


@pytest.mark.parametrize("name", FRICTION)
def test_a_friction_law_is_the_packages(name):
    law = jb.laws.friction_law_like(name, mu_static=0.5, mu_kinetic=0.4, v0=1e-3, xi=100.0)
    p = check_numbers(dataclasses.replace(SCENE, friction=law))
    bent = (np.asarray(0.2),) if name in ("dahl", "lugre") else ()

    @settings(deadline=None, max_examples=50)
    @given(numbers_within(2.0) | numbers_within(3e-3))
    def check(slip):
        share, _ = friction_share(30.0, slip, 0.2, p[15:24])
        ours = float(law.force(np.asarray(30.0), np.asarray(slip), *bent))
        assert -30.0 * share == pytest.approx(ours, rel=1e-12, abs=1e-12)

    check()


@pytest.mark.parametrize("name", ["dahl", "lugre"])
def test_bristles_move_as_the_packages(name):
    law = jb.laws.friction_law_like(name, mu_static=0.5, mu_kinetic=0.4, v0=1e-3, xi=100.0)
    scene = dataclasses.replace(SCENE, friction=law)
    y = np.concatenate([START, [0.1, -0.2]])
    fields = (*jb.State._fields, "bristle_1", "bristle_2")
    state = jb.dynamics.BristleState(**dict(zip(fields, map(np.asarray, y), strict=True)))
    ours = jb.dynamics.vector_field(0.0, state, scene)
    rates = derivative(0.0, y, check_numbers(scene))
    assert rates == pytest.approx([float(leaf) for leaf in ours], rel=1e-9)
