"""States that stops allow, against limits and held angles that are written down."""

import numpy as np

import jaxbiped as jb
from jaxbiped.dynamics._state_quantities import recurring_names
from jaxbiped.sweep._follow_starts import passes_a_stop
from jaxbiped.variational._hybrid_system import admissible_directions, independent_names
from tests.dynamics.test_modes import ANGLES, RATES, hsu_chen

SCENE = hsu_chen()
HELD = SCENE.state(**ANGLES, **RATES, held="shank_2")


def test_states_beyond_a_stop_are_seen_one_by_one():
    """Shanks may be bent back, and stretched as far as their thighs."""
    shank = np.array([-0.3, -0.2, -0.1])
    values = {name: np.full(3, float(value)) for name, value in HELD._asdict().items()}
    found = passes_a_stop(SCENE, values | {"theta_shank_1": shank})
    np.testing.assert_array_equal(found, shank > ANGLES["theta_thigh_1"])
    seed = jb.seed_scene()
    assert not passes_a_stop(seed, {"theta_1": np.array([3.0])}).any()


def test_what_is_held_moves_with_what_holds_it():
    """A held knee turns as its thigh does, in angle and rate; nothing moves the mode."""
    names = recurring_names(HELD)
    scales = np.arange(1.0, 1.0 + len(names))
    found = admissible_directions(SCENE, HELD, scales)
    assert found.shape == (9, 6)
    np.testing.assert_allclose(found.T @ found, np.eye(6), atol=1e-14)
    moves = dict(zip(names, found * scales[:, None], strict=True))
    for kind in ("theta", "omega"):
        np.testing.assert_allclose(moves[f"{kind}_shank_2"], moves[f"{kind}_thigh_2"], atol=1e-13)
    assert not np.allclose(moves["theta_shank_1"], moves["theta_thigh_1"])
    left_out = set(names) - set(independent_names(SCENE, HELD))
    assert left_out == {"theta_shank_2", "omega_shank_2", "mode"}
