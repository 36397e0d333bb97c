"""The command cache, against the folder: what is kept on disk, and gone where that is wanted."""

import json

import pytest

from jaxbiped.caching._disk_cache import CACHE_VARIABLE, read_entry, write_entry
from jaxbiped.cli import main


def _told(capsys, *arguments):
    with pytest.raises(SystemExit) as ended:
        main(["cache", *arguments])
    assert ended.value.code == 0
    return capsys.readouterr().out


def test_it_counts_and_clears(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "cache"))
    write_entry("lanes", "a", bytes(1000))
    write_entry("xla", "b", bytes(2000))
    told = json.loads(_told(capsys, "--json", "-"))
    assert told["folder"] == str(tmp_path / "cache")
    assert told["kept"]["xla"] == {"entries": 1, "size": 2032}
    assert told["removed"] is None
    assert str(tmp_path / "cache") in _told(capsys)
    told = json.loads(_told(capsys, "--clear", "--json", "-"))
    assert told["removed"] == {"entries": 2, "size": 3064}
    assert read_entry("lanes", "a") is None
    assert "removed: 0 entries" in _told(capsys, "--clear")


def test_where_nothing_is_kept_it_says_so(monkeypatch, capsys):
    monkeypatch.setenv(CACHE_VARIABLE, "")
    assert "nothing is kept" in _told(capsys)
    assert json.loads(_told(capsys, "--json", "-"))["folder"] is None
