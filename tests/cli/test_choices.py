"""What options choose from without JAX, against what the registries hold."""

import inspect
import subprocess
import sys

import pytest

import jaxbiped as jb
from jaxbiped._parameter_declaration import parameter_infos
from jaxbiped.cli import _choices
from jaxbiped.cli import _gait as gait_command
from jaxbiped.solve._accuracy import GAIT_ACCURACIES
from jaxbiped.solve._solvers import SOLVERS
from jaxbiped.sweep._sweep import CHUNK


@pytest.mark.parametrize(
    ("names", "registry"),
    [
        (_choices.normal_law_names(), jb.laws.NORMAL_LAWS),
        (_choices.friction_law_names(), jb.laws.FRICTION_LAWS),
        (_choices.CONSTRAINT_METHODS, jb.constraints.CONSTRAINT_METHODS),
        (_choices.ORIENTATIONS, jb.constraints.ORIENTATIONS),
        (_choices.ENGINES, jb.ENGINES),
        (_choices.SOLVERS, SOLVERS),
        (_choices.ACCURACIES, jb.ACCURACIES),
        (_choices.GAIT_ACCURACIES, GAIT_ACCURACIES),
        (_choices.SECTIONS, gait_command._SECTIONS),
        (_choices.SAMPLINGS, jb.starts.SAMPLINGS),
        (_choices.OPTIMISERS, jb.optimise.OPTIMISERS),
    ],
)
def test_names_are_those_of_the_registry_in_its_order(names, registry):
    assert list(names) == list(registry)


def test_the_chunk_is_the_sweep_s():
    assert _choices.CHUNK == CHUNK


def test_the_seed_s_parameters_are_those_of_its_scene():
    named = inspect.signature(jb.seed_scene).parameters.items()
    usual = {name: each.default for name, each in named if each.kind is each.KEYWORD_ONLY}
    assert {name: each.value for name, each in _choices.SEED.items()} == usual
    scene = jb.seed_scene()
    parts = (scene.walker, scene.ground, scene.normal, scene.friction)
    declared = {name: info for part in parts for name, info in parameter_infos(part).items()}
    assert set(_choices.SEED) == set(declared)
    for name, (_, info) in _choices.SEED.items():
        assert info.quantity.unit == declared[name].quantity.unit
        assert info[1:] == declared[name][1:], name


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
