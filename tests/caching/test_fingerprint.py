"""Fingerprints, against whatever could mean something else; the same in every process."""

import dataclasses
import functools
import subprocess
import sys
import types

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.caching import _fingerprint
from jaxbiped.caching._fingerprint import Leaf, as_leaves, fingerprint, settings
from jaxbiped.hybrid._endings import WATCHES, ending_events
from jaxbiped.optimise._augmented_system import augment
from tests.mechanisms import scene_of

SCENE = as_leaves(jb.seed_scene())

KNOWN = {
    "scene": (SCENE, jb.solvers.Rodas4(), WATCHES),
    "functions": (
        jb.find_gait,
        functools.partial(jb.simulate, footsteps=3),
        ending_events(WATCHES),
    ),
    "made in a call": (as_leaves(augment(augment(jb.seed_state(), ("a",)), ("b",))),),
    "wrapped": (jax.jit(jb.footsteps), jb.MidStance().value),
    "numbers": (1, 1.0, True, "1", b"1", None, np.arange(3), jnp.ones(2), jnp.float64),
}
PRINTED = """
import jax
jax.config.update("jax_numpy_dtype_promotion", "strict")
import tests.caching.test_fingerprint as t
for things in t.KNOWN.values(): print(t.fingerprint(*things))
"""


@pytest.mark.slow
def test_another_process_knows_the_same():
    told = subprocess.run(
        [sys.executable, "-c", PRINTED], capture_output=True, text=True, check=True
    )
    assert told.stdout.split() == [fingerprint(*things) for things in KNOWN.values()]


def test_things_that_differ_are_told_apart():
    stiffer = as_leaves(dataclasses.replace(jb.seed_scene(), friction=jb.laws.Frictionless()))
    things = [
        *KNOWN.values(), (stiffer,), (1,), (1.0,), (True,), ("1",), (None,), (0,), ((),), ((1,),),
        ([1],), ((1, 2),), ((2, 1),), ((1, (2,)),), (((1, 2),),), ({"a": 1},), ({"b": 1},),
        ({"a": 2},), (slice(0, 2),), (slice(0, 3),), (np.zeros(2),), (np.zeros(2, np.int32),),
        (np.zeros(2, np.float32),), (np.zeros((2, 1)),), (np.zeros((2, 3)),), (np.zeros((3, 2)),),
        (np.array([1.0, 2.0]),), (np.array([2.0, 1.0]),), (Leaf((2,), "float64", False),),
        (Leaf((2,), "float64", True),), (0.0,), (-0.0,), (jnp.sin,), (jnp.cos,),
        (functools.partial(jb.simulate, footsteps=2),),
    ]  # fmt: skip
    found = [fingerprint(*each) for each in things]
    assert found == [fingerprint(*each) for each in things]
    assert None not in found
    assert len(set(found)) == len(found)


def test_closures_are_told_apart_by_what_they_hold():
    events = ending_events(WATCHES)
    assert len({fingerprint(event) for event in events}) == len(events)


class _OfATest:
    pass


RING: list[object] = []
RING.append(RING)


@pytest.mark.parametrize(
    "thing",
    [lambda x: x, _OfATest, _OfATest(), object(), iter(()), (1, [_OfATest]), RING],
    ids=["lambda", "class", "object", "plain", "iterator", "within", "within itself"],
)
def test_what_could_change_unseen_has_none(thing):
    assert fingerprint(thing) is None


def test_classes_made_in_a_call_are_known_by_what_makes_them():
    """Two of one name may have other fields; one that does not tell has no fingerprint."""
    states = [augment(jb.seed_state(), names) for names in (("a",), ("b",), ("a", "b"))]
    states.append(augment(states[0], ("b",)))
    assert len({type(each) for each in states}) == len(states)
    for found in (
        [fingerprint(type(each)) for each in states],
        [fingerprint(as_leaves(each)) for each in states],
    ):
        assert None not in found
        assert len(set(found)) == len(found)
    untold = type("_Augmented", (), {"__module__": augment.__module__})
    assert fingerprint(untold) is fingerprint(untold()) is None


def test_traced_arrays_have_none():
    seen = []
    jax.make_jaxpr(lambda x: seen.append(fingerprint(x)) or x)(1.0)
    assert seen == [None]


def test_the_source_counts(monkeypatch):
    before = fingerprint(1)
    monkeypatch.setattr(_fingerprint, "_libraries", lambda: "another version")
    assert fingerprint(1) != before


def _scaled(x, y=1.0, *, factor=2.0):
    return x * y * factor


HOME = "jaxbiped._trigonometry"


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


def test_types_of_states_have_one_each():
    kinds = [type(scene_of(name).state()) for name in ("kneed", "torso")]
    assert len({*map(fingerprint, kinds), None}) == 3
