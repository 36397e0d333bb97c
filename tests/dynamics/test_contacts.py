"""Kinematics of the feet against geometry."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.dynamics import FootMotion, touches
from jaxbiped.hybrid import Walking
from tests.mechanisms import scene_of


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
    """Of two legs astride whose feet come down at once; then of one that alone stands."""
    walking, seed = Walking(), jb.seed_scene()
    scene = jb.Scene(
        seed.walker, seed.ground, seed.normal, seed.friction, clearance=jb.laws.AlwaysTouching()
    )

    def astride(first, depth, lower=0.0):
        """Leg 1 at this angle, leg 2 at the opposite one but for what makes its foot lower."""
        height = 0.08 + 0.32 * np.cos(first) - depth
        second = -first * (1.0 - lower)
        return jb.State(0.0, height, first, second, *[0.0] * 4)

    for ahead, angle in ((0, 0.2), (1, -0.2)):
        before, both = astride(angle, -1e-3), astride(angle, 1e-3)
        lands = lambda one, two: list(map(bool, walking.landings(scene, one, two)))
        assert lands(before, both) == [ahead == 0, ahead == 1]
        assert not any(lands(both, both))
        assert not any(lands(both, before))
        alone = astride(angle, -1e-3, lower=0.1)
        assert int(walking.standing_leg(scene, alone)) == 2
        swapped = jb.dynamics.exchange_legs(scene, alone)
        assert int(walking.standing_leg(scene, swapped)) == 1
        for state in (both, before):
            assert int(walking.standing_leg(scene, state)) == 0
