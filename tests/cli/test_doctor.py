"""The commands doctor and cache, against installations with one thing wrong and the folder."""

import pytest

from jaxbiped.caching._disk_cache import read_entry, write_entry
from jaxbiped.cli import _doctor
from jaxbiped.cli._doctor import Truth, complaints, self_test
from tests.cli.commands import numbers_of, run


@pytest.mark.slow
def test_a_sound_installation_passes(capsys):
    told = numbers_of(capsys, "doctor")
    assert told["wrong"] == []
    assert [each["holds"] for each in told["self_test"]] == [True, True, True]
    assert told["vector_width"] in (2, 4, 8)
    assert told["versions"]["jax"].startswith("0.")
    assert {abs(each.found - each.known) < each.allowed for each in self_test()} == {True}


@pytest.fixture
def tests_itself(monkeypatch):
    """Lets the self-test be another one."""
    return lambda by: monkeypatch.setattr(_doctor, "self_test", by)


def test_what_is_wrong_is_said_and_costs_the_exit_code(capsys, tests_itself):
    off = Truth("height", 1.0, 1.5, 1e-9)
    tests_itself(lambda: (off, off._replace(found=1.0)))
    assert run("doctor") == 1
    printed = capsys.readouterr().out
    assert "height is off by 5e-01" in printed
    assert printed.count("wrong") == 1

    def broken():
        raise RuntimeError("no code for this CPU")

    tests_itself(broken)
    assert run("doctor") == 1
    printed = capsys.readouterr().out
    assert "the self-test ended with RuntimeError: no code for this CPU" in printed


def test_versions_known_to_be_bad_are_named():
    assert complaints({"jax": "0.10.1"}) == []
    (said,) = complaints({"jax": "0.10.2"})
    assert "jax 0.10.2 must not be used" in said
    assert "39103" in said


def _told(capsys, *arguments):
    assert run("cache", *arguments) == 0
    return capsys.readouterr().out


def test_the_cache_is_counted_and_cleared(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("JAXBIPED_CACHE", str(tmp_path / "cache"))
    write_entry("lanes", "a", bytes(1000))
    write_entry("xla", "b", bytes(2000))
    told = numbers_of(capsys, "cache")
    assert told["folder"] == str(tmp_path / "cache")
    assert told["kept"]["xla"] == {"entries": 1, "size": 2032}
    assert told["removed"] is None
    assert str(tmp_path / "cache") in _told(capsys)
    told = numbers_of(capsys, "cache", "--clear")
    assert told["removed"] == {"entries": 2, "size": 3064}
    assert read_entry("lanes", "a") is None
    assert "removed: 0 entries" in _told(capsys, "--clear")


def test_a_cache_where_nothing_is_kept_says_so(monkeypatch, capsys):
    monkeypatch.setenv("JAXBIPED_CACHE", "")
    assert "nothing is kept" in _told(capsys)
    assert numbers_of(capsys, "cache")["folder"] is None
