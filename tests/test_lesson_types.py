"""Types of the lessons as a user's scripts, against what pyright says of them."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest

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
