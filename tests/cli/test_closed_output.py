"""Closed output, against what `head` does: a reader that has gone ends a command quietly."""

import subprocess
import sys

import pytest


@pytest.mark.parametrize("arguments", [["gait", "--help"], ["version"]])
def test_a_reader_that_has_gone_ends_it_in_silence(arguments):
    command = [sys.executable, "-m", "jaxbiped", *arguments]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    process.stdout.close()
    said = process.stderr.read()
    process.stderr.close()
    assert process.wait() == 1
    assert said == ""
