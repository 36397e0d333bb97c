"""The independent walker, against two solvers of a motion, closed forms and the package's laws."""

import dataclasses

import numpy as np
import pytest
from _scenes import seed_with
from extreme_cases.case import Case, check_numbers, check_start
from reference import scipy_solves as solves
from reference.compliant import (
    FRICTION,
    NORMAL,
    START,
    derivative,
    jacobian,
    numbers,
)
from reference.precise_solves import _context, _equations, _method, precise_motion
from reference.scipy_solves import checked, scales
from reference.walks import reference_states

import jaxbiped as jb

SCENE = jb.seed_scene()
SLIPPERY = dict(mu_static=0.5, mu_kinetic=0.4, v0=1e-3, xi=100.0)


def scene_with(name):
    """The seed's scene with a law of either kind, softer than its own."""
    kind = "normal" if name in NORMAL else "friction"
    parameters = dict(c=1e5, n=1.6) if kind == "normal" else SLIPPERY
    changed = seed_with(**{kind: name}, **parameters)
    return dataclasses.replace(SCENE, **{kind: getattr(changed, kind)})


def test_the_seeds_numbers_are_those_of_its_scene():
    np.testing.assert_array_equal(check_numbers(SCENE), numbers())


@pytest.mark.nightly
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


@pytest.mark.parametrize("name", ["dahl", "lugre"])
def test_bristles_move_as_the_packages(name):
    scene = scene_with(name)
    y = np.concatenate([START, [0.1, -0.2]])
    ours = jb.dynamics.vector_field(0.0, jb.dynamics.BristleState(*map(np.asarray, y)), scene)
    rates = derivative(0.0, y, check_numbers(scene))
    assert rates == pytest.approx([float(leaf) for leaf in ours], rel=1e-9)


def test_precise_collocation_is_of_its_order():
    nodes, matrix, before, _ = _method()
    stages = len(nodes)
    for power in range(2 * stages - 1):
        assert abs(matrix[-1] @ nodes**power - 1 / _context().mpf(power + 1)) < 1e-30
    assert abs(matrix[-1] @ nodes ** (2 * stages - 1) - 1 / _context().mpf(2 * stages)) > 1e-12
    assert abs(before @ nodes**0 - 1) < 1e-30
    assert abs(before @ nodes ** (stages - 1)) < 1e-30


@pytest.mark.parametrize("name", [*NORMAL, *FRICTION])
def test_precise_equations_are_the_same(name):
    scene = scene_with(name)
    y, p = check_start(scene, Case("", {}).state()), check_numbers(scene)
    precise = _equations()(0, y.astype(object), p.astype(object)).astype(float)
    assert precise == pytest.approx(derivative(0.0, y, p), rel=1e-10)


def test_a_flight_is_a_parabola():
    still = dict.fromkeys(("omega_1", "theta_1", "theta_2", "omega_2"), 0.0)
    case = Case("", {}, changed={"height": 0.1, **still}, duration=0.1)
    p, y = check_numbers(SCENE), check_start(SCENE, case.state())
    found = precise_motion(y, p, 0.1, scales(p, 8))
    assert found.state[0] == pytest.approx(y[4] * 0.1 + 0.005 * p[6], rel=1e-15)
    assert found.state[1] == pytest.approx(y[1] + y[5] * 0.1 + 0.005 * p[7], rel=1e-15)
    assert found.doubt < 1e-17


@pytest.mark.slow
def test_a_precise_walk_is_scipys():
    p, y = check_numbers(SCENE), check_start(SCENE, Case("", {}).state())
    found = precise_motion(y, p, 4e-3, scales(p, 8))
    scipys = checked(y, p, 4e-3)
    assert found.state == pytest.approx(scipys.state, abs=1e-13)
    assert found.doubt < 1e-16
    assert found.lowest == pytest.approx(p[2] * scipys.lowest + solves._fallen_height(p), abs=1e-4)
