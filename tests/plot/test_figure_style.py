"""Styles and files of figures, against the sizes of pages, fonts in files and points in paths."""

import re

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

import jaxbiped as jb
from jaxbiped import plot
from jaxbiped.plot import style
from tests.drawn import assert_is_drawn, assert_ticks_apart

WIDTHS = {1: 3.4, 2: 7.0}


def _law():
    return plot.friction_law(jb.seed_scene().friction)


def _media_box(path):
    return [float(x) for x in re.search(rb"/MediaBox \[(.+?)\]", path.read_bytes())[1].split()]


@pytest.mark.parametrize("columns", [1, 2])
def test_files_are_as_wide_as_the_columns_of_a_paper(columns, tmp_path):
    with plot.figure_style("paper", columns=columns):
        figure = _law()
    paths = plot.save_figure(figure, tmp_path / "law", formats=plot.FIGURE_FORMATS)
    assert [path.name for path in paths] == ["law.png", "law.pdf", "law.svg"]
    assert _media_box(paths[1])[2] == pytest.approx(72.0 * WIDTHS[columns])
    with Image.open(paths[0]) as image:
        assert image.width == pytest.approx(300.0 * WIDTHS[columns], abs=1)
    width = re.search(r'width="([\d.]+)pt"', paths[2].read_text())[1]
    assert float(width) == pytest.approx(72.0 * WIDTHS[columns])


@pytest.mark.parametrize("save", ["save_figure", "savefig"])
def test_fonts_are_embedded_as_truetype(save, tmp_path):
    figure, path = _law(), tmp_path / "law.pdf"
    if save == "savefig":
        figure.savefig(path)
    else:
        plot.save_figure(figure, path)
    written = path.read_bytes()
    fonts = re.findall(rb"/Type /Font\b.*?>>", written, re.DOTALL)
    assert any(b"/CIDFontType2" in font for font in fonts)
    assert b"/FontFile2" in written
    assert b"/Type3" not in written


def test_letters_of_an_svg_are_curves(tmp_path):
    (path,) = plot.save_figure(_law(), tmp_path / "law.svg")
    written = path.read_text()
    assert "<text" not in written
    assert 'id="DejaVuSans' in written


@pytest.mark.parametrize("form", plot.FIGURE_FORMATS)
def test_the_same_figure_makes_the_same_file(form, tmp_path):
    first, second = (
        plot.save_figure(_law(), tmp_path / name, formats=[form])[0] for name in ("a", "b")
    )
    assert first.read_bytes() == second.read_bytes()


def test_endings_tell_formats_and_others_belong_to_the_name(tmp_path):
    figure = Figure()
    figure.add_subplot()
    for name, formats, written in (
        ("a.svg", None, ["a.svg"]),
        ("slope_0.02", None, ["slope_0.02.png"]),
        ("slope_0.02", ["pdf", "svg"], ["slope_0.02.pdf", "slope_0.02.svg"]),
        ("a.PDF", ["png"], ["a.png"]),
        ("b", "pdf", ["b.pdf"]),
    ):
        paths = plot.save_figure(figure, tmp_path / name, formats=formats)
        assert [path.name for path in paths] == written
        assert all(path.stat().st_size > 0 for path in paths)


def test_a_papers_letters_have_eight_points_also_of_ticks_made_as_it_is_drawn():
    with plot.figure_style("paper"):
        figure = _law()
    figure.canvas.draw()
    (ax,) = figure.axes
    labels = [*ax.get_xticklabels(), *ax.get_yticklabels(), ax.xaxis.label, ax.yaxis.label]
    assert {label.get_fontsize() for label in labels} == {8.0}
    assert {spine.get_linewidth() for spine in ax.spines.values()} == {0.6}
    for axis in (ax.xaxis, ax.yaxis):
        axis.minorticks_on()
        for ticks, width in ((axis.get_major_ticks(), 0.6), (axis.get_minor_ticks(), 0.4)):
            assert {tick.tick1line.get_markeredgewidth() for tick in ticks} <= {width}
    assert ax.get_title(loc="left") == ""
    assert _law().axes[0].get_title(loc="left") == "Bengisu and Akay"
    assert _law().get_figwidth() == 6.4


@pytest.mark.parametrize("columns", [1, 2])
def test_figures_made_by_hand_have_the_style_of_a_paper(columns, tmp_path):
    with plot.figure_style("paper", columns=columns):
        figure, ax = plt.subplots()
        ax.plot([0.0, 1.0], [1000.0, 2000.0])
        ax.set_ylabel("a label (m)")
        ax.set_xlabel("another one (s)")
        figure.savefig(tmp_path / "by_hand.pdf")
        figure.savefig(tmp_path / "by_hand.png")
    plt.close(figure)
    assert figure.get_figwidth() == WIDTHS[columns]
    assert ax.xaxis.label.get_fontsize() == 8.0
    FigureCanvasAgg(figure)
    assert_fits(figure)
    written = (tmp_path / "by_hand.pdf").read_bytes()
    assert b"/CIDFontType2" in written
    assert b"/Type3" not in written
    with Image.open(tmp_path / "by_hand.png") as image:
        assert image.width == pytest.approx(300.0 * WIDTHS[columns], abs=1)
    assert plt.rcParams["figure.figsize"] == plt.rcParamsDefault["figure.figsize"]


def test_samples_of_a_legend_show_all_dashes_of_each_line():
    """The torso's dash and dot looked like a line of one dash."""
    for name in ("screen", "paper"):
        with plot.figure_style(name):
            ax = style.new_figure().add_subplot()
            for k in range(6):
                ax.plot([0.0, 1.0], label=str(k), linewidth=2.0, **style.line_of(k))
            for draw in (style.legend, lambda own: style.legend_of_figure(own.figure, own.lines)):
                draw(ax)
        for legend in (ax.get_legend(), *ax.figure.legends):
            for line in legend.get_lines():
                length = np.ptp(line.get_xdata())
                assert length > 1.2 * sum(line._dash_pattern[1] or (0.0,))


def test_small_letters_leave_room_for_more_entries_above_the_axes():
    """Four entries of twenty letters need 6.8 inches at ten points and 5.4 at eight."""
    for name, above in (("screen", False), ("paper", True)):
        with plot.figure_style(name, columns=2):
            ax = style.axes_or_new(None, 7.0, 3.0)
            for letter in "abcd":
                ax.plot([0.0, 1.0], label=20 * letter)
            style.legend_above(ax)
            ax.figure.draw_without_rendering()
        legend, axes = ax.get_legend().get_window_extent(), ax.get_window_extent()
        assert bool(legend.y0 > axes.y1) is above


@pytest.mark.parametrize(("title", "above"), [("", True), (30 * "t", False)])
def test_a_long_title_leaves_no_room_for_entries_beside_it(title, above):
    """Four entries of ten letters need 4.4 inches, thirty letters of a title 2, of 6."""
    ax = style.axes_or_new(None, 7.0, 3.0)
    for letter in "abcd":
        ax.plot([0.0, 1.0], label=10 * letter)
    style.set_title(ax, title)
    style.legend_above(ax)
    ax.figure.draw_without_rendering()
    legend, axes = ax.get_legend().get_window_extent(), ax.get_window_extent()
    assert bool(legend.y0 > axes.y1) is above


@pytest.mark.parametrize("kind", ["screen", "paper"])
@pytest.mark.parametrize("v0", [2e-5, 4e-5, 1e-4])
def test_marks_of_slip_speeds_are_apart(kind, v0):
    with plot.figure_style(kind):
        figure = plot.friction_law(jb.seed_scene(v0=v0).friction)
    assert_ticks_apart(figure)


def test_figures_below_the_context_have_their_own_style_again():
    with plot.figure_style("paper"):
        with plot.figure_style("paper", columns=2):
            assert _law().get_figwidth() == 7.0
        assert _law().get_figwidth() == 3.4
    assert _law().get_figwidth() == 6.4


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: plot.figure_style("poster").__enter__(), "style = 'poster' is not known"),
        (lambda: plot.figure_style("paper", columns=3).__enter__(), "columns = 3"),
        (lambda: plot.save_figure(Figure(), "a", formats=["eps"]), "formats = 'eps' is not known"),
        (lambda: plot.save_figure(Figure(), "a.jpg"), "formats = 'jpg' is not known"),
        (lambda: plot.save_figure(Figure(), "/nowhere/a"), "cannot be written"),
    ],
)
def test_bad_arguments_are_named(call, words):
    with pytest.raises(jb.ArgumentError, match=words):
        call()


def _channels(colour):
    return np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0


def _luma(colour):
    """Grey, in per cent, that programs make of a colour when they drop it."""
    return 100.0 * float(_channels(colour) @ [0.299, 0.587, 0.114])


def _lightness(colour):
    """CIE's L* of a colour in print without colour."""
    channels = _channels(colour)
    linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
    light = float(linear @ [0.2126, 0.7152, 0.0722])
    return 116.0 * np.cbrt(light) - 16.0 if light > 0.008856 else 903.3 * light


def test_labels_of_basins_differ_in_lightness_and_further_gaits_in_pattern():
    names = [str(label) for label in jb.basins.Label]
    for grey, least in ((_lightness, 4.0), (_luma, 2.5)):
        shades = sorted(grey(style.label_colour(name)) for name in names)
        assert min(np.diff(shades)) > least
    walks = [jb.basins.label_name(jb.basins.Label.WALKING, k) for k in range(1, 7)]
    assert len({style.walking_pattern(name) for name in walks}) == 6
    assert {style.walking_pattern(name) for name in names} == {""}


def test_lines_and_markers_hold_without_colour():
    lines = [str(style.line_of(k)["linestyle"]) for k in range(6)]
    assert len(set(lines)) == 6
    assert len({style.marker_of(k) for k in range(7)}) == 7
    assert len({(style.marker_of(k), style.colour_of(k)) for k in range(49)}) == 49


def test_no_peak_of_a_force_is_thinned_away_in_a_file(seed_walk, tmp_path):
    """Against the largest force of a recording right to 1e-5, in the path that the SVG holds."""
    scene, walk = seed_walk
    t = np.linspace(0.0, 2.0, 20_001)
    fine = jb.simulate(scene, jb.seed_state(), duration=2.0, accuracy="tight", save=t)
    forces = jb.dynamics.foot_forces(scene, fine.state)
    with plot.figure_style("paper"):
        figure = plot.contact_forces(scene, walk)
    (path,) = plot.save_figure(figure, tmp_path / "forces.svg")
    ax = figure.axes[0]
    height = 72.0 * figure.get_figheight()
    points = np.concatenate([
        np.array(re.findall(r"[ML] (\S+) (\S+)", d), float)
        for d in re.findall(r'<path d="([^"]*)" clip-path=[^>]*stroke-(?:dasharray|linecap)',
                            path.read_text())
    ])  # fmt: skip
    for foot in (1, 2):
        force = np.asarray(forces[foot - 1].normal)
        peak = (t[np.argmax(force)], np.max(force))
        x, y = ax.transData.transform(peak) * 72.0 / figure.dpi
        assert np.min(np.hypot(*(points - (x, height - y)).T)) < 0.2


@pytest.mark.parametrize("columns", [1, 2])
def test_nothing_of_a_walks_figures_is_cut_off_in_a_paper(columns, seed_walk):
    scene, walk = seed_walk
    draws = [
        plot.gait_strobe, plot.phase_portrait, plot.leg_angles, plot.penetrations,
        plot.contact_forces,
    ]  # fmt: skip
    for draw in draws:
        with plot.figure_style("paper", columns=columns):
            figure = draw(scene, walk)
        assert_is_drawn(figure)
        assert_fits(figure)


def assert_fits(figure):
    """All axes with their labels and legends lie on the page, and no two axes' overlap."""
    figure.canvas.draw()
    renderer = figure.canvas.get_renderer()
    boxes = [ax.get_tightbbox(renderer) for ax in figure.axes if ax.get_visible()]
    page = figure.bbox
    for box in boxes:
        assert box.x0 >= page.x0 - 1.0
        assert box.y0 >= page.y0 - 1.0
        assert box.x1 <= page.x1 + 1.0
        assert box.y1 <= page.y1 + 1.0
    for k, box in enumerate(boxes):
        for other in boxes[k + 1 :]:
            across = min(box.x1, other.x1) - max(box.x0, other.x0)
            up = min(box.y1, other.y1) - max(box.y0, other.y0)
            assert min(across, up) < 1.0


def test_axes_of_equal_scales_leave_room_for_their_title_in_the_file(tmp_path):
    figure = style.new_figure(8.0, 4.2)
    left, right = figure.subplots(1, 2)
    for k in range(4):
        left.plot([0.0, 1.0], label=f"shank_{k}")
    style.dress(left, "left", "x", "y")
    style.legend_below(left, columns=4)  # wider than its axes, which the layout makes room for
    right.set_aspect("equal")
    style.dress(right, "a title\nof two lines", "x", "y")
    figure.savefig(tmp_path / "both.png")
    top = right.get_tightbbox(figure.canvas.get_renderer()).y1
    assert top <= figure.bbox.y1


@pytest.mark.parametrize(("columns", "below"), [(1, True), (2, False)])
def test_a_legend_stands_beside_the_axes_or_below_them_in_one_column_of_a_paper(columns, below):
    with plot.figure_style("paper", columns=columns):
        ax = style.axes_or_new(None, 7.0, 3.0)
        for name in ("walking", "fallen"):
            ax.plot([0.0, 1.0], [0.0, 1.0], label=name)
        style.legend_right(ax)
        figure = style.figure_of(ax)
        figure.draw_without_rendering()
    entries, frame = ax.get_legend().get_window_extent(), ax.get_window_extent()
    assert bool(entries.y1 < frame.y0) is below
    assert bool(entries.x0 > frame.x1) is not below
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["walking", "fallen"]


def test_a_figure_of_the_usual_size_lies_on_its_side():
    """Three to four parts wide where it is two high, as a screen is, and half a page."""
    width, height = style.new_figure().get_size_inches()
    assert 1.5 <= width / height <= 2.0
