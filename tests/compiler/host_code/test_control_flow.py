"""Calls, branches and loops in host programs, held against XLA's."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.compiler.host_code.host_runs import check_against_xla

X = np.array([1.0, 2.0, 3.0, 4.0])


def test_a_loop_ends_as_it_does():
    def function(x, most):
        def advance(now):
            k, total, _ = now
            return k + 1, total + x * k, total

        return jax.lax.while_loop(
            lambda now: (now[0] < most) & (jnp.sum(now[1]) < 50.0),
            advance,
            (jnp.asarray(0), jnp.zeros(4), jnp.zeros(4)),
        )

    for most in (0, 3, 10):
        check_against_xla(function, X, np.asarray(most))


def test_what_is_carried_changes_places_at_once():
    def function(x):
        return jax.lax.fori_loop(0, 3, lambda _, pair: (pair[1], pair[0] + 1.0), (x, 2.0 * x))

    check_against_xla(function, X)


@pytest.mark.parametrize("which", [-1, 0, 1, 2, 5])
def test_one_branch_runs(which):
    branches = [lambda x: x, lambda x: jnp.zeros(4), lambda x: (x / 0.0) * x[0]]
    check_against_xla(lambda k, x: jax.lax.switch(k, branches, x), np.asarray(which), X)


def test_a_branch_for_each_row_is_a_choice():
    """A batched conditional chooses by a whole number, which NumPy has to take for a truth."""

    def one(x):
        return jax.lax.cond(x[0] > 0.0, lambda: x + 1.0, lambda: -x)

    rows = np.array([[1.0, 2.0], [-1.0, 2.0], [0.0, 3.0]])
    check_against_xla(jax.vmap(one), rows)
    check_against_xla(one, rows[1])


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_a_branch_shares_with_what_follows_is_known_there(sign):
    """A part of an array that a branch is the first to need, and equal operations of both sides."""

    def function(s, x):
        part = x[1:3]
        chosen = jax.lax.cond(s > 0.0, lambda: part * x[0], lambda: jnp.sin(part))
        return chosen, part + 1.0, part * x[0], jnp.sin(x[1:3])

    check_against_xla(function, np.asarray(sign), X)


def test_a_branch_within_a_loop_within_a_branch():
    def function(s, x):
        def turn(k, total):
            return jax.lax.cond(k % 2 == 0, lambda: total + x, lambda: total * s)

        return jax.lax.cond(s > 0.0, lambda: jax.lax.fori_loop(0, 5, turn, x), lambda: x[0] * x)

    for s in (2.0, -2.0):
        check_against_xla(function, np.asarray(s), X)


@pytest.mark.parametrize("reverse", [True, False])
def test_a_scan_carries_and_collects(reverse):
    def function(x, rows):
        def turn(total, row):
            return total + row * x, (total, row[0])

        return jax.lax.scan(turn, x, rows, reverse=reverse)

    check_against_xla(function, X, np.arange(12.0).reshape(3, 4))


def test_a_map_over_rows():
    check_against_xla(lambda rows: jax.lax.map(jnp.sum, rows), np.arange(12.0).reshape(3, 4))


def test_derivatives_are_programs_as_well():
    def function(x):
        return jax.jacfwd(lambda y: jnp.where(y > 2.0, jnp.sin(y), y**2))(x), jax.grad(jnp.sum)(x)

    check_against_xla(function, X)
