"""Commands cut short, against what was done by Ctrl-C, and what `head` does: a reader has gone."""

import importlib
import json
import signal
import subprocess
import sys
from types import SimpleNamespace

import pytest
import tyro

from jaxbiped.cli import main
from tests.cli.commands import asked, run


def test_ctrl_c_says_what_was_done_in_a_line_and_exits_as_shells_expect(capsys):
    asked("walk", "Simulation.prepare", ends=KeyboardInterrupt)
    assert capsys.readouterr().err == "jaxbiped: Interrupted: preparing the start.\n"


def test_ctrl_c_before_a_command_is_known_is_the_same(monkeypatch, capsys):
    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(tyro, "cli", interrupt)
    with pytest.raises(SystemExit) as ended:
        main(["walk"])
    assert (ended.value.code, capsys.readouterr().err) == (130, "jaxbiped: Interrupted.\n")
    monkeypatch.delitem(sys.modules, "jaxbiped.cli")
    find = lambda name, *_: interrupt() if name == "jaxbiped.cli" else None
    monkeypatch.setattr(sys, "meta_path", [SimpleNamespace(find_spec=find), *sys.meta_path])
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    monkeypatch.setattr(sys, "unraisablehook", sys.unraisablehook)
    with pytest.raises(SystemExit) as ended:
        importlib.import_module("jaxbiped.__main__").main()
    assert (ended.value.code, capsys.readouterr().err) == (130, "jaxbiped: Interrupted.\n")


_LOST = """
import gc, os, signal, sys, time
import jaxbiped.__main__
from jaxbiped import cli
sent = []
def callback(*_):
    if not sent:
        sent.append(True)
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.1)
class Collecting(cli.Command):
    def run(self):
        gc.callbacks.append(callback)
        gc.collect()
        time.sleep(20.0)
        return 0
cli.COMMANDS["collecting"] = Collecting
sys.argv = ["jaxbiped", "collecting"]
jaxbiped.__main__.main()
"""


def test_ctrl_c_is_not_lost_in_a_callback():
    """A garbage collector's callback, as JAX has one, cannot raise: the interrupt comes again."""
    ended = subprocess.run([sys.executable, "-c", _LOST], capture_output=True, text=True)
    assert (ended.returncode, ended.stdout) == (130, "")
    assert ended.stderr == "jaxbiped: Interrupted.\n"


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


@pytest.mark.slow
def test_a_walk_that_runs_out_of_steps_says_so_by_its_code(capsys):
    walk = ("walk", "--model", "rigid", "--duration", "1e12")
    assert run(*walk, "--max-solver-steps", 50) == 1
    printed = capsys.readouterr()
    assert "out of steps after" in printed.out
    assert "warning" not in printed.err  # the table says it
