"""The widget, against the page: notebooks run the same, and its time is shared."""

import base64
import json
import sys

import pytest

import jaxbiped as jb

pytestmark = pytest.mark.slow

MODEL = """
const done = arguments[arguments.length - 1];
const [script, css, sent] = arguments;
document.head.append(Object.assign(document.createElement("style"), { textContent: css }));
const heard = {};
window.model = {
  values: { sent, time: 0.25 }, saved: 0,
  get(name) { return this.values[name]; },
  set(name, value) { this.values[name] = value; heard[`change:${name}`]?.(); },
  save_changes() { this.saved += 1; },
  on(name, call) { heard[name] = call; },
  off(name) { delete heard[name]; },
  heard,
};
import("data:text/javascript;base64," + script).then(({ default: { render } }) => {
  window.end = render({ model: window.model, el: document.body });
  done(true);
});
"""
TIME = "return Number(document.querySelector('.stage').dataset.time)"
TOP = "return document.querySelector(arguments[0]).getBoundingClientRect().top"


@pytest.fixture(scope="module")
def viewed(seed_walk):
    return jb.plot.view(*seed_walk, name="seed")


def test_time_is_shared_with_python(viewed, browser, tmp_path):
    (tmp_path / "empty.html").write_text("<!doctype html><title>notebook</title>")
    pytest.importorskip("anywidget")
    widget = viewed.widget()
    script = base64.b64encode(widget._esm.encode()).decode()
    page = browser.open(tmp_path / "empty.html")
    assert page.driver.execute_async_script(MODEL, script, widget._css, viewed.sent())
    assert page.run(TIME) == 0.25
    # A notebook's cell has no lower edge in sight: the player is above the walker, and charts
    # stand beside it only where the cell, not the window, is wide.
    assert page.run(TOP, ".player") < page.run(TOP, ".stage")
    assert page.run(TOP, ".charts") < page.run(TOP, ".reading")
    page.run("document.body.style.width = '900px'")
    assert page.run(TOP, ".charts") > page.run(TOP, ".reading")
    page.run("model.set('time', 1.5)")
    assert page.run(TIME) == 1.5
    page.find(".play").send_keys("\ue010")
    page.driver.execute_async_script("setTimeout(arguments[0], 600)")
    assert page.run("return model.get('time')") == pytest.approx(2.0)
    assert page.run("return model.saved") > 0
    both = jb.plot.side_by_side(viewed, viewed)
    page.run("model.set('sent', arguments[0])", both.sent())
    assert page.run("return document.querySelectorAll('.stage').length") == 2
    assert page.run(TIME) == pytest.approx(2.0)
    assert page.run("end(); return Object.keys(model.heard).length") == 0
    assert page.errors() == []


def test_a_notebook_shows_the_widget(viewed):
    pytest.importorskip("anywidget")
    widget = viewed.widget()
    assert widget.sent == viewed.sent()
    assert json.dumps(widget.sent)
    shown = viewed._repr_mimebundle_()
    data = shown[0] if isinstance(shown, tuple) else shown
    assert "application/vnd.jupyter.widget-view+json" in data


def test_without_anywidget_it_shows_the_page(viewed, monkeypatch):
    monkeypatch.setitem(sys.modules, "anywidget", None)
    shown = viewed._repr_mimebundle_()
    assert shown["text/plain"] == "View(seed: walking)"
    assert "<iframe srcdoc=" in shown["text/html"]
    assert "allow-scripts" in shown["text/html"]
