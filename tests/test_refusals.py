"""Arguments that are not allowed, against one sentence that names the argument and its value."""

import functools

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.identify import MeasuredAngles, MeasuredGait

SCENE, START = jb.seed_scene(), jb.seed_state()
RIGID, ROLLING = jb.ladder()["rigid"], jb.dynamics.rigid_state(START)
PERIOD = MeasuredGait({"period": (0.44, 1e-4)})


@functools.cache
def _cut():
    """A walk that ends where it begins; made by a test, because all workers import this file."""
    return jb.simulate(SCENE, START, duration=2.0, max_solver_steps=1)


def _short(**options):
    return jb.simulate(SCENE, START, **{"duration": 0.1, **options})


CASES = {
    "measured NaN": (lambda: jb.fit_gait(RIGID, ("J",), np.nan), "measured = nan"),
    "NaN measured": (
        lambda: MeasuredGait({"period": (np.nan, 1e-4)}),
        r"measures\['period'\] = nan",
    ),
    "measures of a list": (lambda: MeasuredGait(["period"]), r"measures = \['period'\]"),
    "no times": (lambda: MeasuredAngles([], 1e-4, [], []), r"times = \[\]"),
    "section in words": (
        lambda: jb.find_gait(RIGID, section="heel-strike"),
        r"section = 'heel-strike' is not allowed: give MidStance\(\), HeelStrike\(\) or a Section",
    ),
    "section's class": (
        lambda: jb.return_map(SCENE, START, section=jb.HeelStrike),
        "section = <class",
    ),
    "save's class": (lambda: _short(save=jb.HeelStrike), "save = <class"),
    "watch in words": (lambda: _short(watch="fall"), "watch = 'fall'"),
    "footsteps without gravity": (
        lambda: jb.simulate(jb.with_parameters(RIGID, {"g": 0.0}), ROLLING, footsteps=1),
        "g = 0 is not allowed here",
    ),
    "gait without gravity": (
        lambda: jb.find_gait(jb.with_parameters(RIGID, {"g": 0.0}), ROLLING),
        "g = 0 is not allowed here",
    ),
    "rigid scene": (lambda: jb.footsteps(RIGID, _cut()), "it must be a Scene or a RedundantScene"),
    "another scene": (lambda: jb.footsteps(jb.seed_scene(slope=0.03), _cut()), "with another one"),
    "no scene": (lambda: jb.footsteps(None, _cut()), "scene = None"),
    "over a name": (lambda: jb.gait_sweep(SCENE, "K"), "over = 'K'"),
    "parameters that are none": (
        lambda: jb.find_gait(RIGID, parameters=3),
        r"parameters = 3 is not allowed: give a tuple of names, such as \('slope',\)",
    ),
    "parameters of a sweep that are none": (
        lambda: jb.gait_sweep(RIGID, {"slope": [0.02]}, parameters=3),
        "parameters = 3 is not allowed",
    ),
    "optimiser of Newton's method": (
        lambda: jb.find_gait(RIGID, optimiser="luck"),
        "optimiser = 'luck' is not allowed with method = 'newton'",
    ),
    "optimiser that is none": (
        lambda: jb.find_gait(RIGID, method="optax", optimiser="luck"),
        "optimiser = 'luck' is not allowed with method = 'optax'",
    ),
    "restarts and a half": (
        lambda: jb.optimise_gait(RIGID, vary={"d": (0.05, 0.2)}, maximise="speed", restarts=1.5),
        "restarts = 1.5 is not allowed: it must be a whole number of at least 0",
    ),
    "parameters in words": (lambda: jb.find_gait(RIGID, parameters="xi"), r"give .*\('xi',\)"),
    "misspelt": (lambda: jb.seed_scene(slop=0.1), r"'slop' .* \(perhaps slope is meant\)"),
    "misspelt by name": (
        lambda: jb.with_parameters(SCENE, {"slop": 0.1}),
        "perhaps slope is meant",
    ),
    "misspelt law": (lambda: jb.laws.friction_law_like("coulom"), "perhaps coulomb is meant"),
    "large foot": (lambda: jb.seed_scene(r=0.5), "l = 0.4 and r = 0.5 are not allowed together"),
    "no room": (lambda: _short(save=jb.HeelStrike(), max_arrivals=2**31), "max_arrivals = 2.1"),
    "no room on rigid feet": (
        lambda: jb.rigid_walk(RIGID, ROLLING, footsteps=1, max_arrivals=2**31),
        "max_arrivals = 2.1",
    ),
    "too many points": (
        lambda: jb.starts.sample(RIGID, {"omega_swing": (-1, 1)}, 2**31),
        "count = 2147483648",
    ),
    "no motion": (lambda: jb.plot.view(SCENE, _cut()), "ends where it begins"),
    "half a footstep": (lambda: jb.return_map(RIGID, ROLLING, footsteps=1.5), "footsteps = 1.5"),
    "no time": (lambda: jb.return_map(RIGID, ROLLING, max_time=-1.0), "max_time = -1"),
    "store of a number": (
        lambda: jb.gait_sweep(RIGID, {"slope": [0.02]}, store=3),
        "store = 3 is not allowed",
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_one_sentence(name):
    call, words = CASES[name]
    with pytest.raises(jb.ArgumentError, match=words) as refused:
        call()
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("path", ["/no/such/folder/a.html", "/", ""])
def test_a_page_that_cannot_be_written(path):
    view = jb.plot.view(SCENE, jb.simulate(SCENE, START, duration=0.01, accuracy="draft"))
    with pytest.raises(jb.ArgumentError, match="path = "):
        view.save(path)


def test_a_page_in_the_home_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    view = jb.plot.view(SCENE, jb.simulate(SCENE, START, duration=0.01, accuracy="draft"))
    assert view.save("~/a.html") == tmp_path / "a.html"


def test_a_law_that_is_named_alone_is_like_the_seed_s():
    seed = SCENE.friction
    law = jb.laws.friction_law_like("bengisu-akay")
    assert [float(x) for x in vars(law).values()] == [float(x) for x in vars(seed).values()]
    normal = jb.laws.normal_law_like("ristow-schafer")
    assert [float(x) for x in vars(normal).values()] == [
        float(x) for x in vars(SCENE.normal).values()
    ]
    of_mass = jb.laws.normal_law_like("hertz", mass=2.0 * float(SCENE.walker.m))
    assert float(jb.laws.normal_law_like("hertz").K) == float(of_mass.K)


def test_counts_may_be_whole_floats():
    assert jb.labelling(RIGID, footsteps=12.0).effort.footsteps == 12


def _of_dynamics():
    """Functions with scenes of kinds that they do not take, then with states of other scenes."""
    redundant = jb.RedundantScene(SCENE)
    bodies = jb.dynamics.redundant_state(redundant, START)
    needs_contact = ["energies", "powers", "feet", "foot_forces", "accelerations"]
    needs_bodies = ["redundant_motion", "violation", "consistent_state", "project"]
    yield from ((name, RIGID, START) for name in needs_contact)
    yield from ((name, SCENE, bodies) for name in (*needs_bodies, "redundant_state"))
    yield from ((name, redundant, START) for name in (*needs_bodies[:2], "project"))
    yield from ((name, SCENE, ROLLING) for name in needs_contact)
    yield "switches", RIGID, START
    yield from ((name, RIGID, START) for name in ("rolling_field", "vector_field"))
    yield from ((name, SCENE, ROLLING) for name in ("vector_field", "redundant_field"))
    yield from ((name, RIGID, bodies) for name in ("rolling_field", "redundant_field"))
    yield "vector_field", SCENE, bodies
    yield "redundant_field", redundant, START


@pytest.mark.parametrize(
    ("name", "scene", "state"),
    [pytest.param(*each, id=f"{each[0]}-{k}") for k, each in enumerate(_of_dynamics())],
)
def test_a_scene_or_a_state_of_another_kind_is_refused_by_dynamics(name, scene, state):
    function = getattr(jb.hybrid if name == "switches" else jb.dynamics, name)
    given = (0.0, state, scene) if name.endswith("field") else (scene, state)
    with pytest.raises(jb.ArgumentError, match=r"^(scene = a|state (has|is minimal|= ))") as told:
        function(*given)
    assert "\n" not in str(told.value)
