"""Gaits marked in pictures of basins, against places that are written into datasets by hand."""

import json

import numpy as np
import pytest
import xarray
from matplotlib.figure import Figure

from jaxbiped.plot import basin
from tests.drawn import legend_of


def _gait(x, y):
    return {"cycle_footsteps": 1, "coordinates": {"theta_swing": x, "omega_swing": y}}


def _row(*gaits, **parameters):
    return {"parameters": parameters, "gaits": list(gaits)}


def _dataset(rows, axes=None, gait=0, settings="{}"):
    axes = axes or {"theta_swing": np.linspace(0.0, 1.0, 5), "omega_swing": np.linspace(-2, 2, 3)}
    shape = tuple(len(values) for values in axes.values())
    fields = {
        "label": (tuple(axes), np.zeros(shape, int)),
        "cycle_footsteps": (tuple(axes), np.ones(shape, int)),
        "gait": (tuple(axes), np.broadcast_to(gait, shape)),
    }
    attributes = {"gaits": json.dumps(rows), "settings": settings}
    return xarray.Dataset(fields, axes, attrs=attributes)


def _stars(ax, marker="*"):
    return [line.get_xydata() for line in ax.lines if line.get_marker() == marker]


def test_a_gait_lies_where_its_coordinates_say_along_either_axis():
    data = _dataset([_row(_gait(0.3, -1.0))])
    (ax,) = basin(data).axes
    np.testing.assert_array_equal(_stars(ax), [[[0.3, -1.0]]])
    assert legend_of(ax) == ["walking period-1: 100.0 %", "gait"]
    (turned,) = basin(data, names=("omega_swing", "theta_swing")).axes
    np.testing.assert_array_equal(_stars(turned), [[[-1.0, 0.3]]])
    (told,) = basin(data, mark=(0.5, 0.5)).axes
    np.testing.assert_array_equal(_stars(told), [[[0.5, 0.5]]])


def test_a_gait_beyond_the_picture_is_not_marked():
    (ax,) = basin(_dataset([_row(_gait(3.0, 0.0))])).axes
    assert _stars(ax) == []
    assert "gait" not in legend_of(ax)


def test_along_a_parameter_gaits_make_a_curve():
    axes = {"slope": np.array([0.01, 0.02, 0.03]), "theta_swing": np.linspace(0.0, 1.0, 5)}
    rows = [_row(_gait(0.2, 0.0), slope=0.01), _row(slope=0.02), _row(_gait(0.4, 0.0), slope=0.03)]
    (ax,) = basin(_dataset(rows, axes)).axes
    np.testing.assert_allclose(_stars(ax)[0], [[0.01, 0.2], [0.03, 0.4]])


def test_of_a_slice_at_a_parameter_the_gait_is_that_parameters():
    axes = {
        "slope": np.array([0.01, 0.02]),
        "theta_swing": np.linspace(0.0, 1.0, 5),
        "omega_swing": np.linspace(-2.0, 2.0, 3),
    }
    rows = [_row(_gait(0.2, 0.0), slope=0.01), _row(_gait(0.4, 1.0), slope=0.02)]
    (ax,) = basin(_dataset(rows, axes).sel(slope=0.02)).axes
    np.testing.assert_array_equal(_stars(ax), [[[0.4, 1.0]]])
    assert legend_of(ax)[-1] == "gait"


@pytest.mark.parametrize("settings", ['{"starts": {"base": {"theta_1": 0.0}}}', "{}"])
def test_gaits_off_the_slice_are_called_projected(settings):
    """A base of the user's own, or a second gait of which the slice knows nothing."""
    gaits = [_gait(0.2, 0.0), _gait(0.6, 1.0)]
    (ax,) = basin(_dataset([_row(*gaits)], settings=settings)).axes
    first = "gait 0" if settings == "{}" else "gait 0, projected"
    assert legend_of(ax)[-2:] == [first, "gait 1, projected"]
    np.testing.assert_array_equal(_stars(ax, "P"), [[[0.6, 1.0]]])


def test_one_gait_off_the_slice_makes_the_curve_projected():
    """A rate that the slice holds, and one gait of three that has another."""
    axes = {"slope": np.array([0.01, 0.02, 0.03]), "theta_swing": np.linspace(0.0, 1.0, 5)}
    for rate, label in ((1.0, "gait, projected"), (0.5, "gait")):
        rows = [_row(_gait(0.2, 0.5), slope=0.01), _row(_gait(0.4, rate), slope=0.02)]
        (ax,) = basin(_dataset(rows, axes).assign_coords(omega_swing=0.5)).axes
        assert legend_of(ax)[-1] == label
        np.testing.assert_allclose(_stars(ax)[0], [[0.01, 0.2], [0.02, 0.4]])


@pytest.mark.parametrize("turned", ["x", "y"])
def test_a_gait_is_marked_where_an_axis_runs_the_other_way(turned):
    given = Figure().add_subplot()
    getattr(given, f"invert_{turned}axis")()
    (ax,) = basin(_dataset([_row(_gait(0.3, -1.0))]), ax=given).axes
    assert getattr(ax, f"{turned}axis_inverted")()
    np.testing.assert_array_equal(_stars(ax), [[[0.3, -1.0]]])


def test_numbers_of_gaits_are_said_where_cycles_are_alike():
    rows = [_row(_gait(0.2, 0.0))]
    alone = basin(_dataset(rows)).axes[0]
    assert legend_of(alone)[0] == "walking period-1: 100.0 %"
    several = basin(_dataset(rows, gait=np.array([[0, 1, 0]] * 5))).axes[0]
    assert [text.partition(":")[0] for text in legend_of(several)[:2]] == [
        "walking period-1, gait 0",
        "walking period-1, gait 1",
    ]


def test_a_dataset_that_does_not_say_where_gaits_are_has_no_mark():
    gait = {"cycle_footsteps": 1}
    (ax,) = basin(_dataset([_row(gait)])).axes
    assert _stars(ax) == []
