"""Code sinking, against what one branch, or more than that branch, needs."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.compiler.one_shot import NUMBER, stepped


def _compiled(function):
    """A program that gives `function` of the carried numbers after one attempt."""

    def attempt(given, carried):
        return (function(*carried), carried[1]), jnp.asarray(True)

    return stepped(attempt, (NUMBER, NUMBER), finish=lambda _, carried: carried[0])


def _where(block, op):
    """How many operations of this name a block has, and those inside of it."""
    own = sum(value.op == op for value in block.values)
    inner = [arg for value in block.values for arg in value.args if hasattr(arg, "values")]
    return [own, *(sum(_where(each, op)) for each in inner)]


def _check(compiled, function):
    x = np.array([-2.0, -0.5, 0.5, 3.0, 4.0])
    y = np.array([1.0, 2.0, -3.0, 0.25, -1.0])
    found = compiled.run((x, y)).outputs
    expected = [function(jnp.asarray(a), jnp.asarray(b)) for a, b in zip(x, y, strict=True)]
    np.testing.assert_allclose(found, expected, rtol=1e-14)


def test_what_a_branch_alone_needs_moves_into_it():
    def function(x, y):
        root = jnp.sqrt(jnp.abs(x * y) + 1.0)
        return jax.lax.cond(x > 0.0, lambda: root + y, lambda: y)

    compiled = _compiled(function)
    assert _where(compiled.kernel.graph.body, "sqrt") == [0, 1]
    _check(compiled, function)


@pytest.mark.parametrize("otherwise", [True, False])
def test_what_is_needed_elsewhere_stays(otherwise):
    def function(x, y):
        root = jnp.sqrt(jnp.abs(x) + 1.0)
        if otherwise:
            return jax.lax.cond(x > 0.0, lambda: root * y, lambda: root)
        return root * jax.lax.cond(x > 0.0, lambda: root + y, lambda: y)

    compiled = _compiled(function)
    assert _where(compiled.kernel.graph.body, "sqrt") == [1, 0]
    _check(compiled, function)


def test_it_moves_as_far_in_as_it_can():
    def function(x, y):
        root = jnp.sqrt(jnp.abs(x) + 1.0)

        def positive():
            return jax.lax.cond(y > 0.0, lambda: root, lambda: x)

        return jax.lax.cond(x > 0.0, positive, lambda: y)

    compiled = _compiled(function)
    (head,) = (value for value in compiled.kernel.graph.body.values if value.op == "if")
    assert _where(head.args[1], "sqrt") == [0, 1]
    _check(compiled, function)


def test_what_a_loop_needs_as_well_stays():
    def function(x, y):
        roots = jnp.sqrt(jnp.abs(x) + jnp.arange(1.0, 300.0))
        chosen = jax.lax.cond(x > 0.0, lambda: roots[0], lambda: y)
        many = jax.lax.map(lambda each: each * jnp.sin(each * y), roots[:200])
        return chosen + jnp.sum(many)

    _check(_compiled(function), function)
