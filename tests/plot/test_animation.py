"""Animations, against frames, players and slow motion that were asked for."""

import numpy as np
import pytest
from PIL import Image

import jaxbiped as jb
from jaxbiped.plot import animate, animation_html, save_animation


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


@pytest.mark.parametrize("options", [{"frames_per_second": 0}, {"slow_down": -1.0}])
def test_rates_are_positive(seed_walk, options):
    with pytest.raises(jb.ArgumentError):
        animate(*seed_walk, **options)
