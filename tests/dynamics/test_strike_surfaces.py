"""Surfaces of rigid legs that are chains, against places that are summed up link by link."""

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.hybrid import Rolling
from tests.dynamics.test_modes import hsu_chen

APART = 1e-3
"""How far ahead a foot strikes at least, in units of the height."""


def foot_from_hip(leg, angles):
    """Ahead of the hip and below it, in units of the height; thigh and shank are half of it."""
    both = np.array([angles[f"theta_thigh_{leg}"], angles[f"theta_shank_{leg}"]])
    return 0.5 * np.sin(both).sum(), 0.5 * np.cos(both).sum()


@pytest.fixture(params=[1.0, 0.4], ids=lambda height: f"{height} m")
def scene(request):
    return jb.with_parameters(
        hsu_chen(), dict.fromkeys(("l_thigh", "l_shank"), 0.5 * request.param)
    )


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("off", [-1e-7, 1e-7])
def test_bent_legs_strike_where_their_feet_are(scene, side, off):
    """In units of the height."""
    angles = dict(theta_thigh_2=-0.2 * side, theta_shank_2=-0.2 * side - 0.05)
    stands, down_to_it = foot_from_hip(2, angles)
    thigh = np.arcsin(stands) + 0.1
    shank = np.arcsin(2.0 * (stands + APART + off) - np.sin(thigh))
    angles |= dict(theta_thigh_1=thigh, theta_shank_1=shank)
    _, down = foot_from_hip(1, angles)
    value, counts = Rolling().arrival(jb.HeelStrike(), scene, scene.state(**angles, held=()))
    assert float(value) == pytest.approx(down - down_to_it, rel=1e-12)
    assert bool(counts) is (off > 0.0)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_walker_has_fallen_as_a_straight_one_at_1_rad(scene, side):
    """To the side to which it leans: forward where the root is ahead of the standing foot."""
    for off in (-1e-9, 1e-9):
        both = side * 0.9, side * np.arccos(2.0 * (np.cos(1.0) - off) - np.cos(0.9))
        angles = dict(theta_thigh_2=max(both), theta_shank_2=min(both))
        angles |= dict(theta_thigh_1=-0.3, theta_shank_1=-0.4)
        stands, down = foot_from_hip(2, angles)
        assert np.sign(down - np.cos(1.0)) == -np.sign(off)
        ending = int(Rolling().ending(scene, scene.state(**angles, held=())))
        fallen = jb.Ending.FELL_BACK if stands > 0.0 else jb.Ending.FELL_FORWARD
        assert (ending == int(fallen)) is (off > 0.0), jb.Ending(ending)
