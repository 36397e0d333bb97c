"""The walk-through of CONTRIBUTING, against a copy of the project that follows it."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SECTION = re.search(
    r"^## Adding a friction law\n(.*?)^## ",
    (ROOT / "CONTRIBUTING.md").read_text(),
    flags=re.MULTILINE | re.DOTALL,
)[1]
STEPS = re.findall(
    r"^\*\*\d\. .*?`([\w/.]+)`.*?^```python\n(.*?)^```$", SECTION, flags=re.MULTILINE | re.DOTALL
)


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    """The project with the law of the walk-through in it."""
    root = tmp_path_factory.mktemp("copy")
    ignored = shutil.ignore_patterns("__pycache__")
    for folder in ("jaxbiped", "tests"):
        shutil.copytree(ROOT / folder, root / folder, ignore=ignored)
    shutil.copy(ROOT / "pyproject.toml", root)
    for name, code in STEPS:
        path = root / name
        if path.exists():
            # A registry line: behind the last one of its kind.
            kind = code[: code.rindex("._")]
            lines = path.read_text().splitlines(keepends=True)
            last = max(k for k, line in enumerate(lines) if line.startswith(kind))
            code = "".join([*lines[: last + 1], code, *lines[last + 1 :]])
        path.write_text(code)
    return root


def _run(root, *arguments):
    environment = os.environ | {"PYTHONPATH": str(root)}
    return subprocess.run(
        [sys.executable, "-m", *arguments],
        cwd=root, env=environment, capture_output=True, text=True, timeout=600,
    )  # fmt: skip


def test_it_is_one_new_file_one_line_and_one_test():
    new = [name for name, _ in STEPS if not (ROOT / name).exists()]
    assert [name for name, _ in STEPS if name not in new] == ["jaxbiped/scene/laws/__init__.py"]
    assert len(STEPS[1][1].splitlines()) == 1
    assert len(new) == 2


@pytest.mark.nightly
def test_its_test_and_those_over_all_laws_pass(copy):
    files = [name for name, _ in STEPS if name.startswith("tests/")]
    ran = _run(
        copy, "pytest", *files, "tests/scene/laws/test_catalogue.py", "-k", "algebraic or name"
    )
    assert ran.returncode == 0, ran.stdout[-3000:]
    collected = _run(copy, "pytest", "--collect-only", "tests/scene/laws/test_catalogue.py")
    assert "resemble_the_seeds[algebraic]" in collected.stdout


@pytest.mark.nightly
def test_the_walker_walks_on_it(copy):
    ran = _run(copy, "jaxbiped", "walk", "--friction", "algebraic", "--duration", "1.5")
    assert ran.returncode == 0, ran.stderr
    assert "walking" in ran.stdout


@pytest.mark.nightly
def test_the_checks_of_style_and_types_pass(copy):
    path = next(name for name, _ in STEPS if "friction" in name)
    for command in (("ruff", "check"), ("ruff", "format", "--check")):
        ran = _run(copy, *command, path, "jaxbiped/scene/laws/__init__.py", "tests/scene/laws")
        assert ran.returncode == 0, ran.stdout
