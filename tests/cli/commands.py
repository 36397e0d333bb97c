"""Commands as a user gives them, run in this process."""

import json
import shlex

import pytest

from jaxbiped.cli import main


def run(*arguments):
    """The exit code of a command."""
    with pytest.raises(SystemExit) as stopped:
        main([str(each) for each in arguments])
    return stopped.value.code


def numbers_of(capsys, *arguments):
    """What a command that ends well writes as JSON."""
    assert run(*arguments, "--json", "-") == 0
    return json.loads(capsys.readouterr().out)


def refused(command, capsys):
    """The one sentence that refuses a command line, with exit code 2 and nothing printed."""
    assert run(*shlex.split(command)) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    (line,) = printed.err.splitlines()
    assert line.startswith("jaxbiped: ")
    assert not set("│╭╮╰╯─") & set(line)
    return line
