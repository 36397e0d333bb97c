"""Closed output, against what `head` does: a reader that has gone ends a command quietly."""

import json
import subprocess
import sys

import pytest


def _unread(*arguments):
    """Exit code, and what a command says on standard error whose output nobody reads."""
    command = [sys.executable, "-m", "jaxbiped", *map(str, arguments)]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True) as process:
        process.stdout.close()
        said = process.stderr.read()
    return process.returncode, said


@pytest.mark.parametrize("arguments", [("gait", "--help"), ("version",)])
def test_a_reader_that_has_gone_ends_it_in_silence(arguments):
    assert _unread(*arguments) == (1, "")


@pytest.mark.slow
def test_who_reads_no_further_does_not_keep_files_from_being_written(tmp_path):
    code, said = _unread("models", "--json", tmp_path / "numbers.json")
    assert (code, "BrokenPipe" in said) == (0, False)
    assert "normal" in json.loads((tmp_path / "numbers.json").read_text())
