"""Each part of a fingerprint, against things that differ in it alone."""

import types

import jax
import numpy as np
import pytest

from jaxbiped.caching._fingerprint import fingerprint, settings


def _scaled(x, y=1.0, *, factor=2.0):
    return x * y * factor


HOME = "jaxbiped._circular"


def of_the_package(*, code=_scaled.__code__, defaults=(1.0,), kwdefaults=None, name="scaled"):
    """A function as the package might define it, of the same name and place each time."""
    made = types.FunctionType(code, {"__name__": HOME}, "scaled", defaults)
    made.__kwdefaults__ = {"factor": 2.0} if kwdefaults is None else kwdefaults
    made.__module__, made.__qualname__ = HOME, name
    return made


OTHER = _scaled.__code__.replace(co_code=_scaled.__code__.co_code + _scaled.__code__.co_code[-2:])


@pytest.mark.parametrize(
    "change",
    [
        dict(defaults=(2.0,)),
        dict(kwdefaults={"factor": 3.0}),
        dict(name="shifted"),
        dict(code=OTHER),
    ],
    ids=["default", "keyword default", "name", "code"],
)
def test_functions_are_told_apart_by(change):
    assert fingerprint(of_the_package()) == fingerprint(of_the_package()) is not None
    assert fingerprint(of_the_package(**change)) != fingerprint(of_the_package())


def test_the_line_of_a_function_is_no_part():
    moved = of_the_package(code=_scaled.__code__.replace(co_firstlineno=1))
    assert fingerprint(moved) == fingerprint(of_the_package())


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (np.zeros(2, np.int32), np.zeros(2, np.float32)),
        (np.zeros((2, 3)), np.zeros((3, 2))),
        (np.array([1.0, 2.0]), np.array([2.0, 1.0])),
        ((1, 2), (2, 1)),
        ({"a": 1}, {"a": 2}),
        ({"a": 1}, {"b": 1}),
        (1, 1.0),
        (True, 1),
        (None, 0),
        ((1, (2,)), ((1, 2),)),
        (slice(0, 2), slice(0, 3)),
    ],
)
def test_values_are_told_apart(one, other):
    assert fingerprint(one) == fingerprint(one) is not None
    assert fingerprint(one) != fingerprint(other)


@pytest.mark.parametrize(
    ("name", "other"),
    [
        ("jax_enable_x64", False),
        ("jax_numpy_dtype_promotion", "standard"),
        ("jax_numpy_rank_promotion", "raise"),
        ("jax_default_matmul_precision", "highest"),
        ("jax_threefry_partitionable", None),
        ("jax_default_prng_impl", "rbg"),
    ],
)
def test_a_setting_of_jax_that_changes_programs_changes_fingerprints(name, other):
    before, told = getattr(jax.config, name), settings()
    own = fingerprint(1)
    try:
        jax.config.update(name, (not before) if other is None else other)
        assert settings() != told
        assert fingerprint(1) != own
    finally:
        jax.config.update(name, before)
    assert fingerprint(1) == own
