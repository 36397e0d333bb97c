"""Waves of a grid, against a partition of its points, and guesses against cubics."""

from typing import NamedTuple

import numpy as np
import pytest
import xarray as xr

import jaxbiped as jb
from jaxbiped._progress import Stage
from jaxbiped.sweep._gait_grid import GaitGrid, extrapolated, interpolated, neighbours
from jaxbiped.sweep._gait_sweep import GaitWaves, rings, waves

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


class Measured(NamedTuple):
    state: jb.dynamics.RigidState


class FakeGait(NamedTuple):
    ending: np.ndarray
    stable: np.ndarray
    measures: Measured


def _gait(found, stable=True, count=None):
    shape = () if count is None else (count,)
    state = jb.dynamics.RigidState(*[np.full(shape, 1.0)] * 5)
    return FakeGait(np.where(found, 0, 2), np.asarray(found) & stable, Measured(state))


class FakeGrid:
    """Of what a sweep writes, the endings."""

    def __init__(self, shape):
        self.ending = np.full(shape, -1)

    def states(self):
        return np.full((*self.ending.shape, 4), np.nan)

    def is_done(self, place):
        return False

    def write(self, places, gaits):
        self.ending[tuple(np.transpose(places))] = gaits.ending


def _swept(truth, hidden, first):
    """Endings of a sweep, and where it searched without a guess.

    Gaits are where `truth` is; Newton's method misses those that are `hidden`, at first even those
    of neighbours.
    """
    grid, alone = FakeGrid(truth.shape), []

    def find(places, guesses):
        at = tuple(np.transpose(places))
        found = truth[at] & ~hidden[at] & (guesses[:, 0] == 1.0)
        yield slice(0, len(places)), _gait(found, count=len(places))

    def search_alone(place):
        alone.append(place)
        return _gait(truth[place])

    begun = first, _gait(np.asarray(True))
    GaitWaves(
        grid, begun, find, lambda _: np.zeros(4), search_alone, Stage("sweeping", None, "gaits", 0)
    ).run()
    return grid.ending, alone


def test_a_region_without_gaits_is_not_searched_point_by_point():
    truth = np.zeros((81, 65), dtype=bool)
    truth[:, :33] = True
    ending, alone = _swept(truth, np.zeros_like(truth), (40, 10))
    np.testing.assert_array_equal(ending == 0, truth)
    # A search speaks for the points up to 8 away.
    assert len(alone) <= np.ceil(81 / 9) * np.ceil(32 / 9)
    far = np.abs(np.argwhere(~truth)[:, None] - np.array(alone)).max(axis=-1).min(axis=1)
    assert far.max() <= 8


def test_holes_and_islands_are_searched():
    truth, hidden = np.zeros((40, 40), dtype=bool), np.zeros((40, 40), dtype=bool)
    truth[:, :20] = truth[10:25, 25:40] = True
    hidden[7, 9] = hidden[30, 3:5] = True  # a hole in the waves, and one of two points
    ending, alone = _swept(truth, hidden, (20, 5))
    np.testing.assert_array_equal(ending == 0, truth)
    lattice = {place for wave in waves(truth.shape, (20, 5))[:-1] for place in wave.places}
    beside = {
        p for p in lattice if not truth[p] and any(truth[n] for n in neighbours(p, truth.shape, 2))
    }
    assert beside <= set(alone)
    assert len(set(alone) - beside) < 20


def test_a_gait_on_the_edge_of_stability_is_not_stable():
    """Its errors neither fade nor grow; where there is no gait nothing is."""
    radii = xr.Dataset({"spectral_radius": ("slope", [1.0 - 1e-12, 1.0, 1.0 + 1e-12, np.nan])})
    grid = GaitGrid(radii, jb.dynamics.RigidState, None)
    assert [grid.is_stable((k,)) for k in range(4)] == [True, False, False, False]
