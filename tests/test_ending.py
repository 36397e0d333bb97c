"""Codes with names, against the members that they name and by what they refuse."""

import jax
import jax.numpy as jnp
import pytest

import jaxbiped as jb


def test_a_code_has_a_name():
    assert jb.Ending.of(jnp.asarray(1)) is jb.Ending.FELL_FORWARD
    assert str(jb.Ending.of(9)) == "timed out"


def test_only_one_code_has_a_name():
    with pytest.raises(jb.ArgumentError, match=r"array of shape \(3,\); .* such as Ending.WALKING"):
        jb.Ending.of(jnp.zeros(3, int))
    with pytest.raises(jb.ArgumentError, match="traced value"):
        jax.jit(lambda code: int(jb.Ending.of(code)))(jnp.asarray(0))
