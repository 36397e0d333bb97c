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
from jaxbiped.solve._solvers import SOLVERS
from jaxbiped.sweep._sweep import CHUNK


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
    said = documentation("jaxbiped.cli._scene_options", "StartOptions")
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
import contextlib, io, sys
from jaxbiped.cli import main
for text in sys.stdin.read().splitlines():
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            main(text.split())
        code = 0
    except SystemExit as ended:
        code = ended.code
    print(code, "jax" in sys.modules, text)
"""
_ANSWERED = ("--help", "walk --help", "gait --help", "basin --help", "--version", "version")
_REFUSED = (
    "wlak", "walk --slop 1", "walk --slope nan", "walk --slope 2", "walk --K -1", "walk --n x",
    "walk --l 0.01", "walk --hip-z inf", "walk --normal glue", "walk --set K", "walk --dt 0",
    "walk --model rigid --K 5", "walk --method index1", "walk --duration -1", "walk --solver rk",
    "walk --accuracy rough", "walk --accuracy -1", "walk --hip-spring stiff",
    "gait --friction nonsense", "gait --section foot", "gait --footsteps 0", "gait --engine gpu",
    "continue --accuracy rough", "continue --from nan", "basin --x K", "basin --samples 0",
    "basin --sampling best", "basin --workers 0", "fit missing.json --vary K",
    "optimise --vary d --optimiser best", "constraints --methods glue",
    "constraints --integrators euler", "trade --repeats 0", "models --json /nowhere/models.json",
    "walk --json /nowhere/walk.json", "constraints --json /nowhere/constraints.json",
)  # fmt: skip


def test_help_and_unknown_options_do_without_numpy():
    asked = "--help\ngait --help\ngait --slopee 3\nwlak"
    script = _ASK.replace('"jax" in', '"numpy" in')
    ran = subprocess.run(
        [sys.executable, "-c", script], input=asked, capture_output=True, text=True, check=True
    )
    imported = [line.split(" ", 2)[1] for line in ran.stdout.splitlines()]
    assert imported == ["False"] * 4


def test_help_and_refusals_do_without_jax():
    asked = "\n".join((*_ANSWERED, *_REFUSED))
    ran = subprocess.run(
        [sys.executable, "-c", _ASK], input=asked, capture_output=True, text=True, check=True
    )
    answers = [line.split(" ", 2) for line in ran.stdout.splitlines()]
    assert [text for _, _, text in answers] == [*_ANSWERED, *_REFUSED]
    for code, imported, text in answers:
        assert (code, imported) == ("0" if text in _ANSWERED else "2", "False"), text
