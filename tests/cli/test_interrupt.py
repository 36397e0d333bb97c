"""Ctrl-C in a command, against what was done by then."""

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
