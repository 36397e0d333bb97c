"""The renames of the changelog, against the package: new names there, old ones gone."""

import inspect
import re
import tomllib
from pathlib import Path

import pytest

import jaxbiped as jb
from tests.public_names import find, is_there

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "CHANGELOG.md").read_text()
ARGUMENT = re.compile(r"(.*)\((\w+)=…\)")


def rows_below(title):
    """Both cells of each row of the table below a title."""
    section = re.split(r"^#+ ", PAGE[PAGE.index(title) + len(title) :], flags=re.MULTILINE)[0]
    return re.findall(r"^\| (`.*?) \| (.*) \|$", section, flags=re.MULTILINE)


RENAMED = [(old.strip("`"), new.strip("`")) for old, new in rows_below("### Renamed\n")]
GONE = [old.strip("`") for old, _ in rows_below("### Gone\n")]


def moved(title):
    """Names and their new namespaces in the table below a title."""
    rows = ((names, space.strip("`")) for space, names in rows_below(title))
    return [(name, space) for names, space in rows for name in re.findall(r"`(\w+)`", names)]


MOVED = moved("### Moved under the same name\n")
DEPRECATED = moved("### Moved, the old name deprecated\n")


def _arguments(name):
    return set(inspect.signature(find(name)).parameters)


def test_the_tables_are_found():
    assert len(RENAMED) >= 12
    assert len(GONE) >= 3
    assert len(MOVED) > 130
    assert len(DEPRECATED) == 12


@pytest.mark.parametrize(("old", "new"), RENAMED)
def test_what_was_renamed_has_its_new_name_alone(old, new):
    if argument := ARGUMENT.fullmatch(new):
        function, name = argument.groups()
        assert name in _arguments(function)
        assert ARGUMENT.fullmatch(old)[2] not in _arguments(function)
        return
    assert is_there(new)
    owner = new.rpartition(".")[0] if "." in old else "jb"
    assert not is_there(f"{owner}.{old.rpartition('.')[2]}")


@pytest.mark.parametrize("name", GONE)
def test_what_is_gone_is_not_there(name):
    own, _, attribute = name.rpartition(".")
    assert not is_there(f"jb.gait.{name}" if own else f"jb.{attribute}")


@pytest.mark.parametrize(("name", "space"), MOVED)
def test_what_moved_is_in_its_namespace_alone(name, space):
    assert is_there(f"{space}.{name}")
    assert not is_there(f"jb.{name}")


@pytest.mark.parametrize(("name", "space"), DEPRECATED)
def test_what_moved_in_this_release_still_works_with_a_warning(name, space):
    with pytest.warns(DeprecationWarning, match=f"it is {space}.".replace("jb", "jaxbiped")):
        assert getattr(jb, name) is find(f"{space}.{name}")
    assert name not in jb.__all__


def test_the_first_section_is_of_this_version():
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert re.search(r"^## (\S+)", PAGE, flags=re.MULTILINE)[1] == version
