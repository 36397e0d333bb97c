"""The one command over both truths, against the rows that it was given."""

import importlib.util
import json
import sys
from importlib.metadata import version
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "experiments"))
import _truth_table
import footstep_truth
import gradient_truth

ROWS = [
    {"problem": "spring", "way": "ours", "setting": "rtol", "value": 1e-4, "outcome": "answered"}
    | {"state_error": 2e-5, "gradient_error": 3e-5, "said": 4e-3, "seconds": 0.2, "cpu_s": 0.1},
    {"problem": "spring", "way": "another", "setting": "dt", "outcome": "not installed"},
    {"problem": "footstep", "way": "third", "setting": "dt", "value": 1e-3, "outcome": "answered"}
    | {"state_error": 1e-1, "gradient_error": 7.5, "said": None, "seconds": 2.0, "cpu_s": 3.0},
]


def _main():
    path = Path(footstep_truth.__file__).with_name("truth_of_all.py")
    place = importlib.util.spec_from_file_location("truth_of_all", path)
    module = importlib.util.module_from_spec(place)
    place.loader.exec_module(module)
    return module.main


def test_versions_are_those_installed():
    found = _truth_table.versions()
    assert found["jax"] == version("jax")
    assert set(found) == set(_truth_table.PACKAGES)


def test_both_problems_come_in_one_table_and_a_file_each(tmp_path, monkeypatch, capsys):
    for module, rows in ((gradient_truth, ROWS[:2]), (footstep_truth, ROWS[2:])):
        numbers = {"rows": rows, "picture": f"{module.__name__}.png"}
        monkeypatch.setattr(module, "measured", lambda options, numbers=numbers: numbers)
    monkeypatch.setattr(sys, "argv", ["truth_of_all", "--out", str(tmp_path)])
    _main()()
    said = capsys.readouterr().out.splitlines()
    (ours,) = (line for line in said if "ours" in line)
    assert all(word in ours for word in ("2.0e-05", "3.0e-05", "100.0 ms", "4.0e-03"))
    assert any("another" in line and "not installed" in line for line in said)
    assert any("third" in line and line.endswith("nothing") for line in said)
    for name, rows in (("gradient_truth", ROWS[:2]), ("footstep_truth", ROWS[2:])):
        assert json.loads((tmp_path / f"{name}.json").read_text())["rows"] == rows
