"""What is known by shapes, against how often it is asked."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxbiped.caching._known_by_shape import known_by_shape


@pytest.fixture
def asked():
    return []


@pytest.fixture
def has_rows(asked):
    @known_by_shape
    def function(tree, least=1):
        asked.append(tree)
        assert isinstance(tree["x"] + 1.0, jax.core.Tracer)
        return tree["x"].shape[0] >= least

    return function


def test_it_is_asked_once_for_all_values_of_a_shape(asked, has_rows):
    for x in (np.zeros(2), jnp.ones(2), np.full(2, 3.0)):
        assert has_rows({"x": x})
    assert len(asked) == 1
    assert has_rows({"x": jnp.zeros(3)})
    assert not has_rows({"x": jnp.zeros(3)}, 4)
    assert has_rows({"x": jnp.zeros(3)}, 3)
    assert len(asked) == 4


def test_it_is_known_where_the_numbers_are_traced(asked, has_rows):
    assert has_rows({"x": jnp.zeros(2)})
    told = []
    jax.jit(lambda x: told.append(has_rows({"x": x})))(jnp.zeros(2))
    assert told == [True]
    assert len(asked) == 1


def test_what_cannot_be_hashed_is_asked_each_time(asked, has_rows):
    for _ in range(2):
        assert has_rows({"x": np.zeros(2), "note": {1}})
    assert len(asked) == 2


def test_an_error_is_raised_each_time(has_rows):
    for _ in range(2):
        with pytest.raises(KeyError, match="x"):
            has_rows({"y": np.zeros(2)})
