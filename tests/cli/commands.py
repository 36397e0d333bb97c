"""Commands as a user gives them, run in this process."""

import functools
import json
import shlex
from pathlib import Path
from typing import Any, NamedTuple

import pytest

import jaxbiped as jb
from jaxbiped._progress import Stage
from jaxbiped.cli import main
from tests.drawn import saved_figures


def run(*arguments):
    """The exit code of a command."""
    with pytest.raises(SystemExit) as stopped:
        main([str(each) for each in arguments])
    return stopped.value.code


def numbers_of(capsys, *arguments, code=0):
    """What a command that ends with this code writes as JSON; 0 where it ends well."""
    assert run(*arguments, "--json", "-") == code
    return json.loads(capsys.readouterr().out)


class Outputs(NamedTuple):
    """All that a command left: exit code, folder of its files, their figures, its numbers."""

    code: int
    folder: Path
    figures: dict
    numbers: Any


def outputs_of(folder, *arguments):
    """What a command leaves that is asked for every output; NaN and Infinity are no JSON."""
    out, told = folder / "out", folder / "numbers.json"
    with saved_figures() as figures:
        code = run(*arguments, "--out", out, "--json", told)
    return Outputs(code, out, figures, json.loads(told.read_text(), parse_constant=pytest.fail))


def refused(command, capsys):
    """The one sentence that refuses a command line, with exit code 2 and nothing printed."""
    assert run(*shlex.split(command)) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    (line,) = printed.err.splitlines()
    assert line.startswith("jaxbiped: ")
    assert not set("│╭╮╰╯─") & set(line)
    return line


class _Asked(Exception):  # noqa: N818
    """A function of the package was called."""


def asked(command, *doors, ends=_Asked):
    """Arguments and keywords with which a command calls one of these first, which ends it.

    By an interrupt if `ends` is one.
    """
    calls = []

    def stop(*arguments, **keywords):
        calls.append((arguments, keywords))
        raise ends

    with pytest.MonkeyPatch.context() as patch:
        for door in doors:
            *parts, name = door.split(".")
            patch.setattr(functools.reduce(getattr, parts, jb), name, stop)
        with pytest.raises(_Asked if ends is _Asked else SystemExit) as stopped:
            main(shlex.split(command))
    assert ends is _Asked or stopped.value.code == 130
    return calls[0]


def walked(options=""):
    """Scene and start of `jaxbiped walk` with these options."""
    (scene, start, *_), _ = asked(f"walk {options}", "Simulation.prepare", "rigid_walk")
    return scene, start


def starts_of(options):
    """Starts that `jaxbiped basin` with these options reads from a file."""
    return asked(f"basin {options}", "starts.GivenStarts")[0][0]


def interrupt_after(monkeypatch, count, word=""):
    """Lets Ctrl-C come when stages have counted or told so often what was found, with a word."""
    told = iter(range(count))
    update = Stage.update

    def interrupted(stage, *given, **found):
        update(stage, *given, **found)
        if word in str(found) and next(told, None) is None:
            monkeypatch.undo()
            raise KeyboardInterrupt

    monkeypatch.setattr(Stage, "update", interrupted)


def one_line(capsys):
    """What an interrupted command prints, and its one line on stderr."""
    printed = capsys.readouterr()
    (line,) = [line for line in printed.err.splitlines() if line.startswith("jaxbiped: ")]
    return printed.out, line
