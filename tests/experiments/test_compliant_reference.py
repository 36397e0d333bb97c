"""The compliant reference's equations against the tests', and its laws against the package's."""

import dataclasses

import numpy as np
import pytest
from extreme_cases.case import check_numbers
from reference.compliant import (
    FRICTION,
    NORMAL,
    SIZE,
    derivative,
    friction_share,
    jacobian,
    normal_force,
)
from reference.scipy_solves import checked

import jaxbiped as jb
from tests.reference import SEED, START, reference_states
from tests.reference import derivative as reference_derivative

SCENE = jb.seed_scene()


def test_the_field_is_that_of_the_tests_reference():
    p = check_numbers(SCENE)
    assert p.shape == (SIZE,)
    for y in (START, START + 1e-3, np.array([0.1, 0.39, 0.2, -0.3, 0.5, -0.2, -1.5, -1.7])):
        assert derivative(0.0, y, p) == pytest.approx(reference_derivative(0.0, y, SEED), rel=1e-9)


def test_the_seeds_walk_is_that_of_the_tests_reference():
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
    for depth in (-1e-3, 3e-6, 1e-3, 0.02):
        for rate in (-0.5, -1e-3, 0.0, 0.2):
            ours = float(law.force(np.asarray(depth), np.asarray(rate)))
            assert normal_force(depth, rate, p[9:15]) == pytest.approx(ours, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("name", FRICTION)
def test_a_friction_law_is_the_packages(name):
    law = jb.laws.friction_law_like(name, mu_static=0.5, mu_kinetic=0.4, v0=1e-3, xi=100.0)
    p = check_numbers(dataclasses.replace(SCENE, friction=law))
    for slip in (-0.3, -1.5e-3, -2e-4, 0.0, 7e-4, 2e-2):
        given = (np.asarray(30.0), np.asarray(slip))
        bent = (np.asarray(0.2),) if name in ("dahl", "lugre") else ()
        share, _ = friction_share(30.0, slip, 0.2, p[15:24])
        assert -30.0 * share == pytest.approx(float(law.force(*given, *bent)), rel=1e-9, abs=1e-12)


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
