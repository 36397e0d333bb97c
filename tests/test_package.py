"""The package as it is published, against one version and one list of requirements."""

import hashlib
import json
import os
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
CONDA_NAMES = {"matplotlib": "matplotlib-base"}
"""Packages that conda calls otherwise."""


def recipe():
    """The recipe for conda, its version filled in."""
    text = (ROOT / "conda" / "meta.yaml").read_text()
    version = re.search(r'set version = "(.+?)"', text)[1]
    text = re.sub(r"\{%.*?%\}", "", text).replace("{{ version }}", version)
    return yaml.safe_load(re.sub(r"\{\{ PYTHON \}\}", "python", text))


def test_every_file_tells_the_same_version():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    meta = json.loads((ROOT / "codemeta.json").read_text())
    versions = {
        PROJECT["version"],
        citation["version"],
        meta["version"],
        str(recipe()["package"]["version"]),
    }
    assert len(versions) == 1
    assert f"## {PROJECT['version']}" in (ROOT / "CHANGELOG.md").read_text()


def test_the_recipe_requires_what_the_package_does():
    wanted = {f"python {PROJECT['requires-python']}"}
    for requirement in PROJECT["dependencies"]:
        name, bounds = re.fullmatch(r"([\w-]+)(.*)", requirement).groups()
        wanted.add(f"{CONDA_NAMES.get(name, name)} {bounds}")
    assert set(recipe()["requirements"]["run"]) == wanted
    (command,) = recipe()["build"]["entry_points"]
    assert command == f"jaxbiped = {PROJECT['scripts']['jaxbiped']}"


@pytest.mark.parametrize(
    ("schema", "paths"),
    [
        ("vendor.github-workflows", sorted((ROOT / ".github" / "workflows").glob("*.yml"))),
        ("custom.github-workflows-require-timeout", sorted((ROOT / ".github").rglob("*.yml"))),
        ("vendor.citation-file-format", [ROOT / "CITATION.cff"]),
    ],
)
def test_files_for_hosts_follow_their_schema(schema, paths):
    command = ["-m", "check_jsonschema", "--builtin-schema", schema, *map(str, paths)]
    assert paths
    checked = subprocess.run([sys.executable, *command], capture_output=True, text=True)
    assert checked.returncode == 0, checked.stdout + checked.stderr


def test_workflows_try_the_versions_of_python_that_are_promised():
    promised = [
        each.rpartition(" ")[2] for each in PROJECT["classifiers"] if "Python :: 3." in each
    ]
    for name, job in (("tests", "tests"), ("wheels", "try")):
        workflow = yaml.safe_load((ROOT / ".github" / "workflows" / f"{name}.yml").read_text())
        assert workflow["jobs"][job]["strategy"]["matrix"]["python"] == promised


def test_numbers_of_the_paper_are_those_of_the_pages():
    """Results that the paper tells stand on pages, which tests hold against the experiments."""
    paper = (ROOT / "paper" / "paper.md").read_text().split("---")[2]
    pages = "".join(
        page.read_text() for page in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
    )
    numbers = re.findall(r"(?<![\w.])(\d+(?:,\d{3})+|\d+\.\d+(?:e-?\d+)?|\d+e-?\d+)(?![\w])", paper)
    assert len(numbers) > 5
    assert [each for each in numbers if each not in pages] == []


def test_the_paper_cites_what_its_bibliography_has():
    cited = set(re.findall(r"@(\w+)", (ROOT / "paper" / "paper.md").read_text()))
    listed = re.findall(r"^@\w+\{(\w+),", (ROOT / "paper" / "paper.bib").read_text(), re.MULTILINE)
    assert cited == set(listed)


def test_shell_completion_knows_the_commands():
    command = [sys.executable, "-c", "from jaxbiped.cli import main; main()"]
    told = subprocess.run(
        [*command, "--tyro-print-completion", "bash"], capture_output=True, text=True, check=True
    )
    for name in ("walk", "gait", "doctor", "optimise"):
        assert name in told.stdout


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Wheels and source distributions of two builds."""
    folders = [tmp_path_factory.mktemp("dist") for _ in range(2)]
    for folder in folders:
        command = ["-m", "build", "--no-isolation", "--outdir", str(folder), str(ROOT)]
        subprocess.run(
            [sys.executable, *command],
            env=os.environ | {"SOURCE_DATE_EPOCH": "1700000000"},
            check=True,
            capture_output=True,
        )
    return folders


@pytest.mark.nightly
def test_builds_are_the_same_to_the_last_byte(built):
    def digests(folder):
        return {
            path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in folder.iterdir()
        }

    first, second = map(digests, built)
    assert len(first) == 2
    assert first == second


@pytest.mark.nightly
def test_the_wheel_alone_passes_its_self_test(built, tmp_path):
    (wheel,) = built[0].glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        archive.extractall(tmp_path / "site")
    assert {"jaxbiped/__init__.pyi", "jaxbiped/py.typed"} <= set(names)
    assert {name.partition("/")[0].partition("-")[0] for name in names} == {"jaxbiped"}
    program = (
        "import jaxbiped, sys; from jaxbiped.cli import main;"
        "assert jaxbiped.__file__.startswith(sys.argv[1]), jaxbiped.__file__; main(['doctor'])"
    )
    (tmp_path / "elsewhere").mkdir()
    told = subprocess.run(
        [sys.executable, "-c", program, str(tmp_path / "site")],
        cwd=tmp_path / "elsewhere",
        env=os.environ | {"PYTHONPATH": str(tmp_path / "site")},
        capture_output=True,
        text=True,
    )
    assert told.returncode == 0, told.stdout + told.stderr
    assert "nothing is wrong" in told.stdout
