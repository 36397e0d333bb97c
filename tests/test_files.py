"""Files of users: tables of one column."""

import pytest

from jaxbiped import ArgumentError
from jaxbiped._files import read_csv


def table(tmp_path, text):
    path = tmp_path / "table.csv"
    path.write_text(text)
    return read_csv("starts", path)


@pytest.mark.parametrize("rest", ["", ",", ",,"])
def test_a_table_may_have_a_single_column(tmp_path, rest):
    """It needs no comma, and may have some behind it."""
    lines = [f"theta_1{rest}", f"0.1{rest}", f"-0.2{rest}"]
    rows = table(tmp_path, "\n".join(lines))
    assert rows == [(1, ["theta_1"]), (2, ["0.1"]), (3, ["-0.2"])]


@pytest.mark.parametrize("separator", [";", "\t"])
def test_columns_that_no_comma_separates_are_not_taken_for_one(tmp_path, separator):
    with pytest.raises(ArgumentError, match="line 1 has 1 cells, and the header 1: separate"):
        table(tmp_path, f"theta_1{separator}theta_2\n0.1{separator}0.2")
