"""Commands killed at random while one cache is spoilt, against the same commands left alone.

With so many processes that all begin at once: `python -m tests.cli.test_killed_commands 200`. They
take some 15 GB of memory and a quarter of an hour on two cores.
"""

import hashlib
import json
import os
import random
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import NamedTuple

import pytest

COMMANDS = (
    ("walk", "--duration", "0.5", "--json", "-"),
    ("walk", "--duration", "0.5", "--slope", "0.018", "--json", "-"),
)
GAIT = ("gait", "--json", "-")
AT_ONCE = 4
LIFE = 6.0
"""Longest time [s] that one of those lives that are killed."""
PAUSE = 3.0
"""Time [s] between two rounds of garbage."""


class Survival(NamedTuple):
    """Processes that answered right, were killed, began together; entries that were spoilt."""

    answered: int
    killed: int
    at_once: int
    spoilt: int


def _begin(command, cache):
    environment = os.environ | {"JAXBIPED_CACHE": str(cache)}
    arguments = [sys.executable, "-m", "jaxbiped", *command]
    return subprocess.Popen(
        arguments, env=environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )


def _told(process):
    """Numbers that a command printed, but for times; None where it was killed before."""
    printed, _ = process.communicate(timeout=3000)
    if process.returncode < 0:
        return None
    assert process.returncode == 0
    told = json.loads(printed)
    del told["wall_s"]
    return told


def _spoil(cache, chance):
    """Garbage instead of a third of what is kept; how many entries that were.

    All of an entry, its end, one byte; or what would pass for an entry if others could not write
    to it.
    """
    kept = [path for path in cache.rglob("*") if path.is_file()]
    chosen = chance.sample(kept, k=len(kept) // 3)
    for path in chosen:
        try:
            content = bytearray(path.read_bytes())
        except FileNotFoundError:  # it was being written
            continue
        how = chance.randrange(4)
        if how == 0 or not content:
            content = bytearray(chance.randbytes(chance.randrange(30_000)))
        elif how == 1:
            del content[chance.randrange(len(content)) :]
        elif how == 2:
            content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
        else:
            garbage = chance.randbytes(5_000)
            place = f"{path.parent.name}/{path.name}\0".encode()
            content = hashlib.sha256(place + garbage).digest() + garbage
        path.write_bytes(content)
        path.chmod(0o666 if how == 3 else 0o600)
    return len(chosen)


def _spoil_until(over, cache, chance, spoilt):
    while not over.wait(PAUSE):
        spoilt.append(_spoil(cache, chance))


def survive(count, cache, chance, *, at_once=AT_ONCE, life=LIFE, commands=COMMANDS, doomed=0.5):
    """What became of so many processes, `at_once` of which begin together.

    A share `doomed` of them is killed within `life` seconds.
    """
    truths = [_told(_begin(command, "")) for command in commands]
    answered = killed = most = 0
    spoilt, over = [0], threading.Event()
    spoiler = threading.Thread(target=_spoil_until, args=(over, cache, chance, spoilt))
    spoiler.start()
    try:
        for first in range(0, count, at_once):
            running = []
            for _ in range(min(at_once, count - first)):
                which = chance.randrange(len(commands))
                process = _begin(commands[which], cache)
                running.append((which, process))
                if chance.random() < doomed:
                    threading.Timer(chance.uniform(0.0, life), process.kill).start()
            most = max(most, sum(process.poll() is None for _, process in running))
            for which, process in running:
                told = _told(process)
                assert told is None or told == truths[which], "a wrong answer"
                answered, killed = answered + (told is not None), killed + (told is None)
    finally:
        over.set()
        spoiler.join()
    return Survival(answered, killed, most, sum(spoilt))


@pytest.mark.nightly
def test_commands_that_are_killed_and_fed_garbage_answer_right(tmp_path):
    found = survive(8, tmp_path, random.Random(3))
    assert found.answered > 0
    assert found.answered + found.killed == 8


if __name__ == "__main__":
    number = int(sys.argv[1])
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        # As many walks as fit, and a gait for every ten of them.
        mixed = (*COMMANDS * 5, GAIT)
        found = survive(
            number, Path(folder), random.Random(7),
            at_once=number, life=number, commands=mixed, doomed=0.6,
        )  # fmt: skip
        left = survive(4, Path(folder), random.Random(8), doomed=0.0)
    print(f"{found.at_once} processes at once: {found.answered} answered right,")
    print(f"{found.killed} were killed, {found.spoilt} entries were spoilt;")
    print(f"of 4 more behind them {left.answered} answered right;")
    print(f"{time.perf_counter() - began:.0f} s")
