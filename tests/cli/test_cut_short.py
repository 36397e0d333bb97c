"""Commands cut short, against what was done by Ctrl-C, and what `head` does: a reader has gone."""

import json
import subprocess
import sys

import pytest

from jaxbiped._progress import stage
from jaxbiped.cli import COMMANDS, _options, main


class Counting(_options.Command):
    """Counts until it is interrupted."""

    def run(self) -> int:
        """Runs the command."""
        with stage("counting", total=9, unit="sheep") as now:
            now.update(3, found="one black")
            raise KeyboardInterrupt


def test_ctrl_c_says_what_was_done_in_a_line_and_exits_as_shells_expect(monkeypatch, capsys):
    monkeypatch.setitem(COMMANDS, "counting", Counting)
    with pytest.raises(SystemExit) as ended:
        main(["counting"])
    assert ended.value.code == 130
    told = capsys.readouterr().err
    assert told == "jaxbiped: Interrupted: counting: 3 of 9 sheep, one black.\n"


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
