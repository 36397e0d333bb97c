"""What the command line refuses, against one sentence on stderr and exit code 2."""

import json
from pathlib import Path

import jax
import numpy as np
import pytest

from jaxbiped.cli import Report, main
from jaxbiped.cli._refusal import one_sentence


def _refused(arguments, capsys):
    with pytest.raises(SystemExit) as stopped:
        main(arguments)
    assert stopped.value.code == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    (line,) = printed.err.splitlines()
    assert line.startswith("jaxbiped: ")
    assert not set("│╭╮╰╯─") & set(line)
    return line


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["walk", "--slop", "3"], ("--slop", "perhaps you meant --slope")),
        (["walk", "--slope", "abc"], ("--slope", "'abc'", "float")),
        (["walk", "--hip-z", "abc"], ("--hip-z", "'abc'", "FLOAT")),
        (["basin", "--samples", "1.5"], ("--samples", "'1.5'", "INT")),
        (["walk", "--out"], ("--out", "missing value")),
        (["wlak"], ("wlak", "walk, gait, continue, optimise, fit, basin")),
        ([], ("walk, gait, continue, optimise, fit, basin",)),
    ],
)
def test_what_the_parser_refuses(arguments, words, capsys):
    line = _refused(arguments, capsys)
    assert all(word in line for word in words)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["walk", "--duration", "inf"], ("duration = inf", "finite")),
        (["walk", "--model", "rigid", "--duration", "inf"], ("duration = inf", "finite")),
        (["walk", "--max-solver-steps", "0"], ("max_solver_steps = 0", "whole number above 0")),
        (["walk", "--solver", "euler"], ("solver = euler", "dt = 1e-6")),
        (["walk", "--solver", "euler", "--dt", "1e-6"], ("10 s", "max_solver_steps = 1048576")),
        (["walk", "--model", "rigid", "--dt", "1e-6"], ("dt = 1e-06", "rigid")),
        (["walk", "--n", "0"], ("n = 0 is not allowed: it must be at least 1.",)),
        (["walk", "--J", "0"], ("J = 0", "hip_mass = 0")),
        (["walk", "--set", "K=abc"], ("K must be a number", "'abc'")),
        (["walk", "--set", "=3"], ("set = '=3'", "name=value")),
        (["gait", "--footsteps", "-2"], ("footsteps = -2", "whole number above 0")),
        (["walk", "--model", "rigid", "--method", "index1"], ("method = index1", "rigid")),
        (["walk", "--method", "index1"], ("method = index1", "--formulation redundant")),
        (["walk", "--r", "0.5"], ("l = 0.4 and r = 0.5", "l must be at least r")),
        (["walk", "--set", "K=1e6", "--K", "2e6"], ("K = 2e+06", "set = 'K=1e+06'", "one of them")),
        (["walk", "--accuracy", "draft", "--rtol", "1e-8"], ("rtol = 1e-08", "accuracy = draft")),
        (["walk", "--dt", "1e-6", "--rtol", "1e-8"], ("rtol = 1e-08", "dt = 1e-06")),
        (["walk", "--normal", "hertz", "--c", "1"], ("c = 1", "normal = hertz")),
        (["gait", "--friction", "coulomb", "--xi", "9"], ("xi = 9", "friction = coulomb")),
        (["walk", "--json", "~/no/such"], ("no/such' cannot be written",)),
        (["walk", "--hip-z", "0.2"], ("hip_z = 0.2", "0.196 m below the ground", "0.3956")),
        (["walk", "--hip-z", "0"], ("hip_z = 0", "below the ground")),
        (["walk", "--hip-z", "-5"], ("hip_z = -5", "below the ground")),
    ],
)
def test_each_sentence_names_what_is_wrong(arguments, words, capsys):
    line = _refused(arguments, capsys)
    assert all(word in line for word in words)


def test_a_box_with_borders_and_colours_is_the_same_sentence():
    plain = """
 Unrecognized options
 --------------------------------
  Unrecognized options: --slop, 3
  --------------------------------
  Perhaps you meant:
      --slope FLOAT
          Angle of the slope.
"""
    framed = """
\x1b[31m╭─\x1b[0m \x1b[31;1mUnrecognized options\x1b[0m ─────────╮
│ Unrecognized options: \x1b[1m--slop, 3\x1b[0m │
│ ─────────────────────────────── │
│ Perhaps you meant:              │
│     --slope FLOAT               │
╰─────────────────────────────────╯
"""
    expected = "unrecognized options: --slop, 3; perhaps you meant --slope."
    assert one_sentence(plain) == one_sentence(framed) == expected


def test_what_is_no_box_still_says_something():
    assert "--help" in one_sentence("")


@pytest.mark.parametrize("arguments", [["--version"], ["version"]])
def test_the_version(arguments, capsys):
    main(arguments)
    assert capsys.readouterr().out.strip().count(".") == 2


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("JAXBIPED_THREADS", "two", "a whole number of threads above 0"),
        ("JAXBIPED_THREADS", "0", "a whole number of threads above 0"),
        ("JAXBIPED_VECTOR_BITS", "100", "128, 256 or 512"),
        ("JAXBIPED_CACHE_BYTES", "1e9", "a whole number of bytes"),
    ],
)
def test_an_environment_variable_that_is_not_understood(name, value, words, capsys, monkeypatch):
    monkeypatch.setenv(name, value)
    line = _refused(["walk", "--duration", "0.1"], capsys)
    assert f"{name} = {value!r}" in line
    assert words in line


def test_a_platform_that_jax_does_not_find(capsys, monkeypatch):
    def none():
        raise RuntimeError("Unknown backend")

    monkeypatch.setenv("JAX_PLATFORMS", "abacus")
    monkeypatch.setattr(jax, "devices", none)
    line = _refused(["walk", "--duration", "0.1"], capsys)
    assert "JAX_PLATFORMS = 'abacus'" in line


def test_numbers_are_strict_json(capsys):
    """What is no finite number is null, as RFC 8259 has no word for it."""
    Report(Path("-")).finish({"a": [np.nan, np.float64("inf"), 1], "b": np.arange(2.0)})
    assert json.loads(capsys.readouterr().out, parse_constant=pytest.fail) == {
        "a": [None, None, 1],
        "b": [0.0, 1.0],
    }
