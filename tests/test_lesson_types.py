"""Types of the lessons and of documented calls, against what pyright and mypy say of them."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest

import jaxbiped as jb
from tests import documented_calls

ROOT = Path(__file__).parents[1]


@pytest.mark.nightly
def test_each_lesson_passes_pyright_as_a_script(tmp_path):
    checker = shutil.which("pyright")
    if checker is None:
        pytest.skip("no pyright (npm install --global pyright)")
    for path in sorted((ROOT / "notebooks").glob("*.ipynb")):
        cells = nbformat.read(path, as_version=4).cells
        code = "\n".join(cell.source for cell in cells if cell.cell_type == "code")
        script = re.sub(r"^%.*$", "", code, flags=re.MULTILINE)
        (tmp_path / f"{path.stem}.py").write_text(script + "\n")
    settings = {"typeCheckingMode": "standard", "extraPaths": [str(ROOT)]}
    (tmp_path / "pyrightconfig.json").write_text(json.dumps(settings))
    command = [checker, "--project", str(tmp_path), "--pythonpath", sys.executable]
    ended = subprocess.run(command, capture_output=True, text=True)
    assert ended.returncode == 0, ended.stdout


def test_documented_calls_do_what_they_say():
    """mypy reads them with the package (`make check`); here they are made."""
    mechanism = documented_calls.mechanism()
    first, second, _, head = mechanism.bodies
    assert float(first.centre.along) == float(second.centre.along) == 0.1
    assert float(head.at.along) == -0.3
    assert mechanism.joints[0].angle == (("leg_1", 1.0), ("leg_2", -1.0))
    rigid, driven, one_leg, redundant = documented_calls.scenes()
    assert (len(rigid.actuation), len(driven.actuation)) == (1, 2)
    assert one_leg.clearance.leg == "1"
    assert isinstance(redundant.method, jb.constraints.CONSTRAINT_METHODS["baumgarte"])


@pytest.mark.nightly
def test_documented_calls_pass_mypy_as_a_script(tmp_path):
    path = tmp_path / "script.py"
    path.write_text(Path(documented_calls.__file__).read_text())
    command = [sys.executable, "-m", "mypy", "--cache-dir", str(tmp_path), str(path)]
    environment = os.environ | {"MYPYPATH": str(ROOT)}
    ended = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert ended.returncode == 0, ended.stdout
