"""Surfaces of rigid legs that are chains, against places that are summed up link by link."""

import numpy as np
import pytest

from jaxbiped.dynamics._surfaces import lead, lean, opening, uprightness
from tests.dynamics.test_modes import hsu_chen


def foot_from_hip(leg, angles):
    """Ahead of the hip and below it [m]; thigh and shank are 0.5 m long each."""
    both = np.array([angles[f"theta_thigh_{leg}"], angles[f"theta_shank_{leg}"]])
    return 0.5 * np.sin(both).sum(), 0.5 * np.cos(both).sum()


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_bent_legs_strike_lean_and_fall_where_their_feet_are(side):
    """In units of the height, which is 1 m; a walker has fallen as a straight one at 1 rad."""
    scene = hsu_chen()
    angles = dict(theta_thigh_1=0.3 * side, theta_thigh_2=-0.2 * side)
    angles |= dict(theta_shank_1=0.3 * side - 0.4, theta_shank_2=-0.2 * side - 0.05)
    state = scene.state(**angles, held=())
    (swings, down), (stands, height) = (foot_from_hip(leg, angles) for leg in (1, 2))
    assert float(opening(scene, state)) == pytest.approx(height - down, rel=1e-12)
    assert float(lead(scene, state)) == pytest.approx(swings - stands - 1e-3, rel=1e-12)
    assert float(lean(scene, state)) == pytest.approx(stands, rel=1e-12)
    left = height - np.cos(1.0)
    assert float(uprightness(scene, state, np.float64(side))) == pytest.approx(left, rel=1e-12)
