"""The viewer in a real browser, against what was simulated."""

import numpy as np
import pytest

import jaxbiped as jb
from tests.browser import require_chromium
from tests.drawn import leg_pixels
from tests.mechanisms import scene_of, start_of

pytestmark = pytest.mark.slow

TIME = ".jaxbiped-view input[type=range]"
WHERE = """
const at = (part, names) => [...document.querySelectorAll(`[data-part=${part}]`)].map(
  (each) => names.map((name) => Number(each.getAttribute(name))));
return {
  time: Number(document.querySelector(".stage").dataset.time),
  root: at("root", ["cx", "cy"]), foot_1: at("foot-1", ["cx", "cy"]),
  foot_2: at("foot-2", ["cx", "cy"]),
  leg_1: [...document.querySelectorAll("[data-part=body-1]")].map(
    (each) => each.getAttribute("d").split("L").at(-1).split(" ").map(Number)),
};
"""
SCRUB = """
const slider = document.querySelector("input[type=range]");
slider.value = arguments[0];
slider.dispatchEvent(new Event("input", {bubbles: true}));
"""
FIRST_PAINT = """
new PerformanceObserver((list) => {
  const found = list.getEntriesByName("first-contentful-paint");
  if (found.length) arguments[0](found[0].startTime);
}).observe({type: "paint", buffered: true});
"""


@pytest.fixture(scope="module")
def walk():
    require_chromium()
    scene = jb.seed_scene(slope=0.02)
    return scene, jb.simulate(scene, jb.seed_state(), footsteps=20, engine="lanes")


@pytest.fixture(scope="module")
def file(walk, tmp_path_factory):
    return jb.plot.view(*walk, name="seed").save(tmp_path_factory.mktemp("view") / "walk.html")


@pytest.fixture
def page(browser, file):
    """The walk's page as it opens; what is done to it leaves no message on the console."""
    yield browser.open(file)
    assert browser.errors() == []


def _drawn(scene, *places):
    """Places in the slope's frame [m], as a page has them: level, and downwards positive."""
    sine, cosine = np.sin(float(scene.ground.slope)), np.cos(float(scene.ground.slope))
    return [
        [float(x * cosine + z * sine), float(x * sine - z * cosine)] for x, z in map(tuple, places)
    ]


def _centres(scene, state):
    """Where the arcs of the feet have their centres, in the slope's frame [m]."""
    return [(foot.x, foot.z) for foot in jb.dynamics.feet(scene, state)]


def assert_is_there(page, walk):
    """The page's walker is where the simulation has it, to 0.1 mm."""
    shown = page.run(WHERE)
    scene, trajectory = walk
    time = min(shown["time"], float(trajectory.t[-1]))
    state = trajectory.at(time)
    places = _drawn(scene, (state.hip_x, state.hip_z), *_centres(scene, state))
    for name, place in zip(("root", "foot_1", "foot_2"), places, strict=True):
        assert np.allclose(shown[name], [place], rtol=0.0, atol=1e-4), (name, time)
    assert shown["leg_1"] == shown["foot_1"]
    return shown["time"]


def test_the_last_number_of_an_axis_is_not_cut(walk, browser, tmp_path):
    short = jb.simulate(walk[0], jb.seed_state(), duration=0.15, engine="lanes")
    browser.open(jb.plot.view(walk[0], short).save(tmp_path / "short.html"), width=800)
    right = """return [...document.querySelectorAll(".chart")].map((chart) => {
      const edge = (each) => each.getBoundingClientRect().right;
      return edge(chart) - Math.max(...[...chart.querySelectorAll(".axes text")].map(edge));
    });"""
    assert min(browser.run(right)) >= 0.0


def test_it_weighs_little_and_shows_its_first_frame_within_a_second(page, file):
    assert file.stat().st_size < 1.5e6
    painted = []
    for _ in range(3):
        page.open(file)
        painted.append(page.driver.execute_async_script(FIRST_PAINT))
    assert min(painted) < 1000.0
    assert page.run("return performance.getEntriesByType('resource').length") == 0


def test_scrubbed_positions_are_those_of_the_walk(page, walk):
    end = float(walk[1].t[-1])
    strike = jb.footsteps(*walk).time_s[3]
    for time in (0.0, 0.123, strike - 1e-3, strike + 5e-4, 4.321, end):
        page.run(SCRUB, time)
        assert assert_is_there(page, walk) == pytest.approx(time, abs=1e-9)


def test_it_plays_and_pauses(page, walk):
    assert page.find(".play").text == "Play"
    page.find(".play").click()
    page.driver.set_script_timeout(20)
    moved = """
    const done = arguments[0];
    const look = () => Number(document.querySelector(".stage").dataset.time) > 0.5
      ? done(true) : requestAnimationFrame(look);
    look();
    """
    assert page.driver.execute_async_script(moved)
    assert page.find(".play").text == "Pause"
    page.find(".play").click()
    stopped = assert_is_there(page, walk)
    assert stopped > 0.5
    frames = "const done = arguments[0]; setTimeout(done, 100)"
    page.driver.execute_async_script(frames)
    assert page.run(WHERE)["time"] == stopped


def test_it_plays_by_itself_unless_motion_is_to_be_reduced(page, file):
    assert page.open(file, reduced=False).find(".play").text == "Pause"
    assert page.open(file, reduced=True).find(".play").text == "Play"


def test_keys_do_what_the_page_says(page, walk):
    strikes = [p["t"] for p in jb.plot.view(*walk).sent()["walks"][0]["footprints"] if p["strike"]]
    time = lambda: page.run(WHERE)["time"]
    left, right, home, end = "\ue012", "\ue014", "\ue011", "\ue010"
    page.keys(right)
    assert time() == pytest.approx(0.02)
    page.keys(left, left)
    assert time() == 0.0
    page.keys(right, right, shift=True)
    assert time() == pytest.approx(strikes[1])
    page.keys(left, shift=True)
    assert time() == pytest.approx(strikes[0])
    page.keys(end)
    assert time() == pytest.approx(float(walk[1].t[-1]))
    assert page.find(".badge").text == "walking"
    page.keys(home)
    assert time() == 0.0
    page.keys("-", " ")
    assert page.find("select").get_attribute("value") == "0.5"
    assert page.find(".play").text == "Pause"
    page.keys(" ")
    assert page.find(".play").text == "Play"


def test_a_press_on_a_chart_moves_every_cursor(page, walk):
    chart = page.find(".chart.picks")
    page.press(chart, 0, 0)
    time = assert_is_there(page, walk)
    assert 0.3 < time / float(walk[1].t[-1]) < 0.7
    cursors = page.run(
        "return [...document.querySelectorAll('.picks .cursor')].map((c) => c.getAttribute('x1'))"
    )
    assert len(cursors) == 4
    assert len(set(cursors)) == 1
    page.run("document.querySelectorAll('select')[1].value = 0.01")
    page.run("document.querySelectorAll('select')[1].dispatchEvent(new Event('change'))")
    ticks = page.run("return [...document.querySelectorAll('.picks .axes text')][0].textContent")
    assert float(ticks) == pytest.approx(time, abs=0.01)


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    """A titan's rigid walk, which motors drive, in a page."""
    require_chromium()
    walker = jb.Walker(m=4e4, J=1.5e5, l=8.0, d=2.0, r=1.6, hip_mass=4e4)
    parts = jb.actuation.HipPulse(6e4), jb.actuation.PushOff(1e4)
    scene = jb.RigidScene(walker, jb.Ground(slope=0.02), parts)
    start = scene.state(theta_1=-0.2, theta_2=0.2, omega_1=-0.17, omega_2=-0.28)
    walk = jb.rigid_walk(scene, start, footsteps=3, max_arrivals=3)
    page = jb.plot.view(scene, walk, start=start, name="titan")
    return page.save(tmp_path_factory.mktemp("driven") / "walk.html")


@pytest.mark.parametrize("width", [400, 800, 1600])
def test_charts_are_whole_and_motors_have_their_line(browser, driven, width):
    page = browser.open(driven, width=width)
    assert "motors' work" in page.find(".charts figure:last-child figcaption").text
    assert page.run("return document.querySelectorAll('.curve.driven').length") == 1
    beyond = """return [...document.querySelectorAll(".chart")].flatMap((chart) => {
      const frame = chart.querySelector("clipPath rect").getBBox();
      const within = (one, other) => one.x >= other.x - 1 && one.y >= other.y - 1 &&
        one.x + one.width <= other.x + other.width + 1 &&
        one.y + one.height <= other.y + other.height + 1;
      const [box, parts] = [chart.viewBox.baseVal, [...chart.querySelectorAll(".axes text")]];
      const turned = (text) => text.hasAttribute("transform");
      return [
        ...[...chart.querySelectorAll(".curve")].filter((curve) => !within(curve.getBBox(), frame)),
        ...parts.filter((text) => !turned(text) && !within(text.getBBox(), box)),
      ].map((each) => each.textContent || each.getAttribute("class"));
    });"""
    assert page.run(beyond) == []
    # What an impact takes is lost at once: no line leans.
    path = page.find(".curve.lost").get_attribute("d")
    points = np.array([each.split() for each in path[1:].split("L")], float)
    apart = np.abs(np.diff(points, axis=0))
    assert np.all((apart[:, 0] < 0.3) | (apart[:, 1] < 1.0))
    assert apart[:, 1].max() > 10.0


@pytest.mark.parametrize("kind", ["seed", "driven"])
@pytest.mark.parametrize("size", [(1000, 620), (1000, 700), (1150, 750), (1300, 800), (1600, 900)])
def test_picture_charts_and_player_are_seen_without_a_scroll(browser, file, driven, kind, size):
    page = browser.open(driven if kind == "driven" else file, width=size[0], height=size[1] + 200)
    page.resize(width=size[0], height=size[1])
    page.driver.execute_async_script(
        "const done = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(done))"
    )
    seen = page.run("""
    const box = (each) => each.getBoundingClientRect();
    const all = (names) => [...document.querySelectorAll(names)].map(box);
    return {
      boxes: all(".stage, .reading, .charts figure"), charts: all(".chart"),
      player: all(".player")[0],
      drawn: [...document.querySelectorAll(".chart")].map(({ viewBox }) => viewBox.baseVal),
      window: [innerWidth, innerHeight],
    };""")
    assert len(seen["boxes"]) == 2 + len(seen["charts"]) > 4
    for box in seen["boxes"]:
        assert box["top"] >= 0.0
        assert box["bottom"] <= seen["player"]["top"]
        assert box["left"] >= 0.0
        assert box["right"] <= seen["window"][0]
    assert seen["player"]["bottom"] <= seen["window"][1]
    # Every chart is drawn for the room that it has, and ends within its figure.
    for box, figure, drawn in zip(seen["charts"], seen["boxes"][2:], seen["drawn"], strict=True):
        assert box["bottom"] <= figure["bottom"] + 0.5
        assert box["height"] >= 90.0
        for side in ("width", "height"):
            assert drawn[side] == pytest.approx(box[side], abs=1.0)


@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("width", [400, 800, 1600])
def test_it_fits_any_width_by_day_and_by_night(page, file, tmp_path, dark, width):
    page.open(file, width=width, dark=dark)
    page.run(SCRUB, 4.0)
    assert page.run("return document.documentElement.scrollWidth") <= width
    out = page.run(
        "return [...document.querySelectorAll('.chart text, .clock')].filter((each) => {"
        "const [own, box] = [each, each.ownerSVGElement].map((e) => e.getBoundingClientRect());"
        "return own.left < box.left - 1 || own.right > box.right + 1 || own.height < 8;"
        "}).map((each) => each.textContent)"
    )
    assert out == []
    picture = page.screenshot(tmp_path / "view.png")
    if not dark:
        assert min(leg_pixels(picture)) > 100


def test_screen_readers_are_told(page):
    page.run(SCRUB, 1.0)
    page.driver.execute_async_script("setTimeout(arguments[0], 600)")
    told = page.find("[aria-live]").get_attribute("textContent")
    assert "1.00 s" in told
    assert "heel strikes: 2" in told
    slider = page.find(TIME)
    assert slider.accessible_name == "Time"
    assert slider.get_attribute("aria-valuetext") == "1.00 of 8.77 seconds"
    assert page.nameless() == []
    rows = page.run("return document.querySelectorAll('tbody tr').length")
    assert rows == 19


@pytest.mark.parametrize("width", [400, 800, 1600])
def test_a_notebook_s_frame_shows_picture_and_player_at_once(browser, walk, tmp_path, width):
    """The frame scrolls down to the charts, never sideways; the player stays in sight."""
    frame = jb.plot.view(*walk, name="seed")._in_frame()
    path = tmp_path / "cell.html"
    path.write_text(f"<!doctype html><body style='margin: 0'>{frame}")
    page = browser.open(path, width=width)
    assert page.nameless() == []
    page.driver.switch_to.frame(page.find("iframe"))
    seen = page.run(
        "const box = (name) => document.querySelector(name).getBoundingClientRect();"
        "return [document.documentElement.scrollWidth, innerWidth, box('.stage').bottom,"
        "box('.player').top, box('.player').bottom, innerHeight]"
    )
    page.driver.switch_to.default_content()
    assert seen[0] <= seen[1]
    assert seen[2] <= seen[3] + 1.0
    assert seen[4] <= seen[5] + 1.0
    assert page.errors() == []


def test_knees_feet_and_names_of_a_mechanism_are_shown(browser, tmp_path):
    require_chromium()
    scene = scene_of("kneed")
    trajectory = jb.simulate(scene, start_of("kneed", scene), duration=0.1)
    path = jb.plot.view(scene, trajectory, name="kneed").save(tmp_path / "kneed.html")
    page = browser.open(path)
    page.run(SCRUB, 0.5 * float(trajectory.t[-1]))
    time = page.run("return Number(document.querySelector('.stage').dataset.time)")
    state = trajectory.at(time)
    thigh, bodies = 0.184, scene.mechanism.bodies
    assert {float(body.at.along) for body in bodies if body.parent is not None} == {thigh}
    hinges = [(state.hip_x, state.hip_z)] * 2 + [
        (state.hip_x + thigh * np.sin(angle), state.hip_z - thigh * np.cos(angle))
        for angle in (state.theta_thigh_1, state.theta_thigh_2)
    ]
    shown = page.run(
        "return [...document.querySelectorAll('[data-part=hinge], [data-part^=foot-]')].map("
        "(each) => ['cx', 'cy'].map((name) => Number(each.getAttribute(name))))"
    )
    expected = _drawn(scene, *_centres(scene, state), *hinges)
    assert np.allclose(sorted(shown), sorted(expected), rtol=0.0, atol=1e-4)
    said = page.run("return document.body.textContent")
    for name in scene.mechanism.structure.bodies:
        assert f"{name}: " in said
    assert browser.errors() == []
