"""The matrix of mechanisms, against walks that settle and what is known of its cells; its table."""

import json
import math

import pytest
import quote
from _mechanism_cells import CAPABILITIES
from _mechanisms import PRESSED, cases
from _quote_words import table

import jaxbiped as jb
from tests.experiments.quick import drawn_run

RESULTS = json.loads((quote.RESULTS / "mechanism_matrix.json").read_text())["rows"]
ROWS = {row["capability"]: row["cells"] for row in RESULTS}
NUMBERS = {
    name: {column: value for column, value in cells.items() if not isinstance(value, str)}
    for name, cells in ROWS.items()
}


@pytest.mark.nightly
def test_gaits_are_those_on_which_walks_settle(tmp_path):
    numbers, _ = drawn_run("mechanism_matrix", tmp_path)
    rows = {row["capability"]: row["cells"] for row in numbers["rows"]}
    assert (tmp_path / "mechanism_matrix.md").read_text().startswith("| capability | torso")
    assert rows["operations"]["kneed"] > rows["operations"]["torso on a spring"]
    for name in ("torso on a spring", "kneed"):
        case = cases()[name]
        how = dict(save="end", engine="lanes", accuracy="tight", max_solver_steps=2**18)
        walks = [jb.simulate(case.scene, case.guess, footsteps=n, **how) for n in (40, 41)]
        last = float(walks[1].t[-1] - walks[0].t[-1])
        assert rows["gait"][name] == pytest.approx(last, abs=1e-5)
        assert rows["energy ledger"][name] < 1e-5


@pytest.mark.parametrize("name", cases())
def test_a_start_stands_on_one_body_alone(name):
    case = cases()[name]
    feet = jb.dynamics.feet(case.scene, case.guess)
    bodies = case.scene.mechanism.structure.feet
    standing = case.scene.mechanism.structure.bodies.index(case.standing)
    deepest = max(float(foot.penetration) for foot in feet)
    assert deepest == pytest.approx(PRESSED, rel=1e-9)
    for body, foot in zip(bodies, feet, strict=True):
        assert body == standing or float(foot.penetration) < 1e-3


def test_no_cell_is_empty():
    assert list(ROWS) == list(CAPABILITIES)
    assert all(list(cells) == list(cases()) for cells in ROWS.values())
    for cells in ROWS.values():
        assert all(
            value if isinstance(value, str) else math.isfinite(value) for value in cells.values()
        )


def test_cells_agree_with_what_is_known_of_them():
    for name, cost in NUMBERS["cost of transport"].items():
        slope = float(cases()[name].scene.ground.slope)
        if name != "five links":  # whose motors work
            assert cost == pytest.approx(math.sin(slope), rel=0.1)
    assert NUMBERS["gait"]["seed"] == pytest.approx(0.440835, abs=1e-6)
    assert max(NUMBERS["energy ledger"].values()) < 1e-4
    assert max(NUMBERS["unit multiplier"].values()) < 1e-5
    assert max(NUMBERS["multipliers"].values()) < 1.0
    # The penalty method's own error, larger for light bodies; the other six are within 1e-9.
    assert all(gap < 1e-8 for gap in NUMBERS["redundant coordinates"].values())
    for name, period in NUMBERS["rigid feet"].items():
        assert period == pytest.approx(NUMBERS["gait"][name], rel=0.02)
    for name, time in NUMBERS["bristles"].items():
        assert time == pytest.approx(NUMBERS["walk"][name], rel=0.02)
    assert max(NUMBERS["accuracy=1e-6"].values()) < 1e-6
    assert max(NUMBERS["trade"].values()) < 1e-5
    assert max(NUMBERS["both modes"].values()) < 1e-5
    assert set(NUMBERS["gait_sweep"].values()) == {3}
    assert min(NUMBERS["optimum"].values()) > 0.0
    assert all(abs(error) < 1e-6 for error in NUMBERS["fit"].values())
    assert all(gap < 1e-6 for gap in NUMBERS["both engines"].values())
    for name, elasticity in NUMBERS["gradient"].items():
        assert elasticity == pytest.approx(NUMBERS["sensitivities"][name], rel=1e-4)
    for name, period in NUMBERS["gait without a guess"].items():
        assert period == pytest.approx(NUMBERS["gait"][name], abs=1e-6)


def test_a_refusal_is_listed_once_below_the_table():
    cells = [{"a": 1.5, "b": "no."}, {"a": "no.", "b": 3}]
    rows = [{"capability": n, "number": "m", "cells": c} for n, c in zip("xy", cells, strict=True)]
    assert list(table(rows)) == [
        "| capability | a | b | what the number is |",
        "|---|---|---|---|",
        "| x | 1.5000 | (a) | m |",
        "| y | (a) | 3 | m |",
        "",
        "- (a) no.",
    ]
