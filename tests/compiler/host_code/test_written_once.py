"""Host programs, against how often they ask NumPy for a function."""

from collections import Counter
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.compiler.host_code.host_runs import written


class Counted:
    """A number whose functions NumPy asks it for: `calls` counts how often."""

    calls: ClassVar[Counter] = Counter()

    def __init__(self, value):
        self.value = float(value)

    def __float__(self):
        return self.value

    def __add__(self, other):
        return Counted(self.value + float(other))

    def __mul__(self, other):
        return Counted(self.value * float(other))

    __radd__, __rmul__ = __add__, __mul__

    def __gt__(self, other):
        return np.bool_(self.value > float(other))

    def __getattr__(self, name):
        if name not in ("sin", "cos", "exp", "tanh"):
            raise AttributeError(name)
        self.calls[name] += 1
        return lambda: Counted(getattr(np, name)(self.value))


@pytest.fixture
def calls():
    """How often each function is called while a program runs."""
    Counted.calls.clear()
    return Counted.calls


def run(function, *given):
    program = written(function, [np.asarray(each, float) for each in given])
    return program([np.asarray(Counted(each), dtype=object) for each in given])


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
