"""The nightly tier's shares, against what a partition is: all of it, and nothing twice."""

from pathlib import Path

import pytest

from tests.nightly import Share


class Item:
    """A test as pytest collects it."""

    def __init__(self, path, number, *, nightly=True):
        self.path, self.number, self.nightly = Path(path), number, nightly

    def get_closest_marker(self, name):
        return self.nightly and name == "nightly"


ITEMS = [Item(f"test_{k}.py", number) for k in range(7) for number in range(3)]
QUICK = [Item("test_2.py", 3, nightly=False), Item("test_quick.py", 0, nightly=False)]


def test_shares_are_a_partition_of_the_tier_that_leaves_files_whole():
    shares = [Share(k, 3).split([*ITEMS, *QUICK])[0] for k in range(3)]
    assert sorted(id(item) for share in shares for item in share) == sorted(map(id, ITEMS))
    folders = [{item.path for item in share} for share in shares]
    assert [len(each) for each in folders] == [3, 2, 2]
    assert len(set.union(*folders)) == 7


def test_what_is_left_is_all_the_rest():
    taken, left = Share(1, 3).split([*ITEMS, *QUICK])
    assert set(QUICK) <= set(left)
    assert {*taken, *left} == {*ITEMS, *QUICK}
    assert not {*taken} & {*left}


def test_any_number_chooses_a_share():
    assert Share.parse("0/1") == Share(0, 1)
    assert Share.parse(f"{0xF75FF4C}/6") == Share(0xF75FF4C % 6, 6)


@pytest.mark.parametrize("text", ["", "3", "3/0", "/4", "3/", "-1/4", "a/4"])
def test_what_is_no_share_costs_one_sentence(text):
    with pytest.raises(pytest.UsageError, match=r"is not allowed; give I/N"):
        Share.parse(text)
