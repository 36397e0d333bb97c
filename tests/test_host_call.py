"""Host calls, against the functions of NumPy arrays that they call."""

import functools
import gc
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.extend.core import Primitive
from jax.interpreters import mlir

from jaxbiped._host_call import _FUNCTIONS, host_call, lower_host_call, lowered_host_calls


class _Sum(NamedTuple):
    """Σ scale x and how many x are positive, of arrays x and y; not for 13."""

    scale: float

    def __call__(self, x, y):
        if np.any(x == 13.0):
            raise ValueError("thirteen is not for us")
        return [self.scale * np.sum(x) + np.sum(y, axis=1), np.sum(x > 0.0)]

    def __fingerprint__(self):
        return "a sum", self.scale


_CALL = Primitive("call_of_the_tests")
_CALL.multiple_results = True
_CALL.def_abstract_eval(
    lambda x, y, scale: [
        jax.core.ShapedArray(y.shape[:1], jnp.float64),
        jax.core.ShapedArray((), jnp.int64),
    ]
)
mlir.register_lowering(
    _CALL, lambda context, *given, scale: lower_host_call(context, host_call(_Sum(scale)), given)
)


def _run(x, y, scale=2.0):
    return _CALL.bind(jnp.asarray(x, float), jnp.asarray(y), scale=scale)


def test_arrays_of_every_kind_arrive_and_come_back():
    y = np.arange(6, dtype=np.float32).reshape(2, 3)
    total, positive = jax.jit(_run)([1.0, -2.0, 4.0], y)
    np.testing.assert_array_equal(total, 6.0 + y.sum(axis=1))
    assert int(positive) == 2
    total, positive = jax.jit(_run)(np.zeros(0), np.zeros((0, 3), bool))
    assert total.shape == (0,)
    assert int(positive) == 0


def test_many_calls_in_a_loop():
    def body(carried):
        k, x = carried
        total, count = _run(x[None], jnp.zeros((1, 1), jnp.int32), 0.5)
        return k + count, total[0] + 1.0

    k, x = jax.jit(lambda x: jax.lax.while_loop(lambda c: c[0] < 50, body, (0, x)))(1.0)
    assert int(k) == 50
    np.testing.assert_allclose(x, 2.0)


def test_what_the_function_says_reaches_the_caller():
    with pytest.raises(jax.errors.JaxRuntimeError, match="thirteen is not for us"):
        jax.block_until_ready(jax.jit(_run)([13.0], np.zeros((1, 1))))


def test_calls_of_one_meaning_are_one():
    kept = host_call(functools.partial(np.multiply, 4.0))
    assert host_call(functools.partial(np.multiply, 4.0)) is kept
    assert kept.storable
    assert host_call(functools.partial(np.multiply, 5.0)).key != kept.key
    unknown = host_call(lambda x: [x])
    assert not unknown.storable
    assert unknown.key != host_call(lambda x: [x]).key


def _calls():
    return [call for call in _FUNCTIONS.values() if isinstance(call.function, _Sum)]


def test_a_program_keeps_what_it_calls():
    run, given = jax.jit(lambda *x: _run(*x, scale=7.0)), (np.ones(2), np.zeros((1, 1)))
    for compiled in (run, run.lower(*given).compile()):
        for _ in range(3):
            jax.clear_caches()
            gc.collect(1)  # what was made here is young; all of a worker takes a second
            total, _ = compiled(*given)
            np.testing.assert_array_equal(total, [14.0])
    assert _calls()
    del run, compiled
    jax.clear_caches()
    gc.collect()
    assert not _calls()


def test_who_lowers_may_keep_the_calls_instead():
    with lowered_host_calls() as calls:
        lowered = jax.jit(_run).lower(np.ones(2), np.zeros((1, 1)))
    assert [call.function for call in calls] == [_Sum(2.0)]
    compiled = lowered.compile()
    total, _ = compiled(np.ones(2), np.zeros((1, 1)))
    np.testing.assert_array_equal(total, [4.0])


def test_functions_of_no_known_meaning_are_never_taken_for_each_other():
    one, other = (host_call(lambda x, k=k: [k * x]) for k in (1, 2))
    assert one.key != other.key
    assert not one.storable
    assert [call.function(3)[0] for call in (one, other)] == [3, 6]
