"""The page, against what it was given: one file, whole, and its text safe."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from jaxbiped.plot.style import view_colours
from jaxbiped.plot.viewer import _view
from jaxbiped.plot.viewer._view import asset, page_of, script
from tests.drawn import sent_in

ASSETS = sorted((Path(_view.__file__).parent / "assets").iterdir())


def test_names_within_the_page_stay_text():
    name = '</script><b> & "'
    page = page_of({"walks": [{"name": name}]}, name)
    assert name not in page
    assert sent_in(page) == {"walks": [{"name": name}]}
    assert "<title>&lt;/script&gt;" in page


def test_the_page_asks_for_nothing():
    page = page_of({}, "walk")
    assert "default-src 'none'" in page
    assert set(re.findall(r"https?://[^\"' ]*", page)) == {"http://www.w3.org/2000/svg"}
    assert re.findall(r"(?:src|href)=\"(?!data:)", page) == []


def test_only_a_page_that_computes_may_run_webassembly():
    assert "script-src 'unsafe-inline';" in page_of({}, "walk")
    assert "script-src 'unsafe-inline' 'wasm-unsafe-eval';" in page_of({}, "walk", computes=True)


def test_every_module_is_in_the_page_once_and_no_name_is_taken_twice():
    modules = [path for path in ASSETS if path.suffix == ".js"]
    whole = script(*_view._MODULES, "page")
    assert {path.stem for path in modules} == {*_view._MODULES, "page", "widget"}
    assert not re.search(r"^(import|export) ", whole, flags=re.MULTILINE)
    names = re.findall(r"^(?:function|class|const) (\w+)", whole, flags=re.MULTILINE)
    assert len(names) > 30
    assert len(names) == len(set(names))
    for path in modules:
        place = _view._MODULES.index(path.stem) if path.stem in _view._MODULES else None
        before = _view._MODULES[:place]
        imported = re.findall(r'from "\./(\w+)\.js"', path.read_text())
        assert set(imported) <= set(before), path.name


@pytest.mark.parametrize("path", ASSETS, ids=lambda path: path.name)
def test_assets_are_short(path):
    lines = path.read_text().splitlines()
    assert len(lines) < 300
    assert max(map(len, lines)) <= 110


def test_the_script_is_javascript(tmp_path):
    if not (node := shutil.which("node")):
        pytest.skip("no node: only a browser can tell")
    (tmp_path / "view.mjs").write_text(script(*_view._MODULES, "page"))
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
    pair = r"light-dark\((#\w{6}), (#\w{6})\)"
    look = {name: both[kind] for name, *both in re.findall(rf"--(\w+): {pair}", asset("view.css"))}
    for back in ("back", "panel"):
        for text in ("text", "faint"):
            assert _contrast(look[text], look[back]) > 4.5
        for name, both in view_colours().items():
            assert _contrast(re.fullmatch(pair, both)[1 + kind], look[back]) > 3.0, name
