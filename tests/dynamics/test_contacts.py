"""Kinematics of the feet against geometry."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.dynamics import FootMotion, touches
from jaxbiped.dynamics._footfalls import landings, standing_leg
from tests.mechanisms import scene_of

LEGS = jb.seed_scene().mechanism.structure


def test_foot_at_the_seed_start():
    """Leg 2 stands, slightly indented and all but rolling; leg 1 hangs clear of the ground."""
    swing, stance = jb.dynamics.feet(jb.seed_scene(), jb.seed_state())
    assert float(stance.penetration) == pytest.approx(0.08 - 0.395 + 0.32 * np.cos(0.1655))
    assert bool(jb.dynamics.touches(stance))
    assert float(swing.penetration) < 0.0
    assert not bool(jb.dynamics.touches(swing))
    assert abs(float(stance.slip_speed)) < 1e-3


def test_velocities_are_derivatives_of_positions():
    scene, state = jb.seed_scene(), jb.seed_state()._replace(omega_1=jnp.asarray(2.0))
    rate = jb.dynamics.vector_field(0.0, state, scene)
    for i in (0, 1):
        position = lambda s, i=i: (jb.dynamics.feet(scene, s)[i].x, jb.dynamics.feet(scene, s)[i].z)
        vx, vz = jax.jvp(position, (state,), (rate,))[1]
        foot = jb.dynamics.feet(scene, state)[i]
        np.testing.assert_allclose((foot.vx, foot.vz), (vx, vz), rtol=1e-12)
        assert float(foot.penetration_rate) == pytest.approx(-float(vz))


def test_a_rolling_foot_does_not_slip():
    """A disc that rolls downhill turns backwards: hip speed is −(l − r + r) θ̇ upright."""
    state = jb.seed_state()._replace(
        theta_2=jnp.asarray(0.0), omega_2=jnp.asarray(-1.0), hip_vx=jnp.asarray(0.4)
    )
    assert float(jb.dynamics.feet(jb.seed_scene(), state)[1].slip_speed) == pytest.approx(0.0)


def test_standing_height():
    scene = jb.seed_scene()
    height = jb.dynamics.standing_height(scene, jnp.asarray(0.3), 1e-3)
    state = jb.seed_state()._replace(theta_2=jnp.asarray(0.3), hip_z=height)
    assert float(jb.dynamics.feet(scene, state)[1].penetration) == pytest.approx(1e-3, abs=1e-12)


def test_standing_height_of_knees():
    """The standing leg turned as a whole: its sole lies on the ground."""
    scene = scene_of("kneed")
    height = jb.dynamics.standing_height(scene, 0.3, 1e-3)
    at = 0.080 + (0.184 + 0.136) * np.cos(0.3) - 1e-3
    assert float(height) == pytest.approx(at, abs=1e-12)


def _foot(x, penetration, admitted):
    rest = dict.fromkeys(("z", "vx", "vz", "penetration_rate", "slip_speed"), np.float64(0.0))
    return FootMotion(x=np.float64(x), penetration=np.float64(penetration), admitted=admitted,
                bristle=None, **rest)  # fmt: skip


@pytest.mark.parametrize(
    ("penetration", "admitted", "expected"),
    [
        (1e-3, None, True),
        (-1e-3, None, False),
        (1e-3, np.True_, True),
        (1e-3, np.False_, False),
        (-1e-3, np.True_, False),
        (0.0, None, False),
    ],
)
def test_a_foot_touches_that_is_indented_and_admitted(penetration, admitted, expected):
    assert bool(touches(_foot(0.0, penetration, admitted))) is expected


def test_a_heel_strike_is_of_the_foot_ahead():
    up, down = -1e-3, 1e-3
    for ahead in (0, 1):
        places = (0.2, 0.1) if ahead == 0 else (0.1, 0.2)
        before = tuple(_foot(x, up, None) for x in places)
        both = tuple(_foot(x, down, None) for x in places)
        assert list(map(bool, landings(LEGS, before, both))) == [ahead == 0, ahead == 1]
        assert not any(map(bool, landings(LEGS, both, both)))
        assert not any(map(bool, landings(LEGS, both, before)))
        one = tuple(_foot(x, down if k == ahead else up, None) for k, x in enumerate(places))
        assert int(standing_leg(LEGS, one)) == ahead + 1
        assert int(standing_leg(LEGS, both)) == int(standing_leg(LEGS, before)) == 0
