"""Experiments run at their quick size. A file for each, so that workers can share them."""

import json
import subprocess
import sys
from pathlib import Path

FOLDER = Path(__file__).parents[2] / "experiments"


def quick_numbers(name, folder, *, keys, pictures):
    """Runs an experiment; its numbers, with at least these keys. It must write these pictures."""
    command = [sys.executable, str(FOLDER / f"{name}.py"), "--quick", "--out", str(folder)]
    written = folder / "numbers.json"
    done = subprocess.run(
        [*command, "--json", str(written)],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    numbers = json.loads(written.read_text())
    assert keys <= set(numbers)
    for picture in pictures:
        assert (folder / picture).stat().st_size > 1000, picture
    return numbers
