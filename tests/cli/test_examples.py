"""Examples of the page on the command line, against what the commands print."""

import re
import shlex
from pathlib import Path

import pytest

from tests.cli.commands import run

PAGE = (Path(__file__).parents[2] / "docs" / "command_line.md").read_text()
EXAMPLES = re.findall(r"^```console\n\$ jaxbiped (.*)\n((?:.*\n)*?)```$", PAGE, re.MULTILINE)
MEASURED = re.findall(r"^```json\n(.*\n)```$", PAGE, re.MULTILINE)
pytestmark = pytest.mark.nightly


def pattern_of(shown):
    """An output in which an ellipsis stands for anything; alone on a line, for any lines."""
    lines = (
        r"(?:.*\n)*" if line.strip() == "…" else r".*".join(map(re.escape, line.split("…"))) + r"\n"
        for line in shown.splitlines()
    )
    return "".join(lines)


@pytest.mark.parametrize(("words", "shown"), EXAMPLES, ids=[words for words, _ in EXAMPLES])
def test_an_example_prints_what_the_page_shows(words, shown, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("measured.json").write_text(*MEASURED)
    assert run(*shlex.split(words)) == 0
    printed = capsys.readouterr().out
    assert re.fullmatch(pattern_of(shown), printed), printed


def test_there_is_an_example_of_each_command():
    from jaxbiped.cli import COMMANDS

    commands = {words.split()[0] for words, _ in EXAMPLES}
    assert set(COMMANDS) - commands == {"cache", "version"}


def test_another_number_is_seen():
    assert re.fullmatch(pattern_of("a 0.44… b\n…\nend"), "a 0.4408 b\nc\nd\nend\n")
    assert not re.fullmatch(pattern_of("a 0.44… b\n…\nend"), "a 0.4508 b\nc\nd\nend\n")
