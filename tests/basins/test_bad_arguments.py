"""Refused arguments of the analyses of basins, against the words that name each."""

import numpy as np
import pytest
import xarray as xr

import jaxbiped as jb
from tests.basins.known_basins import ball, half_space

EYE = np.eye(65, dtype=int)
BOX = {"lower": (0.0, 0.0), "upper": (1.0, 1.0)}
RIGHT = {
    "shock": (
        jb.basins.minimal_fatal_shock,
        {"origin": [0.0, 0.0], "scales": [1.0, 1.0], "max_distance": 3.0, "tolerance": 1e-4}
        | {"label_of": half_space((1.0, 0.0), 0.5)},
    ),
    "refine": (
        jb.basins.refine_boundary,
        {"label_of": ball((0, 0), 1.0), "shape": (4, 4), "levels": 2} | BOX,
    ),
    "sampled": (
        jb.basins.sampled_uncertainty,
        {"label_of": ball((0, 0), 0.5), "samples": 64, "distances": (0.01, 0.02, 0.1)} | BOX,
    ),
    "dimension": (jb.basins.boundary_dimension, {}),
    "uncertainty": (jb.basins.uncertainty_exponent, {}),
    "entropy": (jb.basins.entropy, {}),
    "wilson": (jb.basins.wilson_interval, {}),
    "fractions": (jb.basins.fractions, {}),
    "errors": (jb.basins.label_errors, {"found": xr.Dataset()}),
}


@pytest.mark.parametrize(
    ("analysis", "change", "words"),
    [
        ("shock", dict(origin=[0.0, np.nan]), "origin; nan; finite"),
        ("shock", dict(origin=0.0), "origin; (); (d,)"),
        ("shock", dict(scales=[1.0]), "scales; (1,); origin; (2,)"),
        ("shock", dict(scales=[1.0, 0.0]), "scales; 0; above 0"),
        ("shock", dict(max_distance=-1.0), "max_distance; -1; above 0"),
        ("shock", dict(tolerance=0.0), "tolerance; 0; above 0"),
        ("shock", dict(tolerance=3.0), "tolerance; 3; below max_distance = 3"),
        ("shock", dict(tolerance=1e-15), "tolerance; 1e-15; at least"),
        ("shock", dict(directions=0), "directions; 0; above 0"),
        ("shock", dict(directions=np.ones((3, 3))), "directions; (3, 3); (n, 2)"),
        ("shock", dict(directions=np.zeros((1, 2))), "directions; zeros"),
        ("shock", dict(steps=0), "steps; 0; above 0"),
        ("shock", dict(improved=-1), "improved; -1; at least 0"),
        ("shock", dict(batch=0), "batch; 0; above 0"),
        ("shock", dict(normal=lambda x: x[:, 0]), "normal; shape; same"),
        ("shock", dict(label_of=lambda x: x[:, 0]), "label_of; float64; whole numbers"),
        ("shock", dict(label_of=lambda x: np.full(len(x), -1)), "label_of; pending"),
        ("refine", dict(lower=(0.0, 2.0)), "lower[1] = 2; below; upper[1] = 1"),
        ("refine", dict(upper=(1.0, np.nan)), "upper; nan; finite"),
        ("refine", dict(upper=(1.0,)), "(2,); (1,); same"),
        ("refine", dict(lower=(), upper=()), "lower; (0,); (d,)"),
        ("refine", dict(shape=(4, 0)), "shape; 0; above 0"),
        ("refine", dict(shape=(4,)), "shape; 1 entries; 2 dimensions"),
        ("refine", dict(shape=(4.5, 2)), "shape; 4.5; whole"),
        ("refine", dict(levels=-1), "levels; -1; at least 0"),
        ("refine", dict(levels=40), "levels; 40; 2^62"),
        ("refine", dict(batch=0), "batch; 0; above 0"),
        ("refine", dict(label_of=lambda points: points[:, 0]), "label_of; float64; whole numbers"),
        ("refine", dict(label_of=lambda points: np.zeros(3, int)), "label_of; (3,); (25,)"),
        ("dimension", dict(boundary=0 * EYE), "boundary; 0 of 5; at least 3"),
        ("dimension", dict(boundary=np.eye(9, dtype=int)), "2 of 2; at least 3"),
        ("dimension", dict(boundary=EYE, skip=5), "0 of 0; at least 3"),
        ("dimension", dict(boundary=EYE, skip=-1), "skip; -1; at least 0"),
        ("dimension", dict(boundary=EYE, sides=(1, 2, 128)), "sides; 128; at most 64"),
        ("dimension", dict(boundary=EYE, sides=(1, 2, 3, 4)), "sides; divide the largest"),
        ("dimension", dict(boundary=np.eye(65)), "labels; float64; whole numbers"),
        ("dimension", dict(boundary=np.zeros((0, 3), int)), "labels; (0, 3); at least one"),
        ("dimension", dict(boundary=0 * EYE - 1), "labels; 4225 pending; labelled"),
        ("uncertainty", dict(labels=0 * EYE), "labels; 0 of; at least 3"),
        ("uncertainty", dict(labels=EYE, distances=(1, 2, 50)), "distances; 50; below 32.5"),
        ("uncertainty", dict(labels=EYE, distances=(0, 1, 2)), "distances; 0; above 0"),
        ("uncertainty", dict(labels=np.int64(3)), "labels; (); grid"),
        ("uncertainty", dict(labels=np.full((9, 9), -1)), "labels; 81 pending"),
        ("sampled", dict(distances=(0.01, 0.6)), "distances; 0.6; below 0.5"),
        ("sampled", dict(distances=(0.01, -0.1)), "distances; -0.1; above 0"),
        ("sampled", dict(distances=()), "distances; (0,)"),
        ("sampled", dict(samples=0), "samples; 0; above 0"),
        ("sampled", dict(upper=(0.0, 1.0)), "lower[0] = 0; below"),
        ("sampled", dict(label_of=half_space((1.0, 0.0), 5.0)), "0 of 3; at least 3"),
        ("entropy", dict(labels=np.zeros((9, 4), int), box=5), "box; 5; at most 4"),
        ("entropy", dict(labels=np.zeros((9, 9), int), box=1), "box; 1; at least 2"),
        ("entropy", dict(labels=np.zeros((9, 9), int), box=2.5), "box; 2.5; whole"),
        ("entropy", dict(labels=np.full((9, 9), np.nan), box=5), "labels; float64; whole numbers"),
        ("entropy", dict(labels=np.zeros((9, 0), int), box=5), "labels; (9, 0); at least one"),
        (
            "entropy",
            dict(labels=[[0, -1], [0, 0]], box=2),
            "labels; 1 pending entries of 4",
        ),
        ("wilson", dict(count=3, total=2), "total; 2; at least count = 3"),
        ("wilson", dict(count=-1, total=2), "count; -1; at least 0"),
        ("wilson", dict(count=np.nan, total=2), "count; nan"),
        ("wilson", dict(count=[1, 2], total=[3, 4, 5]), "(2,); (3,); broadcast"),
        ("wilson", dict(count=1, total=2, confidence=1.0), "confidence; 1.0; below 1"),
        ("fractions", dict(labels=["a"], confidence=0.0), "confidence; 0.0; above 0"),
        ("fractions", dict(labels=xr.Dataset()), "labels; dataset; label"),
        ("fractions", dict(labels=[]), "labels; (0,); at least one"),
        ("fractions", dict(labels=[0, 99]), "labels; 99; Label"),
        ("fractions", dict(labels=[0, 1], doubt=[True]), "doubt has shape (1,)"),
        ("errors", dict(), "has no error estimates of its labels"),
    ],
)
def test_bad_arguments_are_named(analysis, change, words):
    function, right = RIGHT[analysis]
    with pytest.raises(jb.ArgumentError) as caught:
        function(**(right | change))
    assert all(word in str(caught.value) for word in words.split("; "))


def _lists(tmp_path):
    """Labels of starts that are no neighbours: of a sample, kept, thinned, turned into others."""
    label = ("start", np.arange(80) % 3)
    sample = xr.Dataset({"label": label, "start_omega_1": ("start", np.linspace(0.0, 1.0, 80))})
    sample.to_netcdf(tmp_path / "sample.nc", engine="scipy")
    kept = xr.load_dataset(tmp_path / "sample.nc", engine="scipy")
    axes = {"omega_1": np.linspace(0.0, 1.0, 80), "slope": [0.01, 0.02, 0.03]}
    grid = xr.Dataset({"label": (tuple(axes), np.arange(240).reshape(80, 3) % 3)}, axes)
    yield from (sample.label, kept.label, kept.label[20:], sample.label[np.arange(80) % 2 == 0])
    yield sample.to_dataframe().to_xarray().label  # numbered by pandas
    yield sample.set_coords("start_omega_1").label.rename(start="n")
    yield sample.to_dataframe().label
    yield grid.label.stack(start=["omega_1", "slope"])
    yield grid.label.stack(place=["omega_1", "slope"])
    yield grid.isel(omega_1=np.random.default_rng(0).permutation(80)).label
    assert jb.basins.entropy(grid.label, box=2) == jb.basins.entropy(grid.label.values, box=2)
    for known in (grid.label[::-1], grid.label.isel(slope=1), grid.label.drop_vars(list(axes))):
        assert jb.basins.entropy(known, box=2).boxes == 40
    grid.to_netcdf(tmp_path / "grid.nc", engine="scipy")
    assert jb.basins.entropy(xr.load_dataset(tmp_path / "grid.nc").label, box=2).boxes == 40


def test_a_list_of_starts_is_no_grid(tmp_path):
    functions = jb.basins.entropy, jb.basins.boundary_dimension, jb.basins.uncertainty_exponent
    for function in functions:
        for labels in _lists(tmp_path):
            with pytest.raises(jb.ArgumentError, match=r"no neighbours.*must be a grid"):
                function(labels)
            jb.basins.fractions(np.asarray(labels))
        with pytest.raises(jb.ArgumentError, match="labels is a whole dataset"):
            function(xr.Dataset())
    sample = jb.starts.sample(jb.ladder()["rigid"], {"omega_1": (-4.0, 5.0)}, 4)
    assert list(sample.axes) == ["start"]  # what it is told by
