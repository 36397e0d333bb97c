"""Sweeps in waves, against gaits of single searches, whatever was killed on the way."""

import shutil

import numpy as np
import pytest
import xarray
import zarr

import jaxbiped as jb
from jaxbiped.sweep import _gait_sweep
from jaxbiped.sweep._gait_sweep import find_each
from tests.cli.commands import interrupt_after

pytestmark = pytest.mark.slow

PLAIN = dict(parameters=("K",), radius_sensitivities=False)
OVER = {"slope": np.linspace(0.018, 0.03, 8), "K": np.geomspace(8e5, 1.3e6, 8)}


@pytest.fixture(scope="module")
def swept():
    return jb.gait_sweep(jb.seed_scene(), OVER, **PLAIN)


@pytest.mark.parametrize("place", [(7, 7), (3, 5)])
def test_gaits_are_those_of_single_searches(swept, place):
    point = {name: values[i] for (name, values), i in zip(OVER.items(), place, strict=True)}
    alone = jb.find_gait(jb.with_parameters(jb.seed_scene(), point), **PLAIN)
    here = swept.isel(dict(zip(OVER, place, strict=True)))
    # To the solve's error, for they begin elsewhere.
    for name, within in dict(period=2e-7, peak_normal=2e-6, spectral_radius=3e-5).items():
        assert float(here[name]) == pytest.approx(float(getattr(alone.measures, name)), rel=within)
    assert float(here.elasticity_period[0]) == pytest.approx(
        float(alone.elasticities.period[0]), rel=1e-3
    )
    assert np.all(swept.ending == int(jb.gait.Search.FOUND))
    # A start that the seed's own gait is near; all others come from neighbours.
    assert np.sum(swept.found_by == int(jb.gait.FoundBy.START)) == 1


def test_digits_of_a_batch_do_not_depend_on_what_is_beside():
    """A single search, by NumPy, rounds Newton's step otherwise: equal to the solve's error."""
    scene = jb.seed_scene()
    start = jb.find_gait(scene, **PLAIN).measures.state
    values = {"K": np.linspace(9e5, 1.1e6, 20)}
    rows = np.tile([float(x) for x in start[1:]], (20, 1))

    def periods(order):
        parts = find_each(scene, {"K": values["K"][order]}, rows[order], type(start), PLAIN)
        return np.concatenate([gaits.measures.period for _, gaits in parts])

    whole = periods(np.arange(20))
    np.testing.assert_array_equal(periods(np.arange(20)[::-1])[::-1], whole)
    alone = jb.find_gait(jb.with_parameters(scene, {"K": values["K"][3]}), start, **PLAIN)
    assert whole[3] == pytest.approx(float(alone.measures.period), rel=2e-7)


def test_a_killed_sweep_continues_to_the_same_bits(swept, tmp_path, monkeypatch):
    path = tmp_path / "gaits"
    interrupt_after(monkeypatch, 5)
    with pytest.raises(KeyboardInterrupt) as ended:
        jb.gait_sweep(jb.seed_scene(), OVER, store=path, **PLAIN)
    known = int(np.isfinite(xarray.open_zarr(path).period).sum())
    assert f"finding gaits: {known} of 64 gaits" in ended.value.__notes__[0]
    assert 1 < known < 64
    marked = zarr.open_group(str(path))["period"]
    ours = np.isfinite(marked[:]) & (swept.found_by.values != int(jb.gait.FoundBy.START))
    marked[:] = np.where(ours, 9.0, marked[:])  # what is known is not searched again
    again = jb.gait_sweep(jb.seed_scene(), OVER, store=path, **PLAIN).load()
    np.testing.assert_array_equal(again.period.values == 9.0, ours)
    again.period.values[ours] = swept.period.values[ours]
    xarray.testing.assert_equal(again.drop_attrs(), swept.drop_attrs())


def test_what_a_wave_misses_its_neighbours_find(swept, monkeypatch):
    """Guesses that lead nowhere cost a point its wave, not its gait."""
    honest = _gait_sweep.extrapolated

    def misled(states, wave):
        guesses = honest(states, wave)
        guesses[::3] = 0.0
        return guesses

    monkeypatch.setattr(_gait_sweep, "extrapolated", misled)
    again = jb.gait_sweep(jb.seed_scene(), OVER, **PLAIN)
    assert np.all(again.found_by.data.ravel()[1:] >= 0)
    np.testing.assert_allclose(again.period, swept.period, rtol=1e-6)


def test_gaits_of_a_batch_that_graze_are_told(tmp_path):
    """At that damping the foot that strikes rebounds until it all but leaves the ground."""
    grazing, path = 152234.28, tmp_path / "gaits"
    over = {"c": np.sort([grazing, *np.geomspace(1.4e5, 1.66e5, 63)])}
    with pytest.warns(RuntimeWarning, match="1 of the gaits graze a switch"):
        found = jb.gait_sweep(jb.seed_scene(), over, store=path, **PLAIN)
    assert found.grazes.sum() == found.grazes.sel(c=grazing) == 1
    assert np.all(np.isnan(found.elasticity_period.sel(c=grazing)))
    assert np.isfinite(found.elasticity_period).sum() == 63
    with pytest.warns(RuntimeWarning, match="1 of the gaits graze a switch"):
        jb.gait_sweep(jb.seed_scene(), over, store=path, **PLAIN)  # all of it known


def test_a_store_of_another_sweep_or_that_kept_less_is_refused(tmp_path):
    path, over = tmp_path / "gaits", {"slope": [0.02]}
    jb.gait_sweep(jb.seed_scene(), over, store=path, **PLAIN)
    with pytest.raises(jb.ArgumentError, match="other settings"):
        jb.gait_sweep(jb.seed_scene(), {"slope": [0.021]}, store=path, **PLAIN)
    shutil.rmtree(path / "grazes")
    with pytest.warns(UserWarning, match="Consolidated metadata"):
        zarr.consolidate_metadata(str(path))
    with pytest.raises(jb.ArgumentError, match="kept no grazes"):
        jb.gait_sweep(jb.seed_scene(), over, store=path, **PLAIN)


def test_points_next_to_gaits_are_searched_without_a_guess_on_a_coarse_grid(monkeypatch):
    """Beside a fold, gaits that are far from their neighbours'; periods by continuation in K."""
    monkeypatch.setattr(_gait_sweep, "LARGE", 16)
    stiffness, damping = np.geomspace(1e4, 1e9, 15)[4:8], np.geomspace(1e5, 1e9, 9)[:5]
    with pytest.warns(RuntimeWarning, match="no gait was found at"):
        found = jb.gait_sweep(
            jb.seed_scene(slope=0.005),
            {"K": stiffness, "c": damping},
            **(PLAIN | {"parameters": ()}),
        )
    for (i, j), period in {(1, 2): 0.641562, (2, 3): 0.565852}.items():
        assert float(found.period[i, j]) == pytest.approx(period, abs=1e-5)
