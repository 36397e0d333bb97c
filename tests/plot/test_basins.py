"""Figures of basins, against labels made by hand."""

import numpy as np
import pytest
import xarray
from matplotlib.collections import PolyCollection, QuadMesh
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

import jaxbiped as jb
from jaxbiped.plot import basin, basin_fractions, refined_basin
from jaxbiped.plot.style import label_colour, label_marker
from tests.drawn import legend_of

AXES = {"names": ("swing angle", "stance rate"), "units": ("rad", "rad/s")}
CODES = np.array([[0, 0, 1], [3, -1, 0]])
X, Y = [1.0, 2.0, 3.0], [-1.0, 1.0]


def _colours(figure):
    """Colours of the cells as drawn, row by row along y."""
    (mesh,) = [one for one in figure.axes[0].collections if isinstance(one, QuadMesh)]
    mesh.update_scalarmappable()
    shape = np.shape(mesh.get_array())
    return np.array([to_hex(c).upper() for c in mesh.get_facecolors()]).reshape(shape)


def _nothing_is_cut_off(figure):
    figure.canvas.draw()
    (ax,) = figure.axes
    renderer = figure.canvas.get_renderer()
    everything = ax.get_tightbbox(renderer)
    assert everything.x0 >= 0
    assert everything.y0 >= 0
    assert everything.x1 <= figure.bbox.x1
    assert everything.y1 <= figure.bbox.y1
    assert not ax.get_legend().get_window_extent(renderer).overlaps(ax.get_window_extent(renderer))


def test_cells_have_their_labels_colours_and_places():
    (ax,) = basin(CODES, X, Y, **AXES).axes
    expected = [[label_colour(str(jb.basins.Label(code))) for code in row] for row in CODES]
    np.testing.assert_array_equal(_colours(ax.figure), expected)
    assert ax.get_xlim() == (0.5, 3.5)
    assert ax.get_ylim() == (-2.0, 2.0)
    assert ax.get_xlabel() == "swing angle (rad)"
    assert ax.get_ylabel() == "stance rate (rad/s)"


def test_edges_and_names_draw_the_same():
    by_code = basin(CODES, X, Y, cycle_footsteps=1, **AXES).axes[0]
    names = jb.basins.label_names(CODES, 1)
    axes = {"names": ("theta_swing", "omega_swing")}  # names that say words, symbol and unit
    by_name = basin(names, [0.5, 1.5, 2.5, 3.5], [-2.0, 0.0, 2.0], **axes).axes[0]
    np.testing.assert_array_equal(_colours(by_code.figure), _colours(by_name.figure))
    assert legend_of(by_code) == legend_of(by_name)
    assert by_code.get_xlim() == by_name.get_xlim()
    assert by_name.get_xlabel() == r"swing leg angle, $\theta_1$ (rad)"
    assert by_name.get_ylabel() == r"swing leg rate, $\omega_1$ (rad/s)"


def test_legend_says_each_labels_fraction():
    (ax,) = basin(CODES, X, Y, cycle_footsteps=2, mark=(2.0, 0.0), **AXES).axes
    assert legend_of(ax) == [
        "walking period-2: 60.0 %",
        "fell forward: 20.0 %",
        "stopped: 20.0 %",
        "pending: 1 of 6",
        "gait",
    ]
    # Where the cycle is not known it is not said.
    assert legend_of(basin(CODES, X, Y, **AXES).axes[0])[0] == "walking: 60.0 %"


def test_rare_labels_are_not_rounded_away():
    rare = np.zeros((200, 200), dtype=int)
    rare[0, 0] = 1
    (ax,) = basin(rare, np.arange(200.0), np.arange(200.0), **AXES).axes
    assert legend_of(ax) == ["walking: > 99.99 %", "fell forward: < 0.01 %"]
    rare[0, :20] = 1
    (ax,) = basin(rare, np.arange(200.0), np.arange(200.0), **AXES).axes
    assert legend_of(ax) == ["walking: 99.95 %", "fell forward: 0.05 %"]
    rare[0, :] = 1
    (ax,) = basin(rare, np.arange(200.0), np.arange(200.0), **AXES).axes
    assert legend_of(ax) == ["walking: 99.5 %", "fell forward: 0.5 %"]


def test_pending_cells_are_hatched_and_the_gait_is_marked():
    (ax,) = basin(CODES, X, Y, mark=(1.5, 0.5), **AXES).axes
    (hatched,) = [one for one in ax.collections if one.get_hatch()]
    (box,) = [path.get_extents().bounds for path in hatched.get_paths()]
    np.testing.assert_allclose(box, (1.5, 0.0, 1.0, 2.0))
    (star,) = [line for line in ax.lines if line.get_marker() == "*"]
    np.testing.assert_array_equal(star.get_xydata(), [[1.5, 0.5]])
    whole = basin(np.zeros((2, 3), int), X, Y, **AXES).axes[0]
    assert not [one for one in whole.collections if one.get_hatch()]


def test_a_label_has_one_colour_everywhere_and_no_other_has_it():
    names = [str(label) for label in jb.basins.Label if label != jb.basins.Label.WALKING]
    names += [jb.basins.label_name(jb.basins.Label.WALKING, cycle) for cycle in range(1, 7)]
    assert len({label_colour(name) for name in names}) == len(names)
    assert len({(label_colour(name), label_marker(name)) for name in names}) == len(names)
    alone = basin(np.full((1, 2), "stopped"), [0.0, 1.0], [0.0, 1.0], **AXES).axes[0]
    assert set(_colours(alone.figure).flat) == {label_colour("stopped")}


def test_gaits_of_one_period_have_shades_of_their_own():
    gait = np.array([[0, 1, 0], [0, 0, 2]])
    (ax,) = basin(CODES, X, Y, cycle_footsteps=1, gait=gait, **AXES).axes
    colours = _colours(ax.figure)
    assert len({colours[0, 0], colours[0, 1], colours[1, 2]}) == 3
    assert legend_of(ax)[:3] == [f"walking period-1, gait {k}: 20.0 %" for k in range(3)]
    assert colours[0, 2] == label_colour("fell forward")


def test_all_labels_at_once_and_nothing_is_cut_off():
    labels = np.arange(-1, 10)[:, None] * np.ones((1, 12), dtype=int)
    cycle = np.tile(np.arange(1, 7), (11, 2))
    figure = basin(
        labels, np.arange(12.0), np.arange(11.0), cycle_footsteps=cycle, mark=(0, 9), **AXES
    )
    assert isinstance(figure, Figure)
    assert len(legend_of(figure.axes[0])) == 10 + 6 + 1
    _nothing_is_cut_off(figure)
    names = [
        jb.basins.label_name(label, k) for label, k in zip(labels.flat, cycle.flat, strict=True)
    ]
    known = labels.ravel() >= 0
    expected = np.where(known, [label_colour(name) for name in names], "")
    np.testing.assert_array_equal(_colours(figure).ravel()[known], expected[known])


def _disc(points):
    return np.where(np.hypot(*points.T) < 0.6, 0, 1)


def test_refined_cells_are_drawn_where_they_are():
    refined = jb.basins.refine_boundary(_disc, (-1.0, -1.0), (1.0, 2.0), (4, 6), levels=3)
    figure = refined_basin(refined, mark=(0.0, 0.0), **AXES)
    (ax,) = figure.axes
    outlines = [one for one in ax.collections if isinstance(one, PolyCollection)]
    outlines = [one for one in outlines if not isinstance(one, QuadMesh)]
    assert [len(one.get_paths()) for one in outlines] == [len(c) for c in refined.cells[:3]]
    first = outlines[1].get_paths()[0].get_extents()
    np.testing.assert_allclose(first.p0, refined.lower + refined.cells[1][0] * 0.25)
    np.testing.assert_allclose(first.size, 0.25)
    expected = np.where(refined.on_grid().T == 0, label_colour("walking"), "#D55E00")
    np.testing.assert_array_equal(_colours(ax.figure), expected)
    assert ax.get_title(loc="left") == f"{refined.asked} labels of the full grid's {33 * 49}"
    assert (ax.get_xlim(), ax.get_ylim()) == ((-1.0, 1.0), (-1.0, 2.0))
    assert legend_of(ax)[-2:] == ["halved cells", "gait"]
    _nothing_is_cut_off(figure)


def test_refined_labels_may_have_names_of_their_own():
    refined = jb.basins.refine_boundary(_disc, (-1.0, -1.0), (1.0, 1.0), (4, 4), levels=2)
    names = {0: "walking period-3", 1: "stopped"}
    (ax,) = refined_basin(refined, codes=names, cells=False, **AXES).axes
    assert set(_colours(ax.figure).flat) == {label_colour(name) for name in names.values()}
    assert [text.split(":")[0] for text in legend_of(ax)] == list(names.values())
    with pytest.raises(jb.ArgumentError, match="codes has no name for label 1"):
        refined_basin(refined, codes={0: "walking"}, **AXES)


def _fractions():
    walks, falls = ["walking period-1"] * 30, ["fell forward"] * 10
    return [jb.basins.fractions(names) for names in (falls, walks + falls, [*walks, "stopped"])]


def test_fractions_along_a_parameter_lie_in_wilsons_bands():
    figure = basin_fractions([1.0, 10.0, 1e3], _fractions(), name="K", unit="N/m", log=True)
    (ax,) = figure.axes
    lines = {line.get_label(): line.get_ydata() for line in ax.lines}
    assert list(lines) == ["walking period-1", "fell forward", "stopped"]
    np.testing.assert_allclose(lines["walking period-1"], [0.0, 0.75, 30 / 31])
    np.testing.assert_allclose(lines["stopped"], [0.0, 0.0, 1 / 31])
    low, high = jb.basins.wilson_interval([0, 30, 30], [10, 40, 31])
    corners = ax.collections[0].get_paths()[0].vertices
    for x, a, b in zip((1.0, 10.0, 1e3), low, high, strict=True):
        at = corners[corners[:, 0] == x, 1]
        assert (at.min(), at.max()) == (pytest.approx(a), pytest.approx(b))
    assert ax.get_xscale() == "log"
    assert ax.get_xlabel() == "K (N/m)"
    assert "95 % confidence" in ax.get_title(loc="left")
    _nothing_is_cut_off(figure)


def test_stacked_fractions_add_up_to_one():
    figure = basin_fractions([1.0, 2.0, 3.0], _fractions(), name="slope", kind="stacked")
    (ax,) = figure.axes
    assert ax.get_xlabel() == r"slope, $\alpha$ (rad)"
    top = ax.collections[-1].get_paths()[0].vertices
    for x in (1.0, 2.0, 3.0):
        assert top[top[:, 0] == x, 1].max() == pytest.approx(1.0)
    assert legend_of(ax) == ["stopped", "fell forward", "walking period-1"]
    _nothing_is_cut_off(figure)
    # What walks is the lowest band, what falls lies on it.
    tops_of_bands = [[0.0, 0.75, 30 / 31], [1.0, 1.0, 30 / 31], [1.0, 1.0, 1.0]]
    for band, tops in zip(ax.collections, tops_of_bands, strict=True):
        corners = band.get_paths()[0].vertices
        drawn = [corners[corners[:, 0] == x, 1].max() for x in (1.0, 2.0, 3.0)]
        np.testing.assert_allclose(drawn, tops, atol=1e-12)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: basin(np.zeros((0, 3), int), X, Y, **AXES), ("labels", "(0, 3)")),
        (lambda: basin([0, 1], X, Y, **AXES), ("labels", "(2,)", "(ny, nx)")),
        (lambda: basin([[0, 99]], X, Y, **AXES), ("labels", "99", "Label")),
        (lambda: basin(CODES, Y, X, **AXES), ("x", "(2,)", "(3,)", "(4,)")),
        (lambda: basin(CODES, X[::-1], Y, **AXES), ("x", "increase")),
        (lambda: basin(CODES, [1.0, 3.0, 2.0], Y, **AXES), ("x", "increase")),
        (lambda: basin(CODES, X, **AXES), ("x, y and names are needed",)),
        (lambda: basin(CODES, X, [0.0, np.nan], **AXES), ("y", "nan", "finite")),
        (lambda: basin(CODES[:1], X, [0.0], **AXES), ("y", "one centre", "edges")),
        (
            lambda: basin(CODES, X, Y, cycle_footsteps=[1, 2], **AXES),
            ("cycle_footsteps", "(2,)", "(2, 3)"),
        ),
        (lambda: basin(CODES, X, Y, gait=[1, 2], **AXES), ("gait", "(2,)", "(2, 3)")),
        (lambda: basin(CODES, X, Y, mark=(1.0,), **AXES), ("mark", "two numbers")),
        (lambda: refined_basin(CODES, **AXES), ("boundary", "RefinedBoundary")),
        (lambda: basin_fractions([1.0], _fractions(), name="K"), ("values", "(1,)", "3")),
        (lambda: basin_fractions([], [], name="K"), ("values", "(0,)", "at least one")),
        (lambda: basin_fractions([1, 3, 2], _fractions(), name="K"), ("values", "increase")),
        (lambda: basin_fractions([0, 1, 2], _fractions(), name="K", log=True), ("values", "0")),
        (lambda: basin_fractions([1.0], [{}], name="K"), ("fractions[0]", "empty")),
        (lambda: basin_fractions([1, 2, 3], _fractions(), name="K", kind="pie"), ("kind", "pie")),
        (
            lambda: basin_fractions([1], _fractions()[:1], name="K", kind="stacked"),
            ("values", "stacked", "at least 2"),
        ),
    ],
)
def test_bad_arguments_are_named(call, words):
    with pytest.raises(jb.ArgumentError) as caught:
        call()
    assert all(word in str(caught.value) for word in words)


def test_a_boundary_of_three_dimensions_is_refused():
    refined = jb.basins.refine_boundary(
        lambda points: (points[:, 0] > 0.1).astype(int), (-1,) * 3, (1,) * 3, (2,) * 3, levels=1
    )
    with pytest.raises(jb.ArgumentError, match="3 dimensions"):
        refined_basin(refined, **AXES)


@pytest.mark.parametrize("shape", [(3, 3), (3, 4)])
def test_labelled_labels_are_drawn_along_their_own_axes(shape):
    """Against the same grid as a plain array, which is (ny, nx)."""
    codes = np.arange(np.prod(shape)).reshape(shape) % 5
    axes = {"omega_swing": np.arange(shape[0]) + 0.0, "theta_swing": np.arange(shape[1]) + 0.0}
    fields = {name: (tuple(axes), codes) for name in ("label", "gait", "cycle_footsteps")}
    data = xarray.Dataset(fields, axes)
    x, y = axes.values()
    plain = _colours(basin(codes.T, x, y, names=tuple(axes)))
    of_array = basin(data.label, data.omega_swing, data.theta_swing, names=tuple(axes))
    np.testing.assert_array_equal(_colours(of_array), plain)
    np.testing.assert_array_equal(_colours(basin(data.label)), plain)
    turned = _colours(basin(data.label, names=("theta_swing", "omega_swing")))
    np.testing.assert_array_equal(turned, _colours(basin(codes, y, x, names=tuple(axes)[::-1])))
    whole = basin(data).axes[0]
    assert (whole.get_xlim(), whole.get_ylim()) == ((-0.5, shape[0] - 0.5), (-0.5, shape[1] - 0.5))
    with pytest.raises(jb.ArgumentError, match="x, y and names are needed"):
        basin(codes)
