"""The playground, against what lanes simulate."""

import dataclasses
import re

import jax
import jax.tree_util as jtu
import numpy as np
import pytest
from selenium.webdriver.support.ui import WebDriverWait

import jaxbiped as jb
from jaxbiped.compiler import LANES
from jaxbiped.compiler.runtime._processors import InputTable
from jaxbiped.plot.viewer._playground import (
    STEPS,
    _shown_numbers,
    _sliders,
    played_request,
    recorded_names,
)
from jaxbiped.plot.viewer._view import page_of, script
from tests.mechanisms import scene_of, start_of

pytestmark = pytest.mark.slow

FOOTSTEPS = 3
SOLVES = """
return makeSimulator(arguments[0]).then((simulator) => arguments[1].map((inputs) => {
  const { rows, count, code } = simulator.solve(inputs);
  const strikes = simulator.run(inputs, 0).footprints.filter((each) => each.strike);
  const bits = [...new BigInt64Array(rows.buffer)].map(String);
  return [bits, count, code, strikes.map((each) => each.t)];
}));
"""
MOVE = """
const range = document.querySelector(`[data-leaf="${arguments[0]}"]`);
range.value = arguments[1];
range.dispatchEvent(new Event("input"));
"""
TOLD = "return document.querySelector('.told')?.textContent ?? ''"


@pytest.fixture(scope="module")
def playground():
    return jb.plot.playground(jb.seed_scene(slope=0.02), jb.seed_state(), footsteps=FOOTSTEPS)


def moved(slope=0.02, stiffness=1e6, omega=-0.0052):
    """A scene and a start, as sliders move them."""
    scene = jb.with_parameters(jb.seed_scene(slope=slope), {"K": stiffness})
    return scene, jb.seed_state()._replace(omega_1=omega)


CASES = [moved(), moved(slope=0.012), moved(stiffness=2.5e5), moved(omega=1.2), moved(omega=4.0)]


def natively(scene, state):
    """Records, their number and the ending by lanes."""
    request = played_request(scene, state, FOOTSTEPS)
    inputs = np.array([float(leaf) for leaf in jax.tree.leaves(request.inputs)])
    found, recorded = LANES.compile(request).run_table(InputTable.of_rows(inputs[None]), room=STEPS)
    count = int(recorded.counts[0])
    return inputs, recorded.values[0, :count], found[0, 9]


def test_the_page_solves_what_lanes_solve_to_the_last_bit(playground, browser, tmp_path):
    (tmp_path / "page.html").write_text(
        f"<script type=module>{script('simulator')}window.makeSimulator = makeSimulator</script>"
    )
    browser.open(tmp_path / "page.html")
    expected = [natively(scene, state) for scene, state in CASES]
    given = [inputs.tolist() for inputs, _, _ in expected]
    found = browser.run(SOLVES, playground.sent()["playground"], given)
    endings = set()
    for (scene, state), (_, rows, ending), (bits, count, code, strikes) in zip(
        CASES, expected, found, strict=True
    ):
        assert count == len(rows) > 100
        assert code == ending
        np.testing.assert_array_equal(np.array(bits, np.int64), rows.view(np.int64).ravel())
        walk = jb.simulate(scene, state, footsteps=FOOTSTEPS, engine="lanes")
        np.testing.assert_array_equal(np.asarray(walk.t)[1:], rows[:, 0])
        np.testing.assert_array_equal(np.array(walk.state)[:, 1:].T, rows[:, 1:9])
        heels = jb.measure.heel_strikes(scene, walk).time_s
        # The page tells the end of the step in which a foot comes to touch.
        np.testing.assert_allclose(strikes, heels, atol=2e-3)
        endings.add(int(code))
    assert len(endings) > 1


def test_sliders_move_all_that_a_scene_moves(playground):
    scene, state = moved(slope=0.03, stiffness=3e5, omega=0.5)
    inputs = natively(scene, state)[0]
    places = {slider["input"] for slider in playground.sliders}
    changed = set(np.flatnonzero(inputs != playground.inputs).tolist())
    assert len(changed) == 3
    assert changed <= places
    paths, _ = jtu.tree_flatten_with_path(played_request(scene, state, FOOTSTEPS).inputs)
    names = [jtu.keystr(path) for path, _ in paths]
    assert all(names[slider["input"]] == slider["leaf"] for slider in playground.sliders)


@pytest.mark.parametrize("changes", [{}, {"friction": jb.laws.Frictionless()},
                                     {"actuation": jb.actuation.HipTorque(0.1)}])  # fmt: skip
def test_all_that_is_recorded_has_its_name(changes):
    scene = dataclasses.replace(jb.seed_scene(), **changes)
    shown = jax.eval_shape(lambda state: _shown_numbers(scene, state), jb.seed_state())
    assert len(shown) == len(recorded_names(scene)) - 1  # beside the time
    assert ("power" in recorded_names(scene)) == ("actuation" in changes)


def test_sliders_are_of_the_scene_and_of_one_body_of_each_pair():
    """A stiffness by the tenth or ten times, the rest by what a walker feels."""
    inputs = {".scene.normal.K": 1e6, ".state.omega_shank_1": 2.0, ".state.theta_thigh_2": 0.1,
              ".state.theta_thigh_1": -0.1, ".scene.ground.slope": 0.03}  # fmt: skip
    slope, stiffness, angle, rate = _sliders(scene_of("kneed"), inputs)
    shown = ("leaf", "input", "words", "unit", "least", "most", "value", "power")
    assert tuple(slope) == shown
    assert list(slope.values()) == [
        ".scene.ground.slope", 4, "Slope", "rad", pytest.approx(0.01), pytest.approx(0.05), 0.03,
        False,
    ]  # fmt: skip
    assert [stiffness[name] for name in shown[3:]] == ["N/mⁿ", 5.0, 7.0, 6.0, True]
    assert (angle["words"], angle["input"]) == ("Angle of thigh_1", 3)
    assert (angle["least"], angle["most"]) == pytest.approx((-0.25, 0.05))
    assert (rate["words"], rate["least"], rate["most"]) == ("Rate of shank_1", 0.5, 3.5)
    unpaired = {".state.theta_leg_1": 0.1, ".state.theta_leg_2": 0.2}
    assert [each["leaf"] for each in _sliders(scene_of("unequal"), unpaired)] == [
        ".state.theta_leg_1"
    ]


def test_a_slider_leads_to_another_walk(playground, browser, tmp_path):
    playground.save(tmp_path / "play.html")
    browser.errors()
    for width, dark in ((1200, False), (400, True)):
        browser.open(tmp_path / "play.html", width=width, dark=dark)
        waiting = WebDriverWait(browser.driver, 20)
        waiting.until(lambda _: "walking; slope 0.0200" in browser.run(TOLD))
        browser.run(MOVE, ".scene.ground.slope", 0.03)
        waiting.until(lambda _: "slope 0.0300" in browser.run(TOLD))
        end = jb.simulate(*moved(slope=0.03), footsteps=FOOTSTEPS, engine="lanes").t[-1]
        assert f"after {float(end):.2f} s" in browser.run(TOLD)
        wider = "return document.documentElement.scrollWidth - window.innerWidth"
        assert browser.run(wider) <= 0
        # The first record is that of the first step, 2 µs after the start.
        assert browser.find(".chart .axes text").text == "0.0"
        assert browser.nameless() == []
        told = browser.find('[data-leaf=".scene.ground.slope"]').get_attribute("aria-valuetext")
        assert told == "0.0300 rad"
    assert [each for each in browser.errors() if each["level"] == "SEVERE"] == []


def test_the_page_asks_for_nothing_and_is_small(playground):
    page = playground.html()
    assert "'wasm-unsafe-eval'" in page
    assert "'wasm-unsafe-eval'" not in page_of({}, "walk")
    assert re.findall(r"(?:src|href)=\"(?!data:)", page) == []
    assert len(page) < 250_000


def test_a_mechanism_s_page_records_the_walk_that_lanes_make():
    scene = scene_of("coupled")
    state = start_of("coupled", scene)
    request = played_request(scene, state, FOOTSTEPS)
    inputs = np.array([float(leaf) for leaf in jax.tree.leaves(request.inputs)])
    _, recorded = LANES.compile(request).run_table(InputTable.of_rows(inputs[None]), room=STEPS)
    rows = recorded.values[0, : int(recorded.counts[0])]
    named = dict(zip(recorded_names(scene), rows.T, strict=True))
    walk = jb.simulate(scene, state, footsteps=FOOTSTEPS, engine="lanes")
    np.testing.assert_array_equal(named["theta_leg_1"], np.asarray(walk.state.theta_leg_1)[1:])
    mean = 0.5 * (named["theta_leg_1"] + named["theta_leg_2"])
    np.testing.assert_allclose(named["theta_torso"], mean, atol=1e-12)
    page = jb.plot.playground(scene, state, footsteps=FOOTSTEPS)
    words = [slider["words"] for slider in page.sliders]
    assert words[-2:] == ["Angle of leg_1", "Rate of leg_1"]


def test_a_driven_page_records_the_power_of_what_drives():
    """Its integral by trapezoids is the page's line of the motors' work."""
    scene = dataclasses.replace(
        jb.seed_scene(slope=0.02), actuation=(jb.actuation.HipTorque(0.05),)
    )
    state = jb.seed_state()
    request = played_request(scene, state, FOOTSTEPS)
    inputs = np.array([float(leaf) for leaf in jax.tree.leaves(request.inputs)])
    _, recorded = LANES.compile(request).run_table(InputTable.of_rows(inputs[None]), room=STEPS)
    rows = recorded.values[0, : int(recorded.counts[0])]
    named = dict(zip(recorded_names(scene), rows.T, strict=True))
    walk = jb.simulate(scene, state, footsteps=FOOTSTEPS, engine="lanes")
    work = float(jb.measure.energy_ledger(scene, walk).actuation_work[0])
    power, t = named["power"], named["t"]
    assert 0.5 * np.diff(t) @ (power[1:] + power[:-1]) == pytest.approx(work, rel=1e-2)
    assert "power" not in recorded_names(jb.seed_scene())
