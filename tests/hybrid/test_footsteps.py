"""Lengths of a cycle's footsteps, against landings that are written down."""

from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest

from jaxbiped.dynamics import FootMotion
from jaxbiped.hybrid._footsteps import (
    _first_strikes,
    _in_names_of_start,
    _place_of_strike,
    distances,
)

PLACES = jnp.arange(14.0).reshape(2, 7)
"""Leg 0 is at 0 to 6, leg 1 at 7 to 13."""


def landings(*pairs):
    lands = np.zeros((2, 7), dtype=bool)
    for leg, node in pairs:
        lands[leg, node] = True
    return jnp.asarray(lands)


@pytest.mark.parametrize(
    ("lands", "stands", "expected"),
    [
        (landings((0, 1), (1, 3), (0, 6)), 1, [0 + 1, 7 + 3]),
        (landings((0, 1), (1, 3), (0, 6)), 0, [7 + 3, 6]),
        (landings((0, 1), (1, 3), (0, 6)), -1, [1, 10]),
        # A foot that bounces has landed once, and one on the first node as well.
        (landings((0, 0), (0, 1), (0, 2), (1, 5)), 1, [0, 12]),
        (landings((0, 2)), 1, [2, np.nan]),
        # Of two legs that land at once the farther place counts.
        (landings((0, 2), (1, 2)), -1, [9, np.nan]),
    ],
)
def test_a_footstep_is_made_by_another_leg_than_the_last(lands, stands, expected):
    found = _first_strikes(lands, PLACES, jnp.asarray(stands), 2)
    np.testing.assert_array_equal(found, expected)


def test_a_single_leg_lands_again_and_again():
    lands, places = jnp.asarray([[False, True, False, True, True]]), jnp.arange(5.0)[None]
    np.testing.assert_array_equal(_first_strikes(lands, places, jnp.asarray(-1), 3), [1, 3, 4])


def test_the_first_length_is_from_the_last_strike_of_the_cycle_before():
    found = distances(jnp.asarray([0.1, 0.4, 0.8]), jnp.asarray([0.9]))
    np.testing.assert_allclose(found, [0.2, 0.3, 0.4], rtol=1e-12)


def test_the_first_of_a_legs_feet_that_touches_tells_its_place():
    def foot(x, depth):
        zero = jnp.zeros(())
        return FootMotion(
            jnp.asarray(x), zero, zero, zero, jnp.asarray(depth), *[zero] * 2, None, None
        )

    up, down = -1e-3, 1e-3
    for depths, place in (
        ((down, down, down), 1.0), ((up, down, down), 2.0), ((up, up, down), 3.0),
        ((up, up, up), 3.0), ((down, up, up), 1.0),
    ):  # fmt: skip
        feet = [foot(x, depth) for x, depth in zip((1.0, 2.0, 3.0), depths, strict=True)]
        assert float(_place_of_strike(feet)) == place


def test_names_are_exchanged_at_each_arrival():
    structure = SimpleNamespace(legs_renamed=lambda i: (i % 2, 1 - i % 2))
    values = jnp.arange(12.0).reshape(2, 3, 2)
    found = _in_names_of_start(structure, values)
    np.testing.assert_array_equal(found, [[0, 1, 8, 9, 4, 5], [6, 7, 2, 3, 10, 11]])
