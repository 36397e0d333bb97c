"""What commands ask of the package's functions, against what their options say."""

import json

import pytest

import jaxbiped as jb
from tests.cli.commands import asked as asked_by


@pytest.mark.parametrize(
    ("command", "door", "asked"),
    [
        (
            "gait --footsteps 2 --accuracy 1e-4 --engine lanes",
            "find_gait",
            dict(footsteps=2, accuracy=1e-4, engine="lanes", section=None),
        ),
        (
            "gait --model rigid",
            "find_gait",
            dict(footsteps=None, accuracy="balanced", engine="auto", section=None),
        ),
        (
            "continue --along K --from 1e5 --to 2e6 --footsteps 2 --log True --largest-step 0.1 "
            "--max-points 7 --accuracy tight --engine xla",
            "continue_gait",
            dict(bounds=(1e5, 2e6), guess=None, footsteps=2, log=True, largest_step=0.1,
                 max_points=7, accuracy="tight", engine="xla"),
        ),
        (
            "continue --model rigid --from 1deg --to 0.05",
            "continue_gait",
            dict(bounds=(pytest.approx(0.0174532925), 0.05), guess=None, footsteps=None, log=None,
                 largest_step=0.02, max_points=200, accuracy="balanced", engine="auto"),
        ),
        (
            "optimise --vary d=5cm:0.2 --minimise period --subject-to 'speed>0.1' --optimiser "
            "slsqp --iterations 3 --restarts 2 --seed 5 --footsteps 9",
            "optimise_gait",
            dict(vary={"d": (0.05, 0.2)}, minimise="period", maximise=None,
                 subject_to=("speed>0.1",), optimiser="slsqp", iterations=3, restarts=2, seed=5,
                 segments=7, accuracy="balanced", engine="auto", store=None),
        ),
        (
            "optimise --vary d=0.1:0.2 --minimise torque_squared --search together --segments 5",
            "optimise_gait",
            dict(vary={"d": (0.1, 0.2)}, minimise="torque_squared", maximise=None, subject_to=None,
                 formulation="together", segments=5, optimiser="trust-region", iterations=200,
                 restarts=0, seed=0, accuracy="balanced", engine="auto", store=None),
        ),
        (
            "basin --accuracy 1e-3 --footsteps 9 --engine lanes",
            "labelling",
            dict(parameters={}, accuracy=1e-3, footsteps=9, engine="lanes"),
        ),
        (
            "walk --duration 2 --solver rodas4 --rtol 1e-8 --max-solver-steps 99 --engine lanes",
            "Simulation.prepare",
            dict(duration=2.0, solver="rodas4", rtol=1e-8, atol=None, dt=None,
                 max_solver_steps=99, engine="lanes"),
        ),
        (
            "walk --duration 500ms --accuracy draft --atol 1e-9",
            "Simulation.prepare",
            dict(duration=0.5, solver="rodas4p", accuracy="draft", atol=1e-9, dt=None,
                 max_solver_steps=65536, engine="auto"),
        ),
        (
            "walk --duration 40 --solver euler --dt 1e-5",
            "Simulation.prepare",
            dict(duration=40.0, solver="euler", rtol=1e-6, atol=None, dt=1e-5,
                 max_solver_steps=1 << 20, engine="auto"),
        ),
        (
            "walk --duration 40 --model rigid",
            "rigid_walk",
            dict(duration=40.0, engine="auto", max_arrivals=4096, max_solver_steps=4 * 65536,
                 rtol=1e-6),
        ),
        (
            "walk --duration 1e4 --model rigid --accuracy 1e-5",
            "rigid_walk",
            dict(duration=1e4, engine="auto", max_arrivals=4096, max_solver_steps=1 << 20,
                 accuracy=1e-5),
        ),
        (
            "constraints --duration 0.1 --repeats 2 --methods standard index1",
            "cli._constraints.compare_constraints",
            dict(duration=0.1, methods=("standard", "index1"), repeats=2, integrators=[
                ("rodas4", 1e-6, None), ("euler", None, 1e-6), ("runge2", None, 1e-6)]),
        ),
    ],
)  # fmt: skip
def test_options_are_handed_on_by_their_names(command, door, asked):
    assert asked_by(command, door)[1] == asked


@pytest.mark.parametrize("name", ["MidStance", "HeelStrike"])
def test_a_section_is_asked_for(name):
    words = {"MidStance": "mid-stance", "HeelStrike": "heel-strike"}
    asked = asked_by(f"gait --section {words[name]}", "find_gait")[1]
    assert type(asked["section"]) is getattr(jb, name)


def test_a_basin_along_a_parameter_asks_for_its_gaits():
    command = "basin --x theta_swing=-0.1:0.2:3 --y slope=0.01:0.02:2"
    asked = asked_by(command, "labelling")[1]
    values = asked.pop("parameters")
    assert {name: list(each) for name, each in values.items()} == {"slope": [0.01, 0.02]}
    assert asked == dict(accuracy="draft", footsteps=30, engine="auto")


def test_a_fit_is_asked_for_its_names_and_its_gaits(tmp_path):
    path = tmp_path / "measured.json"
    path.write_text(json.dumps({"gaits": [{"period_s": [0.44, 1e-3]}]}))
    command = f"fit {path} --vary ' K, c' --max-evaluations 7 --engine lanes"
    (scene, names, measured), how = asked_by(command, "fit_gait")
    assert (type(scene), names) == (jb.Scene, ("K", "c"))
    assert [each.measures for each in measured] == [{"period": (0.44, 1e-3)}]
    assert how == dict(max_evaluations=7, engine="lanes", accuracy="balanced")


def test_a_start_that_is_said_is_the_guess():
    (_, guess), _ = asked_by("gait --theta-1 -0.3", "find_gait")
    assert float(guess.theta_1) == -0.3
    assert float(guess.theta_2) == float(jb.seed_state().theta_2)


def test_none_stands_for_what_is_not_said():
    command = "walk --rtol None --slope None --dt 1ms"
    (scene, _), how = asked_by(command, "Simulation.prepare")
    assert (how["rtol"], how["dt"]) == (1e-6, 1e-3)
    assert float(scene.ground.slope) == float(jb.seed_scene().ground.slope)
