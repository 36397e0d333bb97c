"""Precise solve of the check, against closed forms and SciPy's solves, and rounding."""

import dataclasses

import pytest
from extreme_cases.case import Case, check_numbers, check_start
from reference import scipy_solves as solves
from reference.compliant import FRICTION, NORMAL, derivative
from reference.precise_solves import _context, _equations, _method, precise_motion
from reference.scipy_solves import checked, scales

import jaxbiped as jb

SCENE = jb.seed_scene()


def test_collocation_is_of_its_order():
    nodes, matrix, before, _ = _method()
    stages = len(nodes)
    for power in range(2 * stages - 1):
        assert abs(matrix[-1] @ nodes**power - 1 / _context().mpf(power + 1)) < 1e-30
    assert abs(matrix[-1] @ nodes ** (2 * stages - 1) - 1 / _context().mpf(2 * stages)) > 1e-12
    assert abs(before @ nodes**0 - 1) < 1e-30
    assert abs(before @ nodes ** (stages - 1)) < 1e-30


@pytest.mark.parametrize("name", [*NORMAL, *FRICTION])
def test_the_equations_are_the_checks(name):
    kind = "normal" if name in NORMAL else "friction"
    if kind == "normal":
        law = jb.laws.normal_law_like(name, K=1e6, c=1e5, n=1.6, mass=2.0)
    else:
        law = jb.laws.friction_law_like(name, mu_static=0.5, mu_kinetic=0.4, v0=1e-3, xi=100.0)
    scene = dataclasses.replace(SCENE, **{kind: law})
    y = check_start(scene, Case("", {}).state())
    p = check_numbers(scene)
    precise = _equations()(0, y.astype(object), p.astype(object)).astype(float)
    assert precise == pytest.approx(derivative(0.0, y, p), rel=1e-10)


def test_a_flight_is_a_parabola():
    case = Case("", {}, changed={"height": 0.1, "omega_1": 0.0, "theta_1": 0.0, "theta_2": 0.0,
                                 "omega_2": 0.0}, duration=0.1)  # fmt: skip
    p, y = check_numbers(SCENE), check_start(SCENE, case.state())
    found = precise_motion(y, p, 0.1, scales(p, 8))
    assert found.state[0] == pytest.approx(y[4] * 0.1 + 0.005 * p[6], rel=1e-15)
    assert found.state[1] == pytest.approx(y[1] + y[5] * 0.1 + 0.005 * p[7], rel=1e-15)
    assert found.doubt < 1e-17


@pytest.mark.slow
def test_a_walk_is_scipys():
    p, y = check_numbers(SCENE), check_start(SCENE, Case("", {}).state())
    found = precise_motion(y, p, 4e-3, scales(p, 8))
    scipys = checked(y, p, 4e-3)
    assert found.state == pytest.approx(scipys.state, abs=1e-13)
    assert found.doubt < 1e-16
    assert found.lowest == pytest.approx(p[2] * scipys.lowest + solves._fallen_height(p), abs=1e-4)
