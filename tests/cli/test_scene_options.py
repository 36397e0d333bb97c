"""Options that describe a scene and a start, against the functions of the package."""

import dataclasses
import math

import jax
import pytest

import jaxbiped as jb
from jaxbiped.cli._scene_options import SEED, ActuationOptions, SceneOptions
from jaxbiped.cli._start_options import StartOptions
from tests.cli.commands import numbers_of


def test_flags_build_the_scene():
    scene = SceneOptions(
        normal="hunt-crossley", friction="coulomb", set=("hysteresis=2.5",)
    ).scene()
    assert isinstance(scene.normal, jb.laws.HuntCrossley)
    assert isinstance(scene.friction, jb.laws.RegularisedCoulomb)
    assert float(scene.normal.hysteresis) == 2.5
    rigid = SceneOptions(model="rigid", slope=0.03, hip_mass=1.0).scene()
    assert isinstance(rigid, jb.RigidScene)
    assert float(rigid.ground.slope) == 0.03
    assert float(rigid.walker.hip_mass) == 1.0
    held = SceneOptions(formulation="redundant", method="baumgarte", orientation="euler").scene()
    assert isinstance(held, jb.RedundantScene)
    assert isinstance(held.method, jb.constraints.Baumgarte)
    assert held.orientation == "euler"
    assert isinstance(SceneOptions(formulation="redundant").scene().method, jb.constraints.Index1)
    seed = SceneOptions().scene()
    assert jax.tree.structure(seed) == jax.tree.structure(jb.seed_scene())
    assert jax.tree.leaves(seed) == jax.tree.leaves(jb.seed_scene())


def test_help_tells_the_units_of_the_seeds_parameters():
    """A unit stands at its end."""
    for name, quantity in jb.parameter_quantities(jb.seed_scene()).items():
        said = SEED[name].help
        assert said.endswith(f" [{quantity.unit}]." if quantity.unit else ".")
        assert ("[" in said) == bool(quantity.unit)


def test_every_actuator_has_a_flag():
    fields = [field.name.replace("_", "-") for field in dataclasses.fields(ActuationOptions)]
    assert fields == list(jb.actuation.ACTUATORS)


def test_flags_make_the_actuators():
    asked = ActuationOptions(
        hip_spring=("k=0.05", "theta_0=0.1"),
        hip_torque=("torque=0.1", "reaction=trunk"),
        hip_spline=("torque=0.1,0.2,0.3", "first=-0.1"),
    )
    found = SceneOptions(driven=asked, set=("torque_2=0.7", "b=0.001")).scene()
    spring, torque, spline = found.actuation
    assert [float(x) for x in (spring.k, spring.b, spring.theta_0)] == [0.05, 0.001, 0.1]
    assert (float(torque.torque), torque.reaction) == (0.1, "trunk")
    assert [float(x) for x in spline.torque] == [0.1, 0.7, 0.3]
    assert float(spline.first) == -0.1
    sprung = ActuationOptions(hip_spring=("k=1", "theta_0=0"))
    turned = SceneOptions(driven=sprung, set=("theta_0=5deg",)).scene()
    assert float(turned.actuation[0].theta_0) == pytest.approx(math.radians(5.0))
    rigid = SceneOptions(model="rigid", driven=ActuationOptions(push_off=("impulse=0.2",))).scene()
    assert float(rigid.actuation[0].impulse) == 0.2
    redundant = SceneOptions(formulation="redundant", driven=asked).scene()
    assert len(redundant.actuation) == 3


def test_what_is_said_stays_as_it_was_said():
    options = StartOptions(hip_z=0.4, omega_2=-1.0)
    assert options.given == {"hip_z": 0.4, "omega_2": -1.0}
    start = options.start(jb.seed_scene(K=1e8))
    assert (float(start.hip_z), float(start.omega_2)) == (0.4, -1.0)
    assert float(start.theta_2) == float(jb.seed_state().theta_2)
    assert StartOptions().given == {}


@pytest.mark.slow
def test_a_driven_gait_tells_its_cost(capsys):
    level = ("--model", "rigid", "--slope", "0.002", "--push-off", "impulse=0.1")
    numbers = numbers_of(capsys, "gait", *level)
    work = numbers["motor_work_J"]
    expected = work / (2.0 * 9.8 * numbers["step_length_m"]) + math.sin(0.002)
    assert numbers["cost_of_transport"] == pytest.approx(expected, rel=1e-6)
    assert numbers["elasticities"]["impulse"]["speed_m_s"] > 0.1
    assert numbers_of(capsys, "walk", *level, "--duration", "4")["motor_work_J"] > 5.0 * work
    assert "cost_of_transport" not in numbers_of(capsys, "walk", *level, "--duration", "0.05")


@pytest.mark.slow
def test_a_driven_walk_tells_its_work(capsys):
    arguments = ("--slope", "0", "--foot-preload", "extension=0.003", "--duration", "2")
    numbers = numbers_of(capsys, "walk", *arguments)
    assert numbers["actuation_work_J"] > 0.1
    assert abs(numbers["energy_residual_J"]) < 1e-5
    assert 0.01 < numbers["cost_of_transport"] < 0.03
    assert not numbers["warnings"]
