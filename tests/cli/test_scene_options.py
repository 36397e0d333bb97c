"""Options that describe a scene and a start, against the functions of the package."""

import math
import re

import jax
import pytest

import jaxbiped as jb
from tests.cli.commands import numbers_of, run, walked


def test_flags_build_the_scene():
    scene, _ = walked("--normal hunt-crossley --friction coulomb --set hysteresis=2.5")
    assert isinstance(scene.normal, jb.laws.HuntCrossley)
    assert isinstance(scene.friction, jb.laws.RegularisedCoulomb)
    assert float(scene.normal.hysteresis) == 2.5
    rigid, _ = walked("--model rigid --slope 0.03 --hip-mass 1")
    assert isinstance(rigid, jb.RigidScene)
    assert float(rigid.ground.slope) == 0.03
    assert float(rigid.walker.hip_mass) == 1.0
    held, _ = walked("--formulation redundant --method baumgarte --orientation euler")
    assert isinstance(held, jb.RedundantScene)
    assert isinstance(held.method, jb.constraints.Baumgarte)
    assert held.orientation == "euler"
    assert isinstance(walked("--formulation redundant")[0].method, jb.constraints.Index1)
    seed, _ = walked()
    assert jax.tree.structure(seed) == jax.tree.structure(jb.seed_scene())
    assert jax.tree.leaves(seed) == jax.tree.leaves(jb.seed_scene())


def _help(capsys):
    """What the help of a walk says of its options, by their names."""
    assert run("walk", "--help") == 0
    plain = re.sub(r"\x1b\[[0-9;]*m|[│╭╮╰╯─]", " ", capsys.readouterr().out)
    _, *options = re.split(r"\s--(?=[a-zA-Z])", " ".join(plain.split()))
    return {text.partition(" ")[0]: text for text in options}


def test_help_tells_the_units_of_the_seeds_parameters(capsys):
    """A unit stands at its end."""
    said = _help(capsys)
    for name, quantity in jb.parameter_quantities(jb.seed_scene()).items():
        text = re.split(r" \(| If omitted", said[name.replace("_", "-")])[0]
        assert text.endswith(f" [{quantity.unit}]." if quantity.unit else ".")
        assert ("[" in text) == bool(quantity.unit)


def test_every_actuator_has_a_flag(capsys):
    actuators = list(jb.actuation.ACTUATORS)
    assert [name for name in _help(capsys) if name in actuators] == actuators


def test_flags_make_the_actuators():
    spline = "--hip-spline torque=0.1,0.2,0.3 first=-0.1"
    driven = f"--hip-spring k=0.05 theta_0=0.1 --hip-torque torque=0.1 reaction=trunk {spline}"
    found, _ = walked(f"{driven} --set torque_2=0.7 b=0.001")
    spring, torque, spline = found.actuation
    assert [float(x) for x in (spring.k, spring.b, spring.theta_0)] == [0.05, 0.001, 0.1]
    assert (float(torque.torque), torque.reaction) == (0.1, "trunk")
    assert [float(x) for x in spline.torque] == [0.1, 0.7, 0.3]
    assert float(spline.first) == -0.1
    turned, _ = walked("--hip-spring k=1 theta_0=0 --set theta_0=5deg")
    assert float(turned.actuation[0].theta_0) == pytest.approx(math.radians(5.0))
    rigid, _ = walked("--model rigid --push-off impulse=0.2")
    assert float(rigid.actuation[0].impulse) == 0.2
    redundant, _ = walked(f"--formulation redundant {driven}")
    assert len(redundant.actuation) == 3


def test_what_is_said_stays_as_it_was_said():
    _, start = walked("--K 1e8 --hip-z 0.4 --omega-2 -1")
    assert (float(start.hip_z), float(start.omega_2)) == (0.4, -1.0)
    assert float(start.theta_2) == float(jb.seed_state().theta_2)


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
