"""Host programs, against how often they ask NumPy for a function."""

from collections import Counter

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxbiped.compiler.host_code._host_writer import NAMES
from tests.compiler.host_code.host_runs import written


@pytest.fixture
def calls(monkeypatch):
    """How often each function is called while programs run that are written in the test."""
    found = Counter()

    def counted(name):
        def called(*given):
            found[name] += 1
            return getattr(np, name)(*given)

        return called

    for name in ("sin", "cos", "exp", "tanh"):
        monkeypatch.setitem(NAMES, name, counted(name))
    return found


def run(function, *given):
    given = [np.asarray(each, float) for each in given]
    return written(function, given)(given)


def test_equal_operations_are_one_and_what_nothing_needs_is_none(calls):
    def function(x, y):
        unused = jnp.exp(x * y)
        del unused
        return jnp.sin(x) + y, jnp.sin(x) * jnp.cos(y) + jnp.sin(y)

    first, second = run(function, 0.3, 0.7)
    assert float(first) == np.sin(0.3) + 0.7
    assert float(second) == np.sin(0.3) * np.cos(0.7) + np.sin(0.7)
    assert calls == {"sin": 2, "cos": 1}


def test_what_is_the_same_in_every_turn_is_computed_before_the_loop(calls):
    def function(x, y):
        def turn(_, now):
            def inner(_, now):
                return now + jnp.sin(x) * jnp.tanh(y + now)

            return jax.lax.fori_loop(0, 3, inner, now + jnp.cos(x) + jnp.exp(now))

        return jax.lax.fori_loop(0, 4, turn, y)

    found = run(function, 0.3, -0.7)
    now = -0.7
    for _ in range(4):
        now = now + np.cos(0.3) + np.exp(now)
        for _ in range(3):
            now = now + np.sin(0.3) * np.tanh(-0.7 + now)
    assert float(found) == pytest.approx(now, rel=1e-14)
    assert calls == {"sin": 1, "cos": 1, "exp": 4, "tanh": 12}


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_only_the_branch_that_is_taken_computes_its_own(calls, sign):
    def function(x):
        shared = jnp.cos(x)
        return jax.lax.cond(
            x > 0.0, lambda: shared + jnp.sin(x), lambda: shared * jnp.tanh(x) + jnp.exp(x)
        )

    found, x = run(function, 0.4 * sign), 0.4 * sign
    expected = np.cos(x) + np.sin(x) if sign > 0.0 else np.cos(x) * np.tanh(x) + np.exp(x)
    assert float(found) == pytest.approx(expected, rel=1e-15)
    own = {"sin": 1} if sign > 0.0 else {"tanh": 1, "exp": 1}
    assert calls == {"cos": 1} | own
