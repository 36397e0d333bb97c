"""Stages of calls, against what takes long, who watches, and what an interrupt says."""

import io
import os
import re
import subprocess
import sys

import pytest

from jaxbiped import _progress

_SCRIPT = """
import time
from jaxbiped import _progress
_progress._PATIENCE, _progress._PAUSE = 0.2, 0.05
def work(name, **how):
    with _progress.stage(name, **how) as now:
        for k in range(4):
            time.sleep(0.1 if k < 3 else 0.6)  # a busy machine may show it late
            now.update(found=f"{k} found")
"""


def run(script, **how):
    code = _SCRIPT + script
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, **how)


def test_a_file_gets_what_takes_long_in_commands_and_what_was_asked_for():
    ended = run("work('a library call'); work('asked', total=4, unit='gaits', show=True)")
    assert ended.returncode == 0, ended.stderr
    first = ended.stderr.splitlines()[0]
    assert re.fullmatch(r"asked: [123] of 4 gaits, [012] found …", first)
    assert len(ended.stderr.splitlines()) <= 6  # after times that double, and at the end
    last = ended.stderr.splitlines()[-1]
    times = r"\[\d+ s, 0 s left(, \d+ gaits/s)?\]"
    assert re.fullmatch(rf"asked: 4 of 4 gaits, 3 found {times}\.", last)
    assert "library" not in ended.stderr
    ended = run(
        "_progress.tell_stages()\nwith _progress.stage('quick'): pass\n"
        "with _progress.stage('slow'): time.sleep(0.3)"
    )
    assert (ended.stderr, ended.stdout) == ("slow …\n", "")


def test_a_terminal_gets_one_line_which_an_unasked_bar_takes_away():
    """A pseudo-terminal reads what a person sees."""
    seen = {}
    for show in ("None", "True"):
        master, slave = os.openpty()
        code = _SCRIPT + f"work('searching', total=4, unit='gaits', show={show})"
        ended = subprocess.run([sys.executable, "-c", code], stderr=slave, env=_wide())
        os.close(slave)
        seen[show] = os.read(master, 100_000).decode()
        os.close(master)
        assert ended.returncode == 0
        assert re.search(r"searching: \|█{3,9} +\| [123] of 4 gaits, [012] found \[", seen[show])
    assert seen["None"].rstrip(" ").endswith("\r")
    assert "\n" not in seen["None"]
    last = seen["True"].rstrip("\r\n").split("\r")[-1]
    assert last.startswith("searching: |████████████| 4 of 4 gaits, 3 found")


def test_a_line_that_is_written_over_is_seen_at_once(monkeypatch):
    seen = []

    class Terminal(io.StringIO):
        def flush(self):
            seen.append(self.getvalue())

    monkeypatch.setattr(sys, "stderr", Terminal())
    _progress._terminal_writer(kept=False)(_progress.Stage("walking", None, "", 0), False)
    assert seen[-1].endswith("walking [0 s]")


def _wide():
    return {**os.environ, "COLUMNS": "120"}


def test_stages_within_are_named_on_the_outermost_line_and_by_an_interrupt():
    def search():
        with _progress.stage("sweep", total=9, unit="gaits") as sweep:
            sweep.update(2, found="radius 0.4")
            with _progress.stage("search"), _progress.stage("walking", total=16, unit="starts"):
                raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as caught:
        search()
    (note,) = caught.value.__notes__
    told = "sweep: 2 of 9 gaits, radius 0.4 › search › walking: 0 of 16 starts"
    assert note == f"Interrupted: {told}."
    with _progress.stage("next") as after:  # nothing of the interrupted ones is left
        assert after.words() == "next"


def test_an_interrupt_says_what_it_leaves():
    with pytest.raises(KeyboardInterrupt) as caught, _progress.stage("a", kept="all is stored"):
        raise KeyboardInterrupt
    assert caught.value.__notes__ == ["Interrupted: a.", "All is stored."]


_CELL = f"{_SCRIPT}\nwork('in a notebook', total=4, unit='gaits')"


def test_a_notebook_shows_the_line_below_the_cell_and_takes_it_away():
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(_CELL)])
    updates = []

    class Client(nbclient.NotebookClient):
        def process_message(self, message, cell, index):
            if message["msg_type"] in ("display_data", "update_display_data"):
                updates.append(message["content"]["data"]["text/plain"])
            return super().process_message(message, cell, index)

    Client(notebook, kernel_name="python3", timeout=60).execute()
    assert re.match(r"in a notebook: \|█{3,9} +\| [123] of 4 gaits, [012] found", updates[0])
    assert updates[-1] == ""
    (output,) = notebook.cells[0].outputs
    assert output["data"] == {"text/plain": ""}
