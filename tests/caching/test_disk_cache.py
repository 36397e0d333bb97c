"""The cache on disk, against damage and kills: whole or not at all, within its bound."""

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from jaxbiped.caching import _disk_cache
from jaxbiped.caching._disk_cache import cache_folder, clear_disk, disk_use, read_entry, write_entry

CONTENT = bytes(range(256)) * 40


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("JAXBIPED_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def holds(monkeypatch):
    """Lets the folder hold so many bytes."""
    return lambda size: monkeypatch.setattr(_disk_cache, "BYTES", size)


def test_what_is_written_is_read(cache):
    assert read_entry("xla", "a") is None
    write_entry("xla", "a", CONTENT)
    assert read_entry("xla", "a") == CONTENT
    assert read_entry("lanes", "a") is None
    assert cache.stat().st_mode & 0o077 == 0
    assert disk_use()["xla"] == (1, len(CONTENT) + 32)
    assert clear_disk().entries == 1
    assert read_entry("xla", "a") is None


@pytest.mark.parametrize("damage", [b"", b"short", b"\0" * 5000, CONTENT])
def test_damage_is_seen(cache, damage):
    write_entry("lanes", "a", CONTENT)
    (cache / "lanes" / "a").write_bytes(damage)
    assert read_entry("lanes", "a") is None
    write_entry("lanes", "a", CONTENT)
    assert read_entry("lanes", "a") == CONTENT


def test_an_entry_under_the_name_of_another_is_damage(cache):
    for kind, name in (("lanes", "a"), ("lanes", "b"), ("xla", "a")):
        write_entry(kind, name, CONTENT + name.encode())
    shutil.copy(cache / "lanes" / "a", cache / "lanes" / "b")
    shutil.copy(cache / "lanes" / "a", cache / "xla" / "a")
    assert read_entry("lanes", "b") is None
    assert read_entry("xla", "a") is None
    assert read_entry("lanes", "a") == CONTENT + b"a"


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="a system without owners")
@pytest.mark.parametrize("place", ["xla/a", "xla", "."])
def test_what_others_can_write_is_not_read(cache, place):
    write_entry("xla", "a", CONTENT)
    (cache / place).chmod(0o777)
    assert read_entry("xla", "a") is None
    # Its owner closes the folders again, and what is written then is read.
    write_entry("xla", "a", CONTENT)
    assert read_entry("xla", "a") == CONTENT


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="a system without owners")
def test_what_somebody_else_wrote_is_not_read(cache, monkeypatch):
    write_entry("xla", "a", CONTENT)
    monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)
    assert read_entry("xla", "a") is None


def test_on_a_system_without_owners_what_was_written_is_read(cache, monkeypatch):
    monkeypatch.delattr(os, "geteuid", raising=False)
    write_entry("xla", "a", CONTENT)
    assert read_entry("xla", "a") == CONTENT


@pytest.mark.parametrize("spare", [0, -1])
def test_the_folder_may_hold_so_many_bytes_and_not_one_more(cache, holds, spare):
    write_entry("xla", "a", CONTENT)
    size = (cache / "xla" / "a").stat().st_size
    os.utime(cache / "xla" / "a", (1, 1))
    holds(2 * size + spare)
    write_entry("xla", "b", CONTENT)
    assert (read_entry("xla", "a") is None) == (spare < 0)
    assert read_entry("xla", "b") == CONTENT


def test_nothing_is_kept_where_nothing_is_wanted(monkeypatch):
    monkeypatch.setenv("JAXBIPED_CACHE", "")
    assert cache_folder() is None
    write_entry("xla", "a", CONTENT)
    assert read_entry("xla", "a") is None
    assert sum(use.entries for use in disk_use().values()) == clear_disk().entries == 0


def test_a_folder_that_cannot_be_written_does_no_harm(cache):
    cache.write_text("in the way")
    write_entry("xla", "a", CONTENT)
    assert read_entry("xla", "a") is None


def test_what_was_used_longest_ago_makes_room(cache, holds):
    for k, name in enumerate("ab"):
        write_entry("xla", name, CONTENT)
        os.utime(cache / "xla" / name, (k, k))
    read_entry("xla", "a")  # now used later than the other one
    holds(5 * len(CONTENT) // 2)
    write_entry("lanes", "c", CONTENT)
    assert read_entry("xla", "a") == read_entry("lanes", "c") == CONTENT
    assert read_entry("xla", "b") is None


def test_a_folder_among_the_entries_is_left_alone(cache, holds):
    """It cannot be unlinked, and what comes behind it makes room as ever."""
    write_entry("xla", "a", CONTENT)
    (cache / "xla" / "old").mkdir()
    for k, name in enumerate(("old", "a")):
        os.utime(cache / "xla" / name, (k, k))
    assert disk_use()["xla"].entries == 1
    holds(len(CONTENT) + 32)
    write_entry("xla", "b", CONTENT)
    assert read_entry("xla", "a") is None
    assert read_entry("xla", "b") == CONTENT


def test_what_killed_processes_left_is_removed_after_a_while(cache):
    write_entry("xla", "a", CONTENT)
    left, fresh = cache / "xla" / ".left", cache / "xla" / ".fresh"
    for path in (left, fresh):
        path.write_bytes(CONTENT)
    before = time.time() - _disk_cache.ABANDONED - 1.0
    os.utime(left, (before, before))
    os.utime(cache / "xla" / "a", (before, before))
    write_entry("lanes", "b", CONTENT)
    assert not left.exists()
    assert fresh.exists()  # some process may be writing it
    assert read_entry("xla", "a") == CONTENT


WORK = """
import importlib.util, sys
spec = importlib.util.spec_from_file_location("disk_cache", sys.argv[1])
cache = importlib.util.module_from_spec(spec)
spec.loader.exec_module(cache)
for turn in range(10):
    for k in range(4):
        found = cache.read_entry("xla", str(k))
        assert found is None or found == bytes([k]) * 20_000, "a wrong answer"
        cache.write_entry("xla", str(k), bytes([k]) * 20_000)
"""


@pytest.mark.nightly
def test_processes_that_are_killed_leave_nothing_half_written(cache):
    """Two hundred at once on a cold cache, killed at random, and garbage written in between."""
    chance = random.Random(5)
    command = [sys.executable, "-S", "-c", WORK, str(Path(_disk_cache.__file__))]
    running = [subprocess.Popen(command, stderr=subprocess.PIPE) for _ in range(200)]
    deadline = time.monotonic() + 240.0
    for process in running:
        if chance.random() < 0.7:
            process.send_signal(signal.SIGKILL)
        place = cache / "xla" / str(chance.randrange(4))
        if chance.random() < 0.3 and place.parent.exists():
            place.write_bytes(chance.randbytes(chance.randrange(30_000)))
    for process in running:
        _, said = process.communicate(timeout=max(1.0, deadline - time.monotonic()))
        assert process.returncode in (0, -signal.SIGKILL), said.decode()
    for k in range(4):
        assert read_entry("xla", str(k)) in (None, bytes([k]) * 20_000)
