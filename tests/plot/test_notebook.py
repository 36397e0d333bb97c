"""What notebooks show of gaits, branches and scenes, against their own numbers."""

import base64
import html.parser
import io
import re
import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from matplotlib.collections import EllipseCollection
from PIL import Image

import jaxbiped as jb
from tests.drawn import assert_is_drawn

RIGID = jb.ladder()["rigid"]
PLAIN = dict(parameters=(), radius_sensitivities=False)


class Cells(html.parser.HTMLParser):
    """The cells of a table, and the pictures."""

    def __init__(self, text):
        super().__init__()
        self.cells, self.pictures, self.words = [], [], []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attributes):
        told = dict(attributes)
        if tag == "img":
            assert told["alt"]
            data = base64.b64decode(told["src"].removeprefix("data:image/png;base64,"))
            self.pictures.append(Image.open(io.BytesIO(data)))

    def handle_data(self, data):
        self.cells.append(data)


@pytest.fixture(scope="module")
def gait():
    return jb.find_gait(RIGID, **PLAIN)


def test_a_gait_shows_its_measures_with_their_errors_and_its_multipliers(gait):
    shown = Cells(gait._repr_html_())
    assert shown.cells[0] == "Gait: stable, found by start; its cycle is a step"
    row = shown.cells.index("period")
    value, error = map(float, shown.cells[row + 1 : row + 3])
    assert abs(value - float(gait.measures.period)) <= error
    assert error == pytest.approx(float(gait.measure_errors.period), rel=0.5)
    (picture,) = shown.pictures
    assert len(picture.getcolors(100_000)) > 20  # something is drawn
    assert picture.size == (640, 336)  # both charts, of 8 by 4.2 inches at 80 dots per inch


def test_what_is_not_found_and_what_is_many_have_no_picture(gait):
    uphill = jb.with_parameters(RIGID, {"slope": -0.02})
    lost = Cells(jb.find_gait(uphill, max_evaluations=2, **PLAIN)._repr_html_())
    assert lost.cells[0].startswith("Gait: ")
    assert "stable" not in lost.cells[0]
    assert not lost.pictures
    many = jax.tree.map(lambda leaf: jnp.stack([leaf, leaf]), gait)
    assert many._repr_html_().startswith("<pre>Gait(2 found")
    scenes = jax.tree.map(lambda leaf: jnp.stack([leaf, leaf]), RIGID)
    assert scenes._repr_html_().startswith("<pre>")

    @jax.jit
    def traced(scene):
        assert scene._repr_html_().startswith("<pre>")
        return scene.ground.slope

    traced(RIGID)
    assert jb.plot.notebook_html("<3") == "<pre>&#x27;&lt;3&#x27;</pre>"


def test_a_branch_shows_where_it_ends():
    branch = jb.continue_gait(RIGID, bounds=(0.0199, 0.0201), largest_step=0.5)
    shown = Cells(branch._repr_html_())
    assert shown.cells[0] == f"Branch of {len(branch)} gaits along slope"
    assert [shown.cells[shown.cells.index("end: reached") + k] for k in (1, 2)] == ["0.0199", "rad"]
    assert len(shown.pictures) == 1


@pytest.mark.parametrize(
    "scene", [RIGID, jb.seed_scene(slope=0.05), jb.models.hsu_chen(), jb.models.wisse()]
)
def test_a_scene_shows_its_parameters_and_its_walker_on_the_ground(scene):
    shown = Cells(scene._repr_html_())
    slope = float(scene.ground.slope)
    assert f"{slope:.6g}" in shown.cells
    assert len(shown.pictures) == 1
    figure = jb.plot.walker(scene)
    (ax,) = figure.axes
    assert re.search(r"slope of [\d.]+ rad", ax.get_title(loc="left"))
    # In the slope's frame the lowest foot touches height 0.
    feet = scene.mechanism.feet
    circles = [each for each in ax.collections if isinstance(each, EllipseCollection)]
    heights = []
    for foot, circle in zip(feet, circles, strict=True):
        x, z = circle.get_offsets()[0]
        heights.append(z * np.cos(slope) + x * np.sin(slope) - float(foot.radius))
    assert min(heights) == pytest.approx(0.0, abs=1e-12)
    assert_is_drawn(figure)


def test_a_picture_goes_into_axes_that_are_given():
    figure = jb.plot.style.new_figure()
    assert jb.plot.walker(RIGID, ax=figure.add_subplot()) is figure
    assert_is_drawn(figure)


def test_plot_is_imported_when_a_notebook_asks():
    code = (
        "import sys, jaxbiped as jb; scene = jb.seed_scene(); repr(scene); "
        "assert 'jaxbiped.plot' not in sys.modules; scene._repr_html_(); "
        "assert 'jaxbiped.plot' in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
