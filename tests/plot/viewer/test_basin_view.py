"""The basin in a browser, against the walk of the start that is picked."""

import base64
import dataclasses
import re

import numpy as np
import pytest

import jaxbiped as jb
from tests.drawn import sent_in

pytestmark = pytest.mark.slow

REWIND = """
const slider = document.querySelector("input[type=range]");
slider.value = 0;
slider.dispatchEvent(new Event("input"));
"""
AXES = {"omega_swing": np.linspace(-1.0, 4.0, 6), "theta_swing": np.linspace(-0.4, 0.5, 7)}


@pytest.fixture(scope="module")
def basin(seed):
    starts = jb.starts.grid(seed.scene, AXES)
    found = jb.sweep(seed, starts)
    return found, jb.plot.view_basin(seed, starts, found, most=12, footsteps=2)


@pytest.mark.parametrize(
    ("shape", "most"), [((6, 7), 12), ((20, 20), 12), ((2, 50), 12), ((3, 2), 12), ((3, 2), 100)]
)
def test_the_choice_is_even_and_no_more_than_asked(seed, shape, most):
    axes = {name: np.linspace(-0.3, 0.3, n) for name, n in zip(AXES, shape, strict=True)}
    starts = jb.starts.grid(seed.scene, axes)
    found = jb.sweep(seed, starts, look_for_gaits=False)
    sent = sent_in(jb.plot.view_basin(seed, starts, found, most=most, footsteps=2).html())["basin"]
    rows, columns = (np.array(sent[name]) for name in ("rows", "columns"))
    assert len(rows) * len(columns) <= most
    assert rows.max() < shape[0]
    assert columns.max() < shape[1]
    for chosen in (rows, columns):
        assert np.ptp(np.diff(chosen)) <= 1 if chosen.size > 2 else True
    if most == 100:
        assert (rows.tolist(), columns.tolist()) == ([0, 1, 2], [0, 1])


def test_cells_are_the_labels(basin):
    found, view = basin
    names = jb.basins.label_names(found.label.values, found.cycle_footsteps.values)
    sent = sent_in(view.html())
    cells = np.frombuffer(base64.b64decode(sent["basin"]["cells"]), np.uint8)
    assert [sent["basin"]["names"][k] for k in cells] == names.ravel().tolist()
    motion = {"hip_x", "hip_z", "hip_vx", "hip_vz", "theta_1", "theta_2", "omega_1", "omega_2"}
    assert {frozenset(each.channels) for each in view.recordings if each} == {frozenset(motion)}


def test_a_start_that_is_picked_shows_its_walk(basin, browser, tmp_path):
    _, view = basin
    page = browser.open(view.save(tmp_path / "basin.html"))
    picture = page.find(".basin .chart")
    ring = "return Number(document.querySelector('.ring').getAttribute('cx'))"

    def assert_shows_its_start():
        told = page.find(".picture .told").text.replace("−", "-")
        angle, rate = map(float, re.findall(r"\): (-?[\d.]+)", told))
        page.run(REWIND)
        reading = page.find(".reading").text.replace("−", "-")
        shown = float(re.search(r"leg 1: (-?[\d.]+)", reading)[1])
        assert shown == pytest.approx(angle, abs=6e-4)
        assert rate in AXES["omega_swing"].round(4)
        return angle, rate

    first = assert_shows_its_start()
    page.press(picture, -150, 40)
    second = assert_shows_its_start()
    assert second != first
    at = page.run(ring)
    page.keys("\ue014")
    third = assert_shows_its_start()
    assert third[0] > second[0]
    assert third[1] == second[1]
    assert page.run(ring) > at
    page.keys("\ue013")
    assert assert_shows_its_start()[1] > third[1]
    assert page.nameless() == []
    for width in (400, 800, 1600):
        page.open(tmp_path / "basin.html", width=width, dark=True)
        assert page.run("return document.documentElement.scrollWidth") <= width
    assert page.errors() == []


def test_what_cannot_be_viewed_is_told(seed, basin):
    found, _ = basin
    one = jb.starts.grid(seed.scene, {"theta_swing": AXES["theta_swing"]})
    with pytest.raises(jb.ArgumentError, match="same two axes"):
        jb.plot.view_basin(seed, one, found)
    rigid = dataclasses.replace(seed, scene=jb.ladder()["rigid"])
    with pytest.raises(jb.ArgumentError, match="rigid"):
        jb.plot.view_basin(rigid, jb.starts.grid(seed.scene, AXES), found)
