"""`jaxbiped models` and what is modelled, against the registries."""

import numpy as np
import pytest
from reference.rigid import rigid_walker

import jaxbiped as jb
from tests.cli.commands import numbers_of, outputs_of, run, walked


def test_lists_every_law_with_units_and_cost(capsys):
    assert run("models") == 0
    table = capsys.readouterr().out
    assert "hunt-crossley" in table
    assert "N·s/m²" in table
    listed = numbers_of(capsys, "models")
    assert {law["name"] for law in listed["normal"]} == set(jb.laws.NORMAL_LAWS)
    assert {law["name"] for law in listed["friction"]} == set(jb.laws.FRICTION_LAWS)
    assert [rung["name"] for rung in listed["rungs"]] == list(jb.ladder())
    for law in listed["normal"] + listed["friction"]:
        assert law["operations"] > 0
        assert all(entry["unit"] for entry in law["parameters"].values())
    assert [part["name"] for part in listed["actuation"]] == list(jb.actuation.ACTUATORS)
    assert listed["actuation"][0]["units"]["k"] == "N·m/rad"
    by_name = {rung["name"]: rung for rung in listed["rungs"]}
    assert by_name["rigid"]["states"] == 5
    assert by_name["bristles"]["states"] == 10
    assert by_name["rigid"]["operations"] < 0.5 * by_name["stribeck"]["operations"]


@pytest.mark.slow
def test_rigid_walk_and_gait(tmp_path, capsys):
    flags = ("--model", "rigid", "--duration", "4")
    code, folder, _, numbers = outputs_of(tmp_path, "walk", *flags)
    assert code == 0
    assert (numbers["ending"], numbers["model"]) == ("walking", "rigid")
    assert (numbers["footsteps"], numbers["warnings"]) == (len(numbers["steps"]), [])
    assert numbers["steps"][-1]["period_s"] == pytest.approx(0.4438, abs=2e-4)
    assert numbers["steps"][-1]["length_m"] == pytest.approx(0.1904, abs=2e-4)
    pictures = ("leg_angles.png", "phase_portrait.png", "strobe.png", "walk.html")
    assert all((folder / name).exists() for name in pictures)
    assert numbers["solver"]["rtol"] == 1e-6
    capsys.readouterr()
    assert numbers_of(capsys, "walk", *flags, "--accuracy", "tight")["solver"]["rtol"] == 1e-11
    told = outputs_of(tmp_path, "walk", *flags, "--accuracy", "1e-5").numbers
    assert told["error"]["met"]
    assert told["error"]["relative"] <= 1e-5
    assert told["solver"]["rtol"] == told["error"]["rtol"]
    assert "of 1e-05 allowed" in capsys.readouterr().out
    code, _, _, numbers = outputs_of(tmp_path, "gait", "--model", "rigid")
    assert code == 0
    assert numbers["period_s"] == pytest.approx(0.44378, abs=5e-6)
    assert set(numbers["state"]) == set(jb.dynamics.RigidState._fields)
    # By multipliers of Lagrange for the rolling foot, along an integration of their own.
    state = jb.dynamics.RigidState(**numbers["state"])
    walker = rigid_walker(walked("--model rigid")[0])
    needed = walker.needed_friction(state[1:])
    assert numbers["assumptions"]["needed_friction"] == pytest.approx(needed, rel=1e-9)
    solved = walker.until_strike(np.array(state[1:]))
    _, normal = walker.force(solved.sol(np.linspace(0.0, solved.t_events[0][0], 1001)))
    least = numbers["assumptions"]["least_normal_N"]
    assert least == pytest.approx(np.min(normal), rel=1e-6)
    said = f"a real foot needs a friction coefficient of {needed:.3f}"
    assert said in capsys.readouterr().out
