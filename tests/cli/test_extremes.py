"""`jaxbiped extremes` and its package, against the sentence that says where the study is now."""

import importlib

import pytest

from jaxbiped.cli import main

MOVED = "the study of extreme cases is experiments/extremes.py in jaxbiped's repository."


@pytest.mark.parametrize("arguments", [(), ("--quick", "--json", "-"), ("--help",)])
def test_the_command_says_where_the_study_is(arguments, capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["extremes", *arguments])
    assert stopped.value.code == 2
    said = f"jaxbiped: extremes is no longer a command: {MOVED}\n"
    assert capsys.readouterr().err == said


def test_the_package_says_where_the_study_is():
    with pytest.raises(ImportError, match=r"jaxbiped\.extremes is no longer part") as raised:
        importlib.import_module("jaxbiped.extremes")
    assert str(raised.value).endswith(MOVED)
