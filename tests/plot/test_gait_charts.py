"""Figures of a periodic gait, against one made by hand: nothing is compiled."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle

import jaxbiped as jb
from jaxbiped.plot import elasticities, gait_orbit, multipliers
from tests.drawn import assert_is_drawn, assert_ticks_apart, points_of
from tests.plot.test_figure_style import assert_fits
from tests.plot.test_parameter_charts import branch_point, make_branch

PARAMETERS = ("K", "c", "l", "hip_mass")
FIGURES = [multipliers, elasticities, gait_orbit]


def _measures(shape=()):
    ones = np.ones(shape)
    return jb.gait.Measures(*([ones] * 5), jb.State(*([ones] * 8)))


def _orbit(passes, m=200):
    """Legs half a turn apart on the unit circle, exchanged at each pass; NaN at the end."""
    angle = np.linspace(0.0, np.pi, m)
    zero = np.zeros((passes, m))
    states = jb.State(
        zero, zero, zero + np.cos(angle), zero - np.cos(angle), zero, zero,
        zero + np.sin(angle), zero - np.sin(angle),
    )  # fmt: skip
    pad = lambda leaf: np.pad(leaf, ((0, 0), (0, 3)), constant_values=np.nan)
    return pad(zero + np.linspace(0.0, 0.4, m)), jb.State(*map(pad, states))


def _gait(*, passes=1, values=(0.35 + 0.29j, 0.35 - 0.29j, 0.42, 3e-4, 0, 0), **changes):
    values = np.asarray(values, dtype=complex)
    state = jb.State(*(np.asarray(x) for x in (0.0, 0.4, 1.0, -1.0, 0.3, 0.0, 0.0, 0.0)))
    largest = np.asarray([0.0065, -0.2, 0.5, 0.0])
    # All parameters but the last one, which is zero, are 4; all measures 1.
    sizes = np.asarray([4.0, 4.0, 4.0, 1.0])
    elasticities = _measures((4,))._replace(
        period=largest, peak_normal=np.asarray([np.nan, 1e-9, -2.0, 0.0])
    )
    slopes = jb.gait.Measures(*(each / sizes for each in elasticities[:5]), state=None)
    errors = [np.full(4, 1e-6)] * 5
    errors[0] = np.asarray([1e-3, 2e-3, 0.0, 0.0])
    slope_errors = jb.gait.Measures(*errors, state=None)
    known = {
        "ending": np.asarray(0),
        "measures": _measures()._replace(spectral_radius=np.max(np.abs(values)), state=state),
        "multipliers": values,
        "multiplier_errors": np.full(6, 1e-4),
        "bifurcation": np.asarray(0),
        "elasticities": elasticities,
        "sensitivities": slopes,
        "sensitivity_errors": slope_errors,
        "measure_errors": jb.gait.Measures(*[np.asarray(1e-2)] * 5, state=None),
        "orbit": _orbit(passes),
        "origin": SimpleNamespace(nearest=jb.seed_scene()),
        "parameters": PARAMETERS,
        "quantities": (),
    }
    nothing = dict.fromkeys(field.name for field in dataclasses.fields(jb.Gait))
    return jb.Gait(**(nothing | known | changes))


def test_multipliers_and_the_unit_circle():
    figure = multipliers(_gait())
    (ax,) = figure.axes
    points = next(line for line in ax.lines if line.get_label() == "multipliers")
    assert next(zip(*points.get_data(), strict=True)) == (0.35, 0.29)
    (circle,) = [patch for patch in ax.patches if isinstance(patch, Circle)]
    assert circle.radius == 1.0
    assert circle.center == (0.0, 0.0)
    assert "0.4545" in ax.get_title(loc="left")
    assert ax.get_title(loc="left").endswith("\nstable")
    texts = [text.get_text() for text in ax.texts]
    assert "0.350 ± 0.290 i" in texts
    assert any(text.startswith("3 near 0") for text in texts)


@pytest.mark.parametrize("largest", [0.5, 1.6])
def test_the_plane_of_multipliers_has_both_axes_and_equal_scales(largest):
    (ax,) = multipliers(_gait(values=(largest, 0, 0, 0, 0, 0), multiplier_errors=np.zeros(6))).axes
    across = {tuple(line.get_ydata()) for line in ax.lines if tuple(line.get_xdata()) == (0, 1)}
    up = {tuple(line.get_xdata()) for line in ax.lines if tuple(line.get_ydata()) == (0, 1)}
    assert across == up == {(0.0, 0.0)}
    assert ax.get_aspect() == 1.0
    # The circle and all dots, and no more round them than names need.
    assert ax.get_xlim() == ax.get_ylim() == (-ax.get_xlim()[1], ax.get_xlim()[1])
    assert 1.05 < ax.get_xlim()[1] / max(largest, 1.0) < 1.3
    assert ("Re" in ax.get_xlabel(), "Im" in ax.get_ylabel()) == (True, True)
    assert not any(ax.spines[side].get_visible() for side in ("top", "right"))


def test_an_unstable_gait_stays_inside_the_frame_and_names_its_bifurcation():
    errors = np.asarray([0.1, 1e-4, 1e-4, 1e-4, 1e-4, 1e-4])
    values = (-1.6, 0.4, 0.1, 0.0, 0.0, 0.0)
    gait = _gait(values=values, multiplier_errors=errors, bifurcation=np.asarray(2))
    (ax,) = multipliers(gait).axes
    assert "not stable" in ax.get_title(loc="left")
    assert "period doubling" in ax.get_title(loc="left")
    assert ax.get_xlim()[0] < -1.7
    discs = [patch.radius for patch in ax.patches]
    assert discs == [1.0, 0.1]
    (across, up) = _segments_of_bars(ax)
    np.testing.assert_allclose(across[0], [[-1.7, 0.0], [-1.5, 0.0]])
    np.testing.assert_allclose(up[0], [[-1.6, -0.1], [-1.6, 0.1]])


@pytest.mark.parametrize("style", ["screen", "paper"])
def test_names_of_multipliers_cover_no_dot(style):
    """Found by a walker with unequal feet: a name lay on the dot below it."""
    values = (-0.131 + 0.148j, -0.131 - 0.148j, -5.6e-4, 3.7e-7, 0.0, 0.0)
    with jb.plot.figure_style(style):
        figure = multipliers(_gait(values=values))
        figure.draw_without_rendering()
        (ax,) = figure.axes
        dots = ax.transData.transform([(each.real, each.imag) for each in map(complex, values)])
        for text in (each for each in ax.texts if "error" not in each.get_text()):
            box = text.get_window_extent()
            assert not any(box.contains(*dot) for dot in dots), text.get_text()


def test_errors_that_are_not_known_are_said_and_names_stay_in_the_axes():
    """A NaN was said to lie within the dots; a far multiplier's name left the figure."""
    values = (40 + 3j, 40 - 3j, -2.0, 0.5, 0.0, 0.0)
    figure = multipliers(_gait(values=values, multiplier_errors=np.full(6, np.nan)))
    figure.draw_without_rendering()
    (ax,) = figure.axes
    assert "not all errors are known" in [text.get_text() for text in ax.texts]
    (name,) = [text for text in ax.texts if "40.000" in text.get_text()]
    assert name.get_window_extent().x1 < ax.get_window_extent().x1


@pytest.mark.parametrize("draw", [*FIGURES, jb.plot.fit, jb.plot.optimisation, jb.plot.branch])
def test_another_result_is_refused_in_one_sentence(draw):
    with pytest.raises(jb.ArgumentError, match=r"is not allowed: it must be an? "):
        draw(jb.seed_scene())
    with pytest.raises(jb.ArgumentError, match=r"must be a Gait or a BranchPoint or a Branch\.$"):
        multipliers(3)


def test_multipliers_of_a_branchs_point():
    point = branch_point(0.02, -1.6, error=0.1)
    (ax,) = multipliers(point).axes
    assert points_of(ax, "multipliers")[0][0] == pytest.approx((-1.6, 0.0))
    assert "not stable" in ax.get_title(loc="left")
    assert "undecided" in multipliers(branch_point(0.02, 0.95, error=0.1)).axes[0].get_title("left")


@pytest.mark.parametrize("columns", [0, 1, 2])
def test_multipliers_along_a_branch_are_paths(columns):
    """Of a pair that meets on the real axis and parts there, and of a real one that stays."""
    values = np.array([
        [0.5j, -0.5j, 0.1], [-0.4 + 0.3j, -0.4 - 0.3j, 0.1], [-0.8, 0.1, -0.3], [-1.2, -0.2, 0.1]
    ])  # fmt: skip
    slopes = [0.02, 0.04, 0.06, 0.08]
    points = [
        branch_point(slope, 0.0)._replace(multipliers=row.astype(complex))
        for slope, row in zip(slopes, values, strict=True)
    ]
    kind = jb.continuation.BranchEvent.PERIOD_DOUBLING
    event = jb.continuation.BifurcationPoint(kind, points[3], -1.0 + 0j, 1e-9)
    with jb.plot.figure_style("paper" if columns else "screen", columns=columns or 1):
        figure = multipliers(make_branch(points, [event]))
    assert_is_drawn(figure)
    assert_fits(figure)
    assert_ticks_apart(figure)
    ax, bar = figure.axes
    assert r"slope, $\alpha$ (rad)" in (bar.get_ylabel(), bar.get_xlabel())
    lines = [each for each in ax.collections if isinstance(each, LineCollection)]
    ends = sorted(tuple(each.get_segments()[-1][-1]) for each in lines)
    assert ends == [(-1.2, 0.0), (-0.2, 0.0), (0.1, 0.0)]
    for each in lines:
        np.testing.assert_allclose(each.get_array(), [0.03, 0.05, 0.07])
        stays = tuple(each.get_segments()[0][0]) == (0.1, 0.0)
        assert stays == (tuple(each.get_segments()[-1][-1]) == (0.1, 0.0))
    starts = points_of(ax, "start")[0]
    np.testing.assert_allclose(sorted(map(tuple, starts)), [(0.0, -0.5), (0.0, 0.5), (0.1, 0.0)])
    assert points_of(ax, "period doubling")[0][0] == pytest.approx((-1.0, 0.0))
    assert points_of(ax, "end")[0].shape == (3, 2)
    with pytest.raises(jb.ArgumentError, match="branch without points"):
        multipliers(make_branch([]))


@pytest.mark.parametrize("columns", [0, 1, 2])
def test_ticks_of_elasticities_with_long_names_are_apart(columns):
    """Three panels abreast beside names of five links wrote −1 over −0.01."""
    names = tuple(f"{name}, shank.stop of the second leg" for name in PARAMETERS)
    quantities = tuple(jb.laws.Quantity(name) for name in names)
    with jb.plot.figure_style("paper" if columns else "screen", columns=columns or 1):
        figure = elasticities(_gait(quantities=quantities), ("period", "speed", "step_length"))
    assert_ticks_apart(figure)
    ax = figure.axes[0]
    assert [text.get_text() for text in ax.get_xticklabels()][:3][0] == "0"


def _segments_of_bars(ax):
    """Ends of the error bars, shape (n, 2, 2), by the direction that they lie in."""
    return [np.asarray(bars.get_segments()) for bars in ax.containers[0].lines[2]]


def test_bars_of_elasticities_are_the_sensitivities_and_the_measures_errors():
    """Against the rule for quotients: 4 δS/m + |E| δm/m."""
    (ax,) = elasticities(_gait(), "period").axes
    (bars,) = ax.containers[0].lines[2] if hasattr(ax.containers[0], "lines") else (None,)
    ends = np.asarray(bars.get_segments())[:, :, 0]
    np.testing.assert_allclose(ends[0], [0.5 - 0.5e-2, 0.5 + 0.5e-2])
    np.testing.assert_allclose(ends[1], [-0.2 - 1e-2, -0.2 + 1e-2])
    half = 0.5 * np.ptp(ends, axis=1)
    np.testing.assert_allclose(half, [0.5e-2, 8e-3 + 0.2e-2, 4e-3 + 0.0065e-2, 0.0], atol=1e-15)
    (bars,) = elasticities(_gait(), "peak_normal").axes[0].containers[0].lines[2]
    assert [len(ends) for ends in bars.get_segments()] == [2, 2, 2, 0]  # one is unknown


def test_an_accuracy_asked_for_by_a_number_gives_its_own_bars():
    error = type("Error", (), {"bars": {"multipliers": np.full(6, 0.2)}})
    (ax,) = multipliers(_gait(error=error)).axes
    assert _segments_of_bars(ax)[0][0] == pytest.approx(np.array([[0.15, 0.29], [0.55, 0.29]]))


def test_one_measure_is_drawn_into_given_axes():
    ax = Figure().add_subplot()
    assert elasticities(_gait(), "speed", ax=ax) is ax.figure
    assert ax.get_title(loc="left") == "speed"
    with pytest.raises(jb.ArgumentError, match="one measure"):
        elasticities(_gait(), ax=ax)


def test_tornado_has_the_largest_on_top_and_says_every_number():
    (ax,) = elasticities(_gait(), "period").axes
    assert [label.get_text() for label in ax.get_yticklabels()] == [
        "leg length, $l$",
        "contact damping, $c$",
        "contact stiffness, $K$",
        "hip mass, $m_S$",
    ]
    assert [bar.get_width() for bar in ax.patches] == [0.5, -0.2, 0.0065, 0.0]
    assert [text.get_text() for text in ax.texts] == ["+0.5", "−0.2", "+0.0065", "0"]
    bottom, top = ax.get_ylim()
    assert bottom > top
    assert ax.get_xlim()[1] > 0.5
    assert ax.get_xticks().max() == pytest.approx(0.1)


def test_tornado_of_all_measures_and_unknown_last():
    axes = elasticities(_gait()).axes
    titles = [ax.get_title(loc="left") for ax in axes[:5]]
    assert titles == ["period", "step length", "speed", "peak normal force", "spectral radius"]
    names = [label.get_text() for label in axes[3].get_yticklabels()]
    assert [name.rpartition(", ")[2] for name in names] == ["$l$", "$c$", "$m_S$", "$K$"]
    assert axes[3].texts[-1].get_text() == "unknown"


@pytest.mark.parametrize("name", ["K", "torso.K"])
def test_in_a_paper_symbols_stand_alone_unless_they_are_of_a_body(name):
    quantities = tuple(jb.laws.Quantity(f"word {k}", f"${k}$") for k in "Kclm")
    gait = _gait(parameters=(name, *PARAMETERS[1:]), quantities=quantities)
    with jb.plot.figure_style("paper"):
        (ax,) = elasticities(gait, "period").axes
    words = [label.get_text() for label in ax.get_yticklabels()]
    alone = ["$l$", "$c$", "$K$", "$m$"]
    assert words == (alone if name == "K" else [f"word {k[1]}, {k}" for k in alone])


def test_elasticities_that_are_all_zero_have_a_scale_all_the_same():
    zero = _measures((4,))._replace(period=np.zeros(4))
    (ax,) = elasticities(
        _gait(elasticities=zero, sensitivities=zero, sensitivity_errors=zero), "period"
    ).axes
    assert ax.get_xlim() == pytest.approx((-1e-3, 1e-3))
    assert ax.get_xticks() == pytest.approx([0.0, -1e-3, 1e-3])


def test_measures_without_a_known_elasticity_are_left_out_unless_asked_for():
    gait = _gait()
    unknown = gait.elasticities._replace(spectral_radius=np.array([np.nan, np.nan, np.nan, 0.0]))
    gait = dataclasses.replace(gait, elasticities=unknown)
    titles = [ax.get_title(loc="left") for ax in elasticities(gait).axes]
    assert "spectral radius" not in titles
    assert "speed" in titles
    (ax,) = elasticities(gait, "spectral_radius").axes
    assert [text.get_text() for text in ax.texts].count("unknown") == 3


@pytest.mark.parametrize("measure", ["hop", (), ("period", "hop")])
def test_measures_have_names(measure):
    with pytest.raises(jb.ArgumentError, match="measure"):
        elasticities(_gait(), measure)


@pytest.mark.parametrize("passes", [1, 2, 3])
def test_both_legs_make_closed_curves(passes):
    (ax,) = gait_orbit(_gait(passes=passes)).axes
    first, second = (
        np.transpose(line.get_data()) for line in ax.lines if line.get_label().startswith("leg")
    )
    assert len(first) == passes * 200
    assert np.isfinite(first).all()
    ends = (second, first) if passes % 2 else (first, second)
    np.testing.assert_allclose(first[-1], ends[0][0], atol=1e-12)
    np.testing.assert_allclose(second[-1], ends[1][0], atol=1e-12)
    jumps = np.hypot(*np.diff(first, axis=0).T)
    assert jumps.max() < 0.1


def test_orbit_marks_the_section():
    (ax,) = gait_orbit(_gait()).axes
    dots = [tuple(line.get_xydata()[0]) for line in ax.lines if line.get_marker() == "o"]
    assert dots == [(1.0, 0.0), (-1.0, 0.0)]
    assert "(rad)" in ax.get_xlabel()
    assert "(rad/s)" in ax.get_ylabel()


def test_orbit_has_arrows_the_way_time_runs():
    (ax,) = gait_orbit(_gait()).axes
    heads = [text for text in ax.texts if text.get_text() == ""]
    assert len(heads) == 8
    for head in heads:
        (x, y), (x0, y0) = head.xy, head.get_position()
        # The orbit made here runs counter-clockwise about zero.
        assert x0 * y - y0 * x > 0.0


@pytest.mark.parametrize("draw", FIGURES)
def test_figures_show_a_gait_and_what_is_none_is_refused(draw):
    figure = draw(_gait())
    assert isinstance(figure, Figure)
    assert_is_drawn(figure, unitless={"d log measure / d log parameter"})
    with pytest.raises(jb.ArgumentError, match="not converged"):
        draw(_gait(ending=np.asarray(2)))
    with pytest.raises(jb.ArgumentError, match="batch"):
        draw(_gait(ending=np.zeros(3, dtype=int)))
