"""Refusals of arguments: one sentence that begins with the argument and holds what it must."""

import pytest

import jaxbiped as jb


def assert_refused(make, said, *also):
    """`make()` raises an `ArgumentError` that begins with "`said` = " and holds all other words."""
    with pytest.raises(jb.ArgumentError) as caught:
        make()
    assert str(caught.value).startswith(f"{said} = ")
    assert all(word in str(caught.value) for word in also)
