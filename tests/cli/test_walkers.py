"""Walkers of commands, against the scenes and walks that they stand for."""

import jax
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.models import MODELS
from tests.cli.commands import numbers_of, outputs_of, refused, starts_of, walked

WALKERS = "seed", "kneed", "with-torso", *MODELS

OWN = """
import jaxbiped as jb
from beside import MASS

legs = tuple(jb.Body(f"leg_{i}", mass=MASS, inertia=0.0096, centre=0.10) for i in (1, 2))
feet = tuple(jb.Foot(f"leg_{i}", centre=0.32, radius=0.08) for i in (1, 2))
walker = jb.Mechanism(bodies=legs, feet=feet, mirror=(("leg_1", "leg_2"),))
number = 3

def make():
    return walker

def of(mass):
    return walker

def broken():
    return 1 / 0
"""


@pytest.fixture
def file(tmp_path):
    """A user's file with walkers, and what it imports beside it."""
    (tmp_path / "beside.py").write_text("MASS = 1.5\n")
    path = tmp_path / "my_walkers.py"
    path.write_text(OWN)
    return path


@pytest.mark.parametrize("name", ["walker", "make"])
def test_a_file_s_walker_is_modelled(name, file):
    own = f"--walker {file}:{name}"
    scene, start = walked(f"{own} --clearance stance-rotation --slope 0.03 --state theta_leg_1=0.2")
    assert scene.mechanism.structure.bodies == ("leg_1", "leg_2")
    assert float(scene.mechanism.total_mass) == 3.0
    assert isinstance(scene.clearance, jb.laws.StanceRotation)
    assert float(scene.ground.slope) == 0.03
    assert isinstance(walked(own)[0].clearance, jb.laws.AlwaysTouching)
    assert float(start.theta_leg_1) == 0.2


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("nobody", "does not define nobody; it defines broken, feet, legs, make"),
        ("number", "it is 3; give a Mechanism"),
        ("of", "raises TypeError: of() missing 1 required"),
        ("broken", "raises ZeroDivisionError: division by zero"),
    ],
)
def test_what_is_no_walker_is_refused(name, words, file, capsys):
    assert words in refused(f"walk --walker {file}:{name}", capsys)


@pytest.mark.parametrize("name", WALKERS)
def test_named_walkers_walk_on_the_usual_slope(name):
    walk = jb.simulate(*walked(f"--walker {name}"), duration=4.0, accuracy="draft", save="end")
    assert walk.outcome is jb.Ending.WALKING


def test_published_walkers_have_scenes_of_their_own_that_flags_change(capsys):
    for name, model in MODELS.items():
        (scene, start), own = walked(f"--walker {name}"), model.make()
        assert jax.tree.all(jax.tree.map(np.array_equal, scene, own)), name
        known, *_ = model.starts.values()
        held = known.get("held")
        numbers = {key: x for key, x in known.items() if key not in ("held", "standing")}
        assert {key: float(getattr(start, key)) for key in numbers} == numbers
        assert held is None or float(start.mode) == float(scene.state(held=held).mode)
    steeper = walked("--walker garcia --slope 0.02 --g 9.8")[0]
    assert (float(steeper.ground.slope), float(steeper.ground.g)) == (0.02, 9.8)
    soft = walked("--walker goswami --model compliant --K 1e7")[0]
    assert (soft.compliant, float(soft.normal.K)) == (True, 1e7)
    assert float(soft.ground.slope) == float(MODELS["goswami"].make().ground.slope)
    pushed = walked("--walker kuo --push-off impulse=0.05")[0]
    assert [float(each.impulse) for each in pushed.actuation] == [0.05]
    assert "no laws of contact" in refused("walk --walker garcia --K 2e6", capsys)
    assert "parameters of its own" in refused("walk --walker garcia --m 2", capsys)


def test_a_start_is_said_by_the_names_of_the_state():
    said = "--state theta_thigh_1=0.2 hip_x=1.5 --standing shank_2"
    scene, start = walked(f"--walker kneed {said}")
    assert (float(start.theta_thigh_1), float(start.hip_x)) == (0.2, 1.5)
    assert float(start.theta_shank_1) == float(walked("--walker kneed")[1].theta_shank_1)
    foot = jb.dynamics.feet(scene, start)[1]
    assert float(foot.penetration) == pytest.approx(0.0, abs=1e-12)
    assert float(foot.slip_speed) == pytest.approx(0.0, abs=1e-12)
    assert walked("--state omega_1=0.3")[1] == walked("--omega-1 0.3")[1]


def test_starts_of_a_file_have_the_names_of_the_state(tmp_path, capsys):
    scene, _ = walked("--walker kneed")
    names = scene.mechanism.structure.coordinates + scene.mechanism.structure.rates
    rows = [",".join(names), *(",".join(f"{k}.{n}" for n in range(len(names))) for k in (0, 1))]
    (tmp_path / "starts.csv").write_text("\n".join(rows))
    starts = starts_of(f"--walker kneed --starts {tmp_path / 'starts.csv'}")
    assert type(starts) is type(scene.state())
    np.testing.assert_array_equal(starts.hip_x, [0.0, 1.0])
    assert "header" in refused(f"basin --starts {tmp_path / 'starts.csv'}", capsys)


def test_walkers_are_listed(capsys):
    listed = {each["name"]: each for each in numbers_of(capsys, "models")["walkers"]}
    assert list(listed) == list(WALKERS)
    assert listed["seed"]["bodies"] == ["1", "2"]
    assert listed["seed"]["parameters"]["l"] == {"value": 0.4, "unit": "m"}
    assert listed["kneed"]["states"] == 12
    assert listed["kneed"]["parameters"]["stop.K"]["unit"] == "N·m/radⁿ"
    assert "slope" not in listed["with-torso"]["parameters"]


@pytest.mark.slow
def test_a_walk_with_a_torso_leaves_everything(tmp_path, capsys):
    flags = ("--walker", "with-torso", "--duration", "2")
    code, folder, figures, numbers = outputs_of(tmp_path, "walk", *flags)
    assert (code, numbers["ending"]) == (0, "walking")
    assert [step["leg"] for step in numbers["steps"]] == ["2", "1"]
    assert set(figures) >= {"strobe.png", "leg_angles.png", "phase_portrait.png"}
    assert (folder / "walk.html").exists()
    assert (folder / "trajectory.nc").exists()
    capsys.readouterr()
