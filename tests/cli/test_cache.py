"""The command cache, against the folder: what is kept on disk, and gone where that is wanted."""

from jaxbiped.caching._disk_cache import CACHE_VARIABLE, read_entry, write_entry
from tests.cli.commands import numbers_of, run


def _told(capsys, *arguments):
    assert run("cache", *arguments) == 0
    return capsys.readouterr().out


def test_it_counts_and_clears(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "cache"))
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


def test_where_nothing_is_kept_it_says_so(monkeypatch, capsys):
    monkeypatch.setenv(CACHE_VARIABLE, "")
    assert "nothing is kept" in _told(capsys)
    assert numbers_of(capsys, "cache")["folder"] is None
