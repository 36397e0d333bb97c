"""What is read of declarations without JAX, against what importing them gives."""

import dataclasses
import inspect
import subprocess
import sys

import pytest

import jaxbiped as jb
from jaxbiped._parameter_declaration import parameter_infos
from jaxbiped.cli._declarations import documentation, fields, names, registered, signature
from jaxbiped.cli._gait import _SECTIONS
from jaxbiped.cli._options import Command, Options
from jaxbiped.cli._scene_options import SEED
from jaxbiped.solve._accuracy import GAIT_ACCURACIES
from jaxbiped.solve.solvers import SOLVERS
from jaxbiped.sweep._sweep import CHUNK
from tests.cli.test_refusal import EARLY


@pytest.mark.parametrize(
    ("read", "registry"),
    [
        (registered("laws", "normal"), jb.laws.NORMAL_LAWS),
        (registered("laws", "friction"), jb.laws.FRICTION_LAWS),
        (registered("actuation"), jb.actuation.ACTUATORS),
        (names("constraints.CONSTRAINT_METHODS"), jb.constraints.CONSTRAINT_METHODS),
        (names("constraints.ORIENTATIONS"), jb.constraints.ORIENTATIONS),
        (names("ENGINES"), jb.ENGINES),
        (names("solvers.SOLVERS"), SOLVERS),
        (names("ACCURACIES"), jb.ACCURACIES),
        (names("ACCURACIES"), GAIT_ACCURACIES),
        (names("starts.SAMPLINGS"), jb.starts.SAMPLINGS),
        (names("optimise.OPTIMISERS"), jb.optimise.OPTIMISERS),
    ],
)
def test_names_are_those_of_the_registry_in_its_order(read, registry):
    assert list(read) == list(registry)


def test_sections_are_the_package_s():
    assert {name: type(getattr(jb, kind)()).__name__ for name, kind in _SECTIONS.items()} == {
        "mid-stance": "MidStance",
        "heel-strike": "HeelStrike",
    }


def test_the_chunk_is_the_sweep_s():
    assert signature("sweep")["chunk"].default == CHUNK


@pytest.mark.parametrize(
    "name",
    [
        "seed_scene", "simulate", "find_gait", "continue_gait", "fit_gait", "optimise_gait",
        "optimise.certify", "labelling", "sweep", "starts.sample", "starts.grid",
    ],
)  # fmt: skip
def test_defaults_are_those_of_the_function(name):
    function = jb
    for part in name.split("."):
        function = getattr(function, part)
    own = inspect.signature(function).parameters
    read = signature(name)
    assert len(read) > 1
    for argument, (default, said, _) in read.items():
        assert default == own[argument].default
        assert said.endswith(".")


def test_fields_of_an_actuator_are_its_own():
    for name, kind in jb.actuation.ACTUATORS.items():
        read = fields(registered("actuation")[name])
        assert list(read) == [field.name for field in dataclasses.fields(kind)]


def test_the_seed_s_parameters_are_those_of_its_scene():
    named = inspect.signature(jb.seed_scene).parameters.items()
    usual = {name: each.default for name, each in named if each.kind is each.KEYWORD_ONLY}
    assert {name: each.default for name, each in SEED.items()} == usual
    scene = jb.seed_scene()
    parts = (scene.walker, scene.ground, scene.normal, scene.friction)
    declared = {name: info for part in parts for name, info in parameter_infos(part).items()}
    assert set(SEED) == set(declared)
    for name, parameter in SEED.items():
        assert parameter.info == declared[name]


def test_help_tells_the_seed_s_start():
    said = documentation("jaxbiped.cli._start_options", "StartOptions")
    for name, value in jb.seed_state()._asdict().items():
        assert f"the seed's is {float(value):g}" in said[name]


def test_help_is_ascii():
    """Where a terminal can print nothing else, help is help all the same."""
    kinds = [*Options.__subclasses__(), *Command.__subclasses__()]
    assert len(kinds) > 15
    for field in (field for kind in kinds for field in dataclasses.fields(kind)):
        (said,) = (each.help for each in field.type.__metadata__ if getattr(each, "help", None))
        assert said.isascii(), said


_ASK = """
import contextlib, io, shlex, sys
from jaxbiped.cli import main
for text in sys.stdin.read().splitlines():
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            main(shlex.split(text))
        code = 0
    except SystemExit as ended:
        code = ended.code
    print(code, sys.argv[1] in sys.modules, text)
"""
_ANSWERED = ("--help", "walk --help", "gait --help", "basin --help", "--version", "version")


def _answers(module, asked):
    """To each command line: exit code, and whether a module was imported by then."""
    ran = subprocess.run(
        [sys.executable, "-c", _ASK, module],
        input="\n".join(asked), capture_output=True, text=True, check=True,
    )  # fmt: skip
    told = [line.split(" ", 2) for line in ran.stdout.splitlines()]
    assert [text for _, _, text in told] == list(asked)
    return {text: (int(code), imported == "True") for code, imported, text in told}


def test_help_and_unknown_options_do_without_numpy():
    answers = _answers("numpy", ("--help", "gait --help", "gait --slopee 3", "wlak"))
    assert [imported for _, imported in answers.values()] == [False] * 4


def test_help_and_refusals_do_without_jax():
    refused = [row[0] for row in EARLY]
    expected = dict.fromkeys(_ANSWERED, (0, False)) | dict.fromkeys(refused, (2, False))
    assert _answers("jax", [*_ANSWERED, *refused]) == expected
