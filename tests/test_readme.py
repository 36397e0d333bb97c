"""The README's blocks of Python run as printed, from top to bottom, in one session."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

README = Path(__file__).parents[1] / "README.md"
BLOCKS = re.findall(r"^```python\n(.*?)^```$", README.read_text(), flags=re.MULTILINE | re.DOTALL)


@pytest.fixture(scope="module")
def printed(tmp_path_factory):
    """The lines that a reader sees who copies block after block into one session."""
    folder = tmp_path_factory.mktemp("readme")
    (folder / "page.py").write_text("\n".join(BLOCKS))
    ran = subprocess.run(
        [sys.executable, "page.py"], cwd=folder, capture_output=True, text=True, timeout=900
    )
    assert ran.returncode == 0, ran.stderr[-3000:]
    return ran.stdout.splitlines()


def test_every_block_of_the_page_is_found():
    assert len(BLOCKS) == README.read_text().count("```python") > 5


@pytest.mark.slow
def test_the_first_block_prints_what_the_page_says(printed):
    said = re.findall(r"^print\(.*\)  # (\w[\w.]*)", BLOCKS[0], flags=re.MULTILINE)
    assert len(said) == 2
    for words, line in zip(said, printed, strict=False):
        assert line.startswith(words), (words, line)
