"""Values that are kept, against how often they are made; and the folder that keeps them."""

import gc
import os
import threading
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxbiped import cache_info, clear_caches
from jaxbiped.caching._caches import CacheInfo, OfObjects, Once, bounded_cache, register_cache
from jaxbiped.caching._disk_cache import (
    ABANDONED,
    KINDS,
    DiskUse,
    cache_folder,
    clear_disk,
    disk_use,
    read_object,
    write_entry,
    write_object,
)
from jaxbiped.caching._known_by_shape import known_by_shape


class Made:
    """What a cache makes; it can be referred to weakly."""


def test_once_made_a_value_is_kept():
    once, made = Once(), []
    assert not once.done
    for _ in range(3):
        assert once(lambda: made.append(1) or "value") == "value"
    assert once.done
    assert made == [1]


def test_of_several_threads_one_makes_a_value():
    once, made, begin = Once(), [], threading.Barrier(4)

    def make():
        made.append(1)
        threading.Event().wait(0.02)
        return object()

    def ask(found):
        begin.wait()
        found.append(once(make))

    found = []
    threads = [threading.Thread(target=ask, args=(found,)) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(made) == 1
    assert len({id(each) for each in found}) == 1


def test_the_value_of_an_object_goes_with_it():
    values, made = OfObjects(), []

    def make():
        made.append(1)
        return len(made)

    one, two = Made(), Made()
    assert [values(one, make), values(two, make), values(one, make)] == [1, 2, 1]
    del one
    gc.collect(0)
    assert len(values._known) == 1
    assert values(two, make) == 2


def test_a_bounded_cache_keeps_the_last_results_and_finds_what_somebody_has(registry):
    calls = []

    @bounded_cache(2)
    def made(*args):
        calls.append(args)
        return Made()

    name = f"{__name__}.{made.__qualname__}"
    kept = made(1)
    assert made(1) is kept
    made(2)
    assert cache_info() == {name: CacheInfo(2, 2, "entries")}
    made(3)
    assert cache_info()[name].size == 2
    assert made(1) is kept  # forgotten, but alive
    assert calls == [(1,), (2,), (3,)]
    gc.collect(0)
    made(2)
    assert calls[-1] == (2,)
    clear_caches()
    assert cache_info()[name].size == 0
    assert made(1) is kept


def test_a_bounded_cache_keeps_plain_values_too(registry):
    calls = []

    @bounded_cache(1)
    def doubled(number):
        calls.append(number)
        return 2 * number

    assert [doubled(1), doubled(1), doubled(2), doubled(1)] == [2, 2, 4, 2]
    assert calls == [1, 2, 1]


def test_caches_are_listed_by_name_with_their_units(registry):
    cleared = []
    register_cache("b", lambda: 3, lambda: 7, lambda: cleared.append("b"), "bytes")
    register_cache("a", lambda: 1, lambda: 5, lambda: cleared.append("a"))
    found = cache_info()
    assert list(found) == ["a", "b"]
    assert found == {"a": CacheInfo(1, 5, "entries"), "b": CacheInfo(3, 7, "bytes")}
    clear_caches()
    assert set(cleared) == {"a", "b"}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("JAXBIPED_CACHE", str(tmp_path / "kept"))
    return tmp_path / "kept"


def test_the_folder_is_where_systems_keep_such_things(monkeypatch, tmp_path):
    monkeypatch.delenv("JAXBIPED_CACHE", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "jaxbiped"
    monkeypatch.setenv("XDG_CACHE_HOME", "")
    assert cache_folder() == Path.home() / ".cache" / "jaxbiped"
    monkeypatch.setenv("JAXBIPED_CACHE", "~/x")
    assert cache_folder() == Path.home() / "x"
    monkeypatch.setenv("JAXBIPED_CACHE", "")
    assert cache_folder() is None
    assert disk_use() == dict.fromkeys(KINDS, DiskUse(0, 0))
    assert clear_disk() == DiskUse(0, 0)


def test_what_is_kept_is_counted_by_kind_and_removed(folder):
    for name, size in (("a", 10), ("b", 25)):
        write_entry("lanes", name, b"x" * size)
    write_entry("xla", "c", b"")
    found = disk_use()
    assert (found["lanes"], found["xla"]) == (DiskUse(2, 35 + 2 * 32), DiskUse(1, 32))
    assert found["host"] == DiskUse(0, 0)
    assert (folder / "lanes").stat().st_mode & 0o777 == 0o700
    assert clear_disk() == DiskUse(3, 35 + 3 * 32)
    assert disk_use() == dict.fromkeys(KINDS, DiskUse(0, 0))


def test_objects_are_kept_in_parts_unless_they_cannot_be_pickled(folder):
    write_object("programs", "a", 1, "two")
    assert read_object("programs", "a", lambda *parts: parts) == (1, "two")
    assert read_object("programs", "b", lambda *parts: parts) is None
    assert read_object("programs", "a", lambda only: only) is None
    write_object("programs", "c", lambda: None)
    assert read_object("programs", "c", lambda *parts: parts) is None


def test_what_others_wrote_a_moment_ago_may_still_be_written(folder):
    """Half an hour and less than an hour; behind it nobody writes any more."""
    write_entry("lanes", "a", b"x")
    names = {}
    for age, stays in ((0.5 * ABANDONED, True), (0.95 * 3600.0, True), (1.05 * 3600.0, False)):
        path = folder / "lanes" / f".{age}"
        path.write_bytes(b"half")
        old = path.stat().st_mtime - age
        os.utime(path, (old, old))
        names[path.name] = stays
    old = (folder / "lanes" / "a").stat().st_mtime - 1e5
    os.utime(folder / "lanes" / "a", (old, old))
    write_entry("host", "b", b"y")
    assert (folder / "lanes" / "a").exists()
    for name, stays in names.items():
        assert (folder / "lanes" / name).exists() == stays


@pytest.fixture
def asked():
    return []


@pytest.fixture
def has_rows(asked):
    @known_by_shape
    def function(tree, least=1):
        asked.append(tree)
        assert isinstance(tree["x"] + 1.0, jax.core.Tracer)
        return tree["x"].shape[0] >= least

    return function


def test_it_is_asked_once_for_all_values_of_a_shape(asked, has_rows):
    for x in (np.zeros(2), jnp.ones(2), np.full(2, 3.0)):
        assert has_rows({"x": x})
    assert len(asked) == 1
    assert has_rows({"x": jnp.zeros(3)})
    assert not has_rows({"x": jnp.zeros(3)}, 4)
    assert has_rows({"x": jnp.zeros(3)}, 3)
    assert len(asked) == 4


def test_it_is_known_where_the_numbers_are_traced(asked, has_rows):
    assert has_rows({"x": jnp.zeros(2)})
    told = []
    jax.jit(lambda x: told.append(has_rows({"x": x})))(jnp.zeros(2))
    assert told == [True]
    assert len(asked) == 1


def test_what_cannot_be_hashed_is_asked_each_time(asked, has_rows):
    for _ in range(2):
        assert has_rows({"x": np.zeros(2), "note": {1}})
    assert len(asked) == 2


def test_an_error_is_raised_each_time(has_rows):
    for _ in range(2):
        with pytest.raises(KeyError, match="x"):
            has_rows({"y": np.zeros(2)})
