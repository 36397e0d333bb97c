"""The nightly tier's shares, against what a partition is: all of it, and nothing twice."""

import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

from tests.nightly import PARTS, Share, deal, share_of_hour


class Item:
    """A test as pytest collects it."""

    def __init__(self, path, number, *, nightly=True):
        self.path, self.number, self.nightly = Path(path), number, nightly

    def get_closest_marker(self, name):
        return self.nightly and name == "nightly"


ITEMS = [Item(f"test_{k}.py", number) for k in range(7) for number in range(3)]
QUICK = [Item("test_2.py", 3, nightly=False), Item("test_quick.py", 0, nightly=False)]


def test_shares_are_a_partition_of_the_tier_that_leaves_files_whole():
    shares = [Share.parse(f"{k}/3").split([*ITEMS, *QUICK])[0] for k in range(3)]
    assert sorted(id(item) for share in shares for item in share) == sorted(map(id, ITEMS))
    folders = [{item.path for item in share} for share in shares]
    assert [len(files) for files in folders] == [3, 2, 2]
    assert len(set.union(*folders)) == 7


def test_what_is_left_is_all_the_rest():
    taken, left = Share.parse("1/3").split([*ITEMS, *QUICK])
    assert set(QUICK) <= set(left)
    assert {*taken, *left} == {*ITEMS, *QUICK}
    assert not {*taken} & {*left}


def test_parts_have_like_numbers_of_tests():
    # Dealt by name, files of 9 tests would meet in one of two parts: 27 and 3.
    tests = Counter({f"test_{k}.py": (1, 9)[k % 2] for k in range(6)})
    part = deal(tests, 2)
    sizes = [sum(count for path, count in tests.items() if part[path] == k) for k in range(2)]
    assert sorted(sizes) == [12, 18]


def test_a_share_may_be_several_parts():
    first, second = (set(map(id, Share.parse(f"{k}/3").split(ITEMS)[0])) for k in (0, 2))
    both = set(map(id, Share.parse("0,2/3").split(ITEMS)[0]))
    assert both == first | second
    assert Share.parse("0/1") == Share(frozenset({0}), 1)
    assert Share.parse("7,8/6") == Share(frozenset({1, 2}), 6)


@pytest.mark.parametrize("begin", range(24))
def test_all_parts_have_their_turn_within_twelve_hours(begin):
    shares = [Share.parse(share_of_hour((begin + 4 * k) % 24)) for k in range(3)]
    assert [len(share.numbers) for share in shares] == [2, 2, 2]
    assert frozenset().union(*(share.numbers for share in shares)) == set(range(PARTS))
    assert {share_of_hour(4 * (begin // 4) + k) for k in range(4)} == {share_of_hour(begin)}


def test_a_landing_runs_the_share_of_the_time_and_no_other():
    run = Path(__file__).parents[1].joinpath(".ci", "run").read_text()
    assert re.findall(r"make nightly.*", run) == ['make nightly PYTHON="$oldest" SHARE="$share"']
    assert re.findall(r"share=.*", run) == ["share=$(.venv/bin/python -m tests.nightly)"]
    asked = [sys.executable, "-m", "tests.nightly"]
    output = subprocess.run(asked, cwd=Path(__file__).parents[1], capture_output=True, check=True)
    assert output.stdout.decode().strip() in {share_of_hour(hour) for hour in range(24)}


@pytest.mark.parametrize(
    "text", ["", "3", "3/0", "/4", "3/", "-1/4", "a/4", "1,/4", ",/4", "1,b/4"]
)
def test_what_is_no_share_costs_one_sentence(text):
    with pytest.raises(pytest.UsageError, match=r"is not allowed; give I/N"):
        Share.parse(text)
