"""The flags that drive a walker, against the functions of the package on the same scene."""

import dataclasses

import jax
import pytest

import jaxbiped as jb
from jaxbiped.cli._scene_options import ActuationOptions, SceneOptions
from tests.cli.commands import numbers_of


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
    rigid = SceneOptions(model="rigid", driven=ActuationOptions(push_off=("impulse=0.2",))).scene()
    assert float(rigid.actuation[0].impulse) == 0.2
    redundant = SceneOptions(formulation="redundant", driven=asked).scene()
    assert len(redundant.actuation) == 3
    assert SceneOptions().scene().actuation is None
    assert jax.tree_util.tree_structure(SceneOptions().scene()) == jax.tree_util.tree_structure(
        jb.seed_scene()
    )


@pytest.mark.slow
def test_a_driven_gait_tells_its_cost(capsys):
    level = ("--model", "rigid", "--slope", "0", "--push-off", "impulse=0.1")
    numbers = numbers_of(capsys, "gait", *level)
    work = numbers["motor_work_J"]
    expected = work / (2.0 * 9.8 * numbers["step_length_m"])
    assert numbers["cost_of_transport"] == pytest.approx(expected, rel=1e-6)
    assert numbers["elasticities"]["impulse"]["speed_m_s"] > 0.1
    assert numbers_of(capsys, "walk", *level, "--duration", "4")["motor_work_J"] > 5.0 * work


@pytest.mark.slow
def test_a_driven_walk_tells_its_work(capsys):
    arguments = ("--slope", "0", "--foot-preload", "extension=0.003", "--duration", "2")
    numbers = numbers_of(capsys, "walk", *arguments)
    assert numbers["actuation_work_J"] > 0.1
    assert abs(numbers["energy_residual_J"]) < 1e-5
    assert 0.01 < numbers["cost_of_transport"] < 0.03
    assert not numbers["warnings"]


def test_models_lists_the_actuators(capsys):
    listed = numbers_of(capsys, "models")["actuation"]
    assert [part["name"] for part in listed] == list(jb.actuation.ACTUATORS)
    assert listed[0]["units"]["k"] == "N·m/rad"
