"""Switches of a foot and what jumps there, against each written out a second time."""

import dataclasses

import jax
import jax.numpy as jnp
import pytest

import jaxbiped as jb
from jaxbiped.dynamics._surfaces import switches
from jaxbiped.scene.laws._catalogue import normal_law_like

SEED = jb.seed_scene()
LOW = jb.seed_state()._replace(
    hip_z=jnp.asarray(0.3945), theta_1=jnp.asarray(-0.1), omega_1=jnp.asarray(0.5)
)
"""Leg 2 stands 0.9 mm deep; leg 1 swings underground, where the clearance rule lets it pass."""


def told(scene, state):
    """Of each switch its value, whether it is live, and its two flags."""
    flags = [(each.force_jumps, each.corner) for each in switches(scene, state)]
    found = jax.jit(lambda y: [(s.value, jnp.asarray(s.live)) for s in switches(scene, y)])(state)
    return [(float(v), bool(live), *flag) for (v, live), flag in zip(found, flags, strict=True)]


@pytest.mark.parametrize("leg", [1, 2])
def test_switches_of_the_seeds_feet(leg):
    foot = jb.dynamics.feet(SEED, LOW)[leg - 1]
    depth, rate, slip = map(float, (foot.penetration, foot.penetration_rate, foot.slip_speed))
    stands = leg == 2
    assert depth > 0.0
    turning = float((LOW.omega_1, LOW.omega_2)[leg - 1])
    carries = stands and 1e6 * depth**1.5 + 1e7 * depth * rate > 0.0
    own = told(SEED, LOW)[6 * (leg - 1) : 6 * leg]
    expected = [
        (depth, turning < 0.0, False, False),
        (1e6 * depth**0.5 + 1e7 * rate, stands, False, True),
        (slip - 1e-4, carries, False, True),
        (slip + 1e-4, carries, False, True),
        (slip, carries, False, True),
        (turning, 1e6 * depth**1.5 + 1e7 * depth * rate > 0.0, True, False),
    ]
    for ours, (value, live, *flags) in zip(own, expected, strict=True):
        assert ours[0] == pytest.approx(value, rel=1e-9)
        assert ours[1] is live
        assert list(ours[2:]) == flags


def test_a_force_that_jumps_at_touchdown_is_told_and_a_rule_that_is_none_is_not():
    law = normal_law_like("kelvin-voigt", K=1e6, c=1e7, n=1.5, mass=2.0)
    scene = dataclasses.replace(SEED, normal=law, clearance=jb.laws.AlwaysTouching())
    found = told(scene, LOW)
    assert len(found) == 10
    jumps = [each[2] for each in found]
    assert jumps == [True, False, False, False, False] * 2
    both = jb.dynamics.feet(scene, LOW)
    assert [found[0][0], found[5][0]] == pytest.approx([float(f.penetration) for f in both])
    assert found[0][1]
    assert found[5][1]
