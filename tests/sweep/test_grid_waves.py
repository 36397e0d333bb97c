"""Waves of a grid, against a partition of its points, and guesses against cubics."""

import numpy as np
import pytest

from jaxbiped.sweep._gait_waves import extrapolated, interpolated, neighbours, rings, waves

SHAPES = [((100, 100), (37, 80)), ((97,), (3,)), ((30, 5, 7), (0, 4, 6)), ((8, 8), (7, 0))]


@pytest.mark.parametrize(("shape", "first"), SHAPES)
def test_every_point_is_in_one_wave(shape, first):
    plan = waves(shape, first)
    places = [place for wave in plan for place in wave.places]
    assert len(places) == len(set(places)) == np.prod(shape)
    assert plan[0].places == [first]


@pytest.mark.parametrize(("shape", "first"), SHAPES)
def test_every_wave_has_guesses_from_those_before(shape, first):
    """Of states linear in the indices these are exact, but where one neighbour alone is known."""
    grid = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1).astype(float)
    truth = np.concatenate([grid, grid.sum(axis=-1, keepdims=True)], axis=-1)
    states, exact = np.full_like(truth, np.nan), 0
    states[first] = truth[first]
    for wave in waves(shape, first)[1:]:
        guesses = interpolated(states, first, wave) if wave.fills else extrapolated(states, wave)
        off = np.abs(guesses - np.array([truth[place] for place in wave.places]))
        assert np.max(off) <= 2 * wave.stride
        exact += np.sum(np.max(off, axis=1) < 1e-12)
        for place in wave.places:
            states[place] = truth[place]
    assert exact > 0.5 * np.prod(shape)


def test_interpolation_is_cubic_and_goes_around_holes():
    shape, first = (96,), (0,)
    wave = waves(shape, first)[-1]
    x = np.arange(96.0)
    states = np.stack([(x / 50) ** 3, x], axis=-1)
    states[1::2] = np.nan
    inner = slice(1, -3)
    truth = np.array([(place[0] / 50) ** 3 for place in wave.places])
    found = interpolated(states, first, wave)
    np.testing.assert_allclose(found[inner, 0], truth[inner], atol=1e-13)
    states[40] = np.nan
    found = interpolated(states, first, wave)
    # Next to the hole straight on from one side; further off as far as the points there go.
    assert found[19, 1] == pytest.approx(39.0)
    assert found[20, 1] == pytest.approx(41.0)
    assert np.all(np.isfinite(found))


def test_rings_are_of_points_equally_far_away():
    found = list(rings((4, 5), (1, 2)))
    for distance, ring in enumerate(found):
        assert all(abs(i - 1) + abs(j - 2) == distance for i, j in ring)
    assert set(neighbours((0, 0), (4, 5))) == {(1, 0), (0, 1)}
