"""The command line: `jaxbiped COMMAND`."""

import contextlib
import dataclasses
import functools
import io
import operator
import os
import re
import sys
import warnings
from itertools import takewhile
from pathlib import Path
from typing import Annotated, Any

import tyro
from tyro.conf import subcommand

import jaxbiped
from jaxbiped._checks import ArgumentError, ResourceError
from jaxbiped._files import check_environment, user_path
from jaxbiped._progress import tell_stages
from jaxbiped.cli._basin import Basin
from jaxbiped.cli._constraints import Constraints
from jaxbiped.cli._continue import ContinueGait
from jaxbiped.cli._doctor import Cache, Doctor
from jaxbiped.cli._gait import FindGait
from jaxbiped.cli._models import Models
from jaxbiped.cli._options import Command
from jaxbiped.cli._parameter_search import Fit, Optimise
from jaxbiped.cli._report import Report as Report
from jaxbiped.cli._trade import Trade
from jaxbiped.cli._walk import Walk

COMMANDS: dict[str, type[Command] | None] = {
    "walk": Walk,
    "gait": FindGait,
    "continue": ContinueGait,
    "optimise": Optimise,
    "fit": Fit,
    "basin": Basin,
    "models": Models,
    "constraints": Constraints,
    "trade": Trade,
    "cache": Cache,
    "doctor": Doctor,
    "version": None,
}
"""Commands by name; `main` takes one that is added here along."""

_MOVED = {
    "extremes": "extremes is no longer a command: the study of extreme cases is "
    "experiments/extremes.py in jaxbiped's repository."
}
"""Commands of the last release, and where what they did is now."""

_COLOUR = re.compile(r"\x1b\[[0-9;]*m")
_SIDES = re.compile(r"^[\s│|]*(.*?)[\s│|]*$")
_RULE = re.compile(r"^[╭╰]?[─━=-]{3,}.*$")
_PLAIN = {
    r"no type matching \{None\}\|(\w+) could be instantiated from \[(.*)\]": r"\2 is not \1",
    r"invalid literal for int\(\) with base 10: ('.*')": r"\1 is not INT",
    r"could not convert string to float: ('.*')": r"\1 is not FLOAT",
    r"[Ee]rror parsing (--\S+): ('.*') is not": r"\1 = \2 is not",
    "is not FLOAT": "is not a number",
    "is not INT": "is not a whole number",
    r" \(applied to [^)]*\)| Arguments are applied to .*": "",
}
"""Words of the parser, by what they are replaced with."""


def main(arguments: list[str] | None = None) -> None:
    """Runs a command and exits.

    With one sentence and 2 for an argument that is not allowed, 1 for a full disk or lost workers,
    130 for Ctrl-C. A result that is not what was asked for is 1, too.
    """
    try:
        try:
            _run(sys.argv[1:] if arguments is None else list(arguments))
        finally:
            if sys.stdout is not None:  # closed by who began it
                sys.stdout.flush()
    except BrokenPipeError:  # who reads wants no more, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
    except KeyboardInterrupt as error:
        notes = " ".join(getattr(error, "__notes__", ["Interrupted."]))
        print(f"jaxbiped: {notes}", file=sys.stderr)
        sys.exit(130)


def _run(given: list[str]) -> None:
    if given and given[0] in _MOVED:
        print(f"jaxbiped: {_MOVED[given[0]]}", file=sys.stderr)
        sys.exit(2)
    command = None if given == ["--version"] else _parse(given)
    if command is None:
        print(jaxbiped.__version__)
        return
    tell_stages()
    usual, warnings.formatwarning = warnings.formatwarning, _one_line
    try:
        command = _with_home(command)
        command.check()
        check_environment()
        _check_platforms()
        sys.exit(command.run())
    except BrokenPipeError:
        raise
    except (ArgumentError, ResourceError, OSError) as error:
        print(f"jaxbiped: {error}", file=sys.stderr)
        sys.exit(2 if isinstance(error, ArgumentError) else 1)
    finally:
        warnings.formatwarning = usual


def _one_line(message: Warning | str, *_: Any, **__: Any) -> str:
    """A warning as a command tells it: no line of the caller's code is of use there."""
    return f"jaxbiped: warning: {message}\n"


def _check_platforms() -> None:
    """Raises `ArgumentError` if JAX is set to a platform that does not exist here."""
    told = os.environ.get("JAX_PLATFORMS", "")
    if not told:
        return
    import jax

    try:
        jax.devices()
    except Exception as error:  # JAX's own, of several kinds
        raise ArgumentError(
            f"JAX_PLATFORMS = {told!r} in the environment is not allowed: JAX finds none of these "
            f"here ({' '.join(str(error).split()) or 'no reason given'})."
        ) from None


def _with_home(options: Any) -> Any:
    """Options, or a group of them, with "~" in their paths as the home folder."""
    changed = {}
    for field in dataclasses.fields(options):
        value = getattr(options, field.name)
        if isinstance(value, Path):
            changed[field.name] = user_path(value, f"--{field.name.replace('_', '-')}")
        elif dataclasses.is_dataclass(value):
            changed[field.name] = _with_home(value)
    return dataclasses.replace(options, **changed) if changed else options


def _parse(arguments: list[str]) -> Command | None:
    """The command; exits with 2 and one sentence where there is none."""
    flags = [each.partition("=")[0] for each in arguments if each.startswith("--")]
    if more := [flag for flag in flags if flags.count(flag) > 1]:
        # The parser would keep the last one alone.
        told = f"{more[0]} is given {flags.count(more[0])} times: give all its values after one."
        print(f"jaxbiped: {told}", file=sys.stderr)
        sys.exit(2)
    refusal = io.StringIO()
    try:
        with contextlib.redirect_stderr(refusal):
            commands = (Annotated[kind, subcommand(name)] for name, kind in COMMANDS.items())
            chosen: Any = functools.reduce(operator.or_, commands)
            return tyro.cli(chosen, args=arguments, prog="jaxbiped", description=__doc__)
    except SystemExit as ended:
        if ended.code:
            print(f"jaxbiped: {one_sentence(refusal.getvalue())}", file=sys.stderr)
        else:
            print(refusal.getvalue(), end="", file=sys.stderr)
        raise


def one_sentence(box: str) -> str:
    """The message of a box: a title, then blocks between rules.

    The first block is the message; of the others, flags and commands that may have been meant.
    """
    plain = (_SIDES.sub(r"\1", line) for line in _COLOUR.sub("", box).splitlines())
    blocks: list[list[str]] = [[]]
    for line in filter(None, plain):
        if _RULE.match(line) or line.startswith("╭"):
            blocks.append([])
        else:
            blocks[-1].append(line)
    # A title stands above the first rule, or within it.
    filled = [block for block in blocks[1:] if block]
    if not filled:
        return "these arguments are not allowed: see jaxbiped --help."
    message, *others = filled
    # A message may go on to list its reasons.
    told = takewhile(lambda line: not line.startswith(("Got errors", "- <class")), message)
    sentence = " ".join(told)
    for words, plain_words in _PLAIN.items():
        sentence = re.sub(words, plain_words, sentence)
    parts = [sentence.rstrip(". ")]
    for block in others:
        flags = [line.split()[0] for line in block[1:] if line.startswith("--")]
        flags = [flag for flag in flags if flag not in parts[0].split()]
        if block[0].startswith("Perhaps you meant") and flags:
            parts.append(f"perhaps you meant {' or '.join(dict.fromkeys(flags))}")
        elif block[0].startswith("Available subcommands"):
            parts.append(" ".join(block).rstrip(". "))
    return "; ".join(part[0].lower() + part[1:] for part in parts) + "."
