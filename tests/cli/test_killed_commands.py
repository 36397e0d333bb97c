"""Commands killed at random while they share one cache on disk, garbage written into it between.

With another number of processes: `python -m tests.cli.test_killed_commands 200`.
"""

import json
import os
import random
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import pytest

from jaxbiped._disk_cache import CACHE_VARIABLE

COMMANDS = (
    ("walk", "--duration", "0.5", "--json", "-"),
    ("walk", "--duration", "0.5", "--slope", "0.018", "--json", "-"),
)
AT_ONCE = 4
LIFE = 6.0
"""Longest time [s] that one of those lives that are killed."""


def _begin(command, cache):
    environment = os.environ | {CACHE_VARIABLE: str(cache)}
    arguments = [sys.executable, "-m", "jaxbiped", *command]
    return subprocess.Popen(
        arguments, env=environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )


def _told(process):
    """Numbers that a command printed, but for times; None where it was killed before."""
    printed, _ = process.communicate(timeout=600)
    if process.returncode < 0:
        return None
    assert process.returncode == 0
    told = json.loads(printed)
    del told["wall_s"]
    return told


def _spoil(cache, chance):
    """Garbage instead of some of what is kept: all of an entry, its end, or one byte."""
    kept = [path for path in cache.rglob("*") if path.is_file()]
    for path in chance.sample(kept, k=len(kept) // 3):
        content = bytearray(path.read_bytes())
        how = chance.randrange(3)
        if how == 0 or not content:
            content = bytearray(chance.randbytes(chance.randrange(30_000)))
        elif how == 1:
            del content[chance.randrange(len(content)) :]
        else:
            content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
        path.write_bytes(content)
    return len(kept) // 3


def survive(count, cache, chance):
    """How many of so many processes answered, were killed, and how many entries were spoilt."""
    truths = [_told(_begin(command, "")) for command in COMMANDS]
    answered = killed = spoilt = 0
    for first in range(0, count, AT_ONCE):
        spoilt += _spoil(cache, chance)
        running = []
        for _ in range(min(AT_ONCE, count - first)):
            which = chance.randrange(len(COMMANDS))
            process = _begin(COMMANDS[which], cache)
            running.append((which, process))
            if chance.random() < 0.5:
                threading.Timer(chance.uniform(0.0, LIFE), process.kill).start()
        for which, process in running:
            told = _told(process)
            assert told is None or told == truths[which], "a wrong answer"
            answered, killed = answered + (told is not None), killed + (told is None)
    return answered, killed, spoilt


@pytest.mark.slow
def test_commands_that_are_killed_and_fed_garbage_answer_right(tmp_path):
    answered, killed, _ = survive(8, tmp_path, random.Random(3))
    assert answered > 0
    assert answered + killed == 8


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        found = survive(int(sys.argv[1]), Path(folder), random.Random(7))
    print("{} answered right, {} were killed, {} entries were spoilt".format(*found))
