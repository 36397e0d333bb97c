"""Pictures of a motion, against poses, feet and slope, and the frames that were asked for."""

import math

import numpy as np
import pytest
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.figure import Figure
from PIL import Image

import jaxbiped as jb
from jaxbiped.plot import animate, animation_html, gait_strobe, save_animation


def _drawn(figure):
    (ax,) = figure.axes
    legs = [each for each in ax.collections if isinstance(each, LineCollection)]
    feet = [each for each in ax.collections if isinstance(each, EllipseCollection)]
    segments = np.array([leg.get_segments() for leg in legs])
    return ax, segments, np.array([foot.get_offsets() for foot in feet])


@pytest.fixture(scope="module")
def strobe(seed_walk):
    return gait_strobe(*seed_walk, start=0.5, stop=1.4, count=7)


def test_legs_have_their_length_and_end_at_the_feet(strobe):
    ax, segments, feet = _drawn(strobe)
    assert isinstance(strobe, Figure)
    assert segments.shape == (2, 7, 2, 2)
    lengths = np.linalg.norm(segments[:, :, 1] - segments[:, :, 0], axis=-1)
    np.testing.assert_allclose(lengths, 0.40 - 0.08, rtol=1e-12)
    np.testing.assert_array_equal(segments[:, :, 1], feet)
    assert ax.get_aspect() == 1.0


def test_poses_are_the_trajectorys_seen_upright(seed_walk, strobe):
    _, walk = seed_walk
    _, segments, _ = _drawn(strobe)
    state = walk.at(np.linspace(0.5, 1.4, 7))
    x, z = np.asarray(state.hip_x), np.asarray(state.hip_z)
    for leg, angle in enumerate((np.asarray(state.theta_1), np.asarray(state.theta_2))):
        along = segments[leg, :, 1] - segments[leg, :, 0]
        # The leg's angle from the true vertical is its angle from the normal less the slope.
        tilt = np.arctan2(along[:, 0], -along[:, 1])
        np.testing.assert_allclose(tilt, angle - 0.02, atol=1e-12)
        hip = x * np.cos(0.02) + z * np.sin(0.02), z * np.cos(0.02) - x * np.sin(0.02)
        np.testing.assert_allclose(segments[leg, :, 0], np.stack(hip, axis=-1), atol=1e-12)


def test_the_slope_falls_and_carries_a_foot(strobe):
    ax, _, feet = _drawn(strobe)
    (slope,) = [line for line in ax.lines if hasattr(line, "get_slope")]
    assert slope.get_slope() == pytest.approx(-math.tan(0.02))
    x, z = slope.get_xy1()
    heights = (feet[..., 1] - z - slope.get_slope() * (feet[..., 0] - x)) * math.cos(0.02)
    np.testing.assert_allclose(heights.min(axis=0), 0.08, atol=1e-3)


def test_all_that_is_drawn_is_seen(strobe):
    ax, segments, feet = _drawn(strobe)
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    points = np.concatenate([segments.reshape(-1, 2), (feet - 0.08).reshape(-1, 2)])
    points = np.concatenate([points, (feet + 0.08).reshape(-1, 2)])
    assert (points > [left, bottom]).all()
    assert (points < [right, top]).all()


def test_it_fills_its_figure_and_says_which_second_it_shows(seed_walk):
    figure = gait_strobe(*seed_walk, start=0.1)
    figure.canvas.draw()
    ax, segments, feet = _drawn(figure)
    assert "from 0.10 s to 1.90 s" in ax.get_title(loc="left")
    assert segments.shape[1] == 19
    left, right = (feet[..., 0].min() - 0.08, feet[..., 0].max() + 0.08)
    shown = np.ptp(ax.get_xlim())
    assert (right - left) / shown > 0.9
    across = ax.get_window_extent().width / figure.bbox.width
    assert across > 0.85
    first, second = (each for each in ax.collections if isinstance(each, LineCollection))
    assert first.get_linestyle() != second.get_linestyle()


def test_axes_and_spans_given(seed_walk):
    ax = Figure().add_subplot()
    assert gait_strobe(*seed_walk, ax=ax, count=1) is ax.figure
    for options in ({"start": 2.0}, {"start": -0.1}, {"start": 1.0, "stop": 0.5}, {"count": 0}):
        with pytest.raises(jb.ArgumentError):
            gait_strobe(*seed_walk, **options)
    for options in ({"frames_per_second": 0}, {"slow_down": -1.0}):
        with pytest.raises(jb.ArgumentError):
            animate(*seed_walk, **options)


@pytest.fixture(scope="module")
def moving(seed_walk):
    return animate(*seed_walk, frames_per_second=10)


def test_gif_has_a_frame_for_each_tenth_of_a_second(moving, tmp_path):
    path = save_animation(moving, tmp_path / "walk.gif")
    assert path.stat().st_size < 3e6
    with Image.open(path) as image:
        assert (image.format, image.n_frames) == ("GIF", 21)
        assert image.info["duration"] == 100
        first = np.asarray(image.convert("RGB"))
        image.seek(10)
        later = np.asarray(image.convert("RGB"))
    assert (first != later).any()
    blue, vermilion = np.array([0x00, 0x72, 0xB2]), np.array([0xD5, 0x5E, 0x00])
    for colour in (blue, vermilion):
        assert (abs(later.astype(int) - colour).max(axis=-1) < 8).sum() > 100


def test_html_is_a_player(moving):
    page = animation_html(moving)
    assert "<script" in page
    assert page.count("data:image/png") == 21


def test_slow_down_stretches(seed_walk, tmp_path):
    slow = animate(*seed_walk, frames_per_second=5, slow_down=2.0)
    with Image.open(save_animation(slow, tmp_path / "slow.gif")) as image:
        assert image.n_frames == 21
        assert image.info["duration"] == 200
