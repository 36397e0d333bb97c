"""The page, against what it was given: one file, whole, and its text safe."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

import jaxbiped as jb
from jaxbiped.plot.style import view_colours
from tests.drawn import sent_in

ASSETS = sorted((Path(jb.plot.__file__).parent / "viewer" / "assets").iterdir())


@pytest.fixture(scope="module")
def page():
    """A page of a walk of half a footstep."""
    scene = jb.seed_scene()
    return jb.plot.view(scene, jb.simulate(scene, jb.seed_state(), duration=0.2), name=NAME).html()


NAME = '</script><b> & "'


def script_of(page):
    """The text of a page's module."""
    (module,) = re.findall(r"<script type=.?module.?>(.*?)</script>", page, flags=re.DOTALL)
    return module


def test_names_within_the_page_stay_text(page):
    assert NAME not in page
    assert [walk["name"] for walk in sent_in(page)["walks"]] == [NAME]
    assert "<title>&lt;/script&gt;" in page


def test_the_page_asks_for_nothing(page):
    assert "script-src 'unsafe-inline';" in page
    assert "default-src 'none'" in page
    assert set(re.findall(r"https?://[^\"' ]*", page)) == {"http://www.w3.org/2000/svg"}
    assert re.findall(r"(?:src|href)=\"(?!data:)", page) == []


def test_every_module_is_in_the_page_once_and_no_name_is_taken_twice(page):
    texts = {path.stem: path.read_text() for path in ASSETS if path.suffix == ".js"}
    whole = script_of(page)
    places = {name: whole.find(text.partition("\n")[0]) for name, text in texts.items()}
    assert [name for name, place in places.items() if place < 0] == ["widget"]
    assert not re.search(r"^(import|export) ", whole, flags=re.MULTILINE)
    names = re.findall(r"^(?:function|class|const) (\w+)", whole, flags=re.MULTILINE)
    assert len(names) > 30
    assert len(names) == len(set(names))
    for name, text in texts.items():
        own = len(whole) if name == "widget" else places[name]
        for imported in re.findall(r'from "\./(\w+)\.js"', text):
            assert places[imported] < own, name


@pytest.mark.parametrize("path", ASSETS, ids=lambda path: path.name)
def test_assets_are_short(path):
    lines = path.read_text().splitlines()
    assert len(lines) < 300
    assert max(map(len, lines)) <= 110


def test_the_script_is_javascript(page, tmp_path):
    if not (node := shutil.which("node")):
        pytest.skip("no node: only a browser can tell")
    (tmp_path / "view.mjs").write_text(script_of(page))
    subprocess.run([node, "--check", tmp_path / "view.mjs"], check=True)


def _luminance(colour):
    """Relative luminance of sRGB (WCAG 2.2)."""
    parts = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def _contrast(one, two):
    high, low = sorted((_luminance(one), _luminance(two)), reverse=True)
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("kind", [0, 1], ids=["light", "dark"])
def test_colours_stand_out(kind):
    """Text by a contrast of 4.5, what is drawn by 3 (WCAG 2.2, AA)."""
    (css,) = (path.read_text() for path in ASSETS if path.name == "view.css")
    pair = r"light-dark\((#\w{6}), (#\w{6})\)"
    look = {name: both[kind] for name, *both in re.findall(rf"--(\w+): {pair}", css)}
    for back in ("back", "panel"):
        for text in ("text", "faint"):
            assert _contrast(look[text], look[back]) > 4.5
        for name, both in view_colours().items():
            assert _contrast(re.fullmatch(pair, both)[1 + kind], look[back]) > 3.0, name
