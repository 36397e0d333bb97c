"""Programs of JAX, emitted, against JAX itself."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jaxbiped import ArgumentError
from jaxbiped.compiler import count_operations, host
from tests.compiler.one_shot import compiled, evaluate, stepped

POINTS = np.concatenate([np.linspace(-3.0, 3.0, 21), [0.0, np.inf, -np.inf, np.nan]])


def _loop(x):
    def halve(_, ends):
        lower, upper = ends
        middle = 0.5 * (lower + upper)
        above = middle * middle > jnp.abs(x)
        return jnp.where(above, lower, middle), jnp.where(above, middle, upper)

    return jax.lax.fori_loop(0, 30, halve, (jnp.zeros_like(x), 2.0 + jnp.abs(x)))[0]


def _branches(x):
    return jax.lax.switch(
        (x > 0.0).astype(jnp.int32) + (x > 1.0).astype(jnp.int32),
        [lambda x: -x, lambda x: x * x, lambda x: jnp.sqrt(x) + 3.0],
        x,
    )


def _nested(x):
    return jax.lax.cond(
        x > 0.0, lambda: jax.lax.cond(x > 1.0, lambda: x * 3.0, lambda: x * 5.0), lambda: 7.0 - x
    )


def _mapped(x):
    columns = jnp.stack([x * k for k in range(11)])
    pairs = columns, jnp.arange(1.0, 12.0)
    found = jax.lax.map(lambda pair: (jnp.sin(pair[0]) + x, pair[0] * pair[1]), pairs)
    return jnp.max(found[0]) + jnp.sum(found[1])


def _partly_the_same(x):
    """Half of what each run of the loop computes is no matter of the run."""
    columns = jnp.stack([x * k for k in range(9)])
    return jnp.sum(jax.lax.map(lambda c: jnp.sin(x) * c + jnp.exp(-x * x), columns))


def _long_body(x):
    """Few runs of a loop that is too long to be written out."""

    def body(c):
        for k in range(800):
            c = c * 0.999 + (k + 1) * x
        return c

    return jnp.sum(jax.lax.map(body, jnp.stack([x, 2.0 * x, x * x])))


def _arrays(x):
    matrix = jnp.stack([jnp.stack([x, x + 1.0, 2.0 * x]), jnp.stack([x * x, 1.0 - x, x])])
    both, none = (part @ jnp.arange(6.0).reshape(3, 2) for part in (matrix, matrix[:0]))
    return jnp.concatenate([both.ravel(), none.ravel(), matrix[:, ::-1].T.reshape(-1)[1:4]])


def _padded(x):
    row = jnp.stack([x, x + 1.0, 2.0 * x])
    inner = jax.lax.pad(row, 0.5, [(1, 2, 1)])
    first, *rest = jnp.unstack(jax.lax.pad(row, 0.0, [(-1, 1, 0)]))
    return jnp.concatenate([inner, jnp.stack([first * 3.0, *rest])])


def _whole(x):
    number = jnp.round(jnp.clip(x, -1e6, 1e6)).astype(jnp.int32)
    return jnp.where((number & 1) != 0, number + 3, number * 2).astype(jnp.float64)


def _unrolled(x):
    return jax.lax.scan(lambda c, k: (c * 0.5 + k, c), x, jnp.arange(3.0))[1]


CASES = {
    "arithmetic": lambda x: (x + 2.0) * (x - 3.0) / (x * x + 1.0) - (-x),
    "fused": lambda x: x * 0.1 + x * 0.7 - (1.0 - x * 0.3),
    "extremes": lambda x: jnp.maximum(x, 0.5) + jnp.minimum(x, -0.5) * jnp.clip(x, -1.0, 2.0),
    "comparisons": lambda x: ((x > 0.0) & ~(x >= 1.0) | (x == 2.0)) ^ (x != x),
    "signs": lambda x: jnp.sign(x) + jnp.abs(x) * jnp.where(x < 0.0, -1.0, 1.0),
    "powers": lambda x: x**3 + x**-2 + jnp.square(x),
    "rounding": lambda x: jnp.round(x * 1.7) + jnp.floor(x * 1.3) + jnp.ceil(x * 0.9),
    "finite": lambda x: jnp.isfinite(x),
    "derivative": jax.grad(lambda x: jnp.tanh(x) * jnp.exp(-x * x)),
    "loop": _loop,
    "branches": _branches,
    "nested": _nested,
    "mapped": _mapped,
    "partly the same": _partly_the_same,
    "long body": _long_body,
    "arrays": _arrays,
    "padded": _padded,
    "whole numbers": _whole,
    "unrolled": _unrolled,
}


@pytest.mark.parametrize("name", CASES)
def test_what_is_emitted_computes_what_jax_does(name):
    function = CASES[name]
    # An exact zero times infinity is zero in lanes.
    points = POINTS[np.isfinite(POINTS)] if name in ("whole numbers", "arrays") else POINTS
    # XLA compiles a long body for many seconds; operation by operation it computes the same.
    with jax.disable_jit(name == "long body"):
        expected = jax.vmap(function)(jnp.asarray(points))
    found = evaluate(function, points)
    assert found.dtype == expected.dtype
    np.testing.assert_allclose(found, expected, rtol=1e-14, atol=1e-14)


@pytest.mark.parametrize("name", CASES)
def test_the_same_bits_at_every_width(name):
    program = compiled(CASES[name], ())
    ways = (dict(width=1, threads=1), dict(width=host().width, threads=2))
    np.testing.assert_array_equal(*(program.run([POINTS], **way).outputs for way in ways))


def test_a_loop_computes_once_what_is_the_same_in_each_run():
    program = stepped(lambda x, carried: (_partly_the_same(carried), jnp.asarray(True)))
    block = program.kernel.graph.body
    (loop,) = (value for value in block.values if value.op == "map")
    inside = {value.op for value in loop.args[1].values}
    assert inside <= {"taken", "part", "fmul", "fadd"}
    assert "rint" in {value.op for value in block.values}  # of the exponential


def test_short_loops_of_long_bodies_stay_loops():
    loops = [
        sum(value.op == "map" for value in compiled(function, ()).kernel.graph.end.values)
        for function in (_long_body, _unrolled)
    ]
    assert loops == [1, 0]


@given(st.lists(st.floats(width=64, allow_subnormal=False), min_size=1, max_size=17))
@settings(max_examples=30, deadline=None)
def test_any_number_is_compared_as_in_jax(numbers):
    points = np.array(numbers)
    found = _COMPARED.run([points, points[::-1].copy()]).outputs
    expected = _compare(points, points[::-1], np)
    for a, b in zip(found, expected, strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("exponent", [1.5, 1.2, 0.5, 2.0, -1.5, 0.0])
def test_a_power_written_with_logarithms(exponent):
    """As the laws have it; for 3/2 it is a product with the root."""

    def force(x, n):
        return jnp.exp(n * jnp.log(x))

    points = np.concatenate([10.0 ** np.linspace(-120.0, 120.0, 26), [0.0, 1.0, np.inf]])
    given = points, np.full(len(points), exponent)
    derivatives = jax.grad(force, argnums=(0, 1))
    found = evaluate(lambda *z: (force(*z), *derivatives(*z)), *given)
    with np.errstate(all="ignore"):
        np.testing.assert_allclose(found[0], np.exp(exponent * np.log(points)), rtol=3e-13)
    regular = [each[:26] for each in given]
    for a, b in zip(found[1:], jax.vmap(derivatives)(*regular), strict=True):
        np.testing.assert_allclose(a[:26], b, rtol=3e-13)


def _compare(a, b, library=jnp):
    return [a < b, a <= b, a == b, a != b, library.maximum(a, b), library.minimum(a, b)]


_COMPARED = compiled(_compare, (), ())


def test_equal_parts_are_computed_once_and_unused_ones_never():
    def wasteful(x, _):
        unused = jnp.exp(x * 5.0)
        del unused
        return jnp.exp(x) + jnp.exp(x) * jnp.exp(x)

    once = count_operations(lambda x, _: jnp.exp(x), 2.0, ())
    # And one sum and one product.
    assert sum(count_operations(wasteful, 2.0, ()).values()) == sum(once.values()) + 2


def test_what_numbers_alone_decide_is_known_before():
    """A diagonal leaves nothing to compute but its own entries."""

    def scaled(x, _):
        row, column = jnp.arange(3)[:, None], jnp.arange(3)
        return jnp.where(row + 1 <= column, x, 0.0) + jnp.where(row == column, x * x, 0.0)

    assert count_operations(scaled, 2.0, ()) == {"fmul": 1}


def test_a_condition_of_two_branches_is_compared_once():
    """The number of the branch that JAX makes of it is not compared again."""

    def one_of_two(x, _):
        return jax.lax.cond(x > 0.5, lambda: 3.0 * x, lambda: x * x)

    assert count_operations(one_of_two, 2.0, ()) == {"fmul": 2, "fcmp ogt": 1, "if": 1}


def test_equal_calls_are_lowered_once():
    """Their conditionals, too, which are not shared by themselves."""
    called = jax.jit(lambda x: jax.lax.cond(x > 0.5, jnp.exp, lambda x: 2.0 * x, x))

    def conditionals(function):
        return sum(value.op == "if" for value in compiled(function, ()).kernel.graph.end.values)

    once = conditionals(called)
    assert once > 0
    assert conditionals(lambda x: called(x) + 3.0 * called(x)) == once
    assert conditionals(lambda x: called(x) + 3.0 * called(x + 1.0)) == 2 * once
    points = np.array([0.1, 0.6, 2.0])
    found = evaluate(lambda x: called(x) + 3.0 * called(x), points)
    np.testing.assert_allclose(found, 4.0 * np.where(points > 0.5, np.exp(points), 2.0 * points))


def test_an_unknown_primitive_is_named():
    with pytest.raises(ArgumentError, match=r"'erf'.*engine=\"xla\""):
        compiled(jax.scipy.special.erf, ()).check()


def test_arrays_that_a_conditional_chooses_are_the_same_for_any_width():
    """Of one simulation they stay in memory; kept, chosen within a choice, and read by a map."""

    def attempt(x, carried):
        rows, count = carried

        def grown():
            more = jax.lax.map(lambda row: row * x + 1.0, rows)
            return jax.lax.cond(
                count > 3.0, lambda: jax.lax.map(lambda row: row * row, more), lambda: more
            )

        chosen = jax.lax.cond(jnp.abs(count - 3.0) < 2.5, grown, lambda: rows)
        turned = jax.lax.map(lambda each: each[0] + each[1], (chosen, rows[::-1]))
        after = jnp.where(count < 6.0, chosen, turned), count + 1.0
        return after, count > 6.0

    def start(x):
        return jnp.arange(22.0).reshape(11, 2) / 7.0 * x, jnp.zeros(())

    points = np.linspace(0.1, 0.9, 9)  # of one sign: fused products round otherwise
    program = stepped(attempt, start=start)
    narrow, wide = (program.run(points, width=w).outputs[0] for w in (1, host().width))
    np.testing.assert_array_equal(narrow, wide)
    for x, found in zip(points, narrow, strict=True):
        carried, over = start(x), False
        while not over:
            carried, over = attempt(x, carried)
        np.testing.assert_allclose(found, carried[0], rtol=1e-13)
