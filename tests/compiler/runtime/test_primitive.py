"""Programs as operations of JAX, against plain runs; who is told what they cannot."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxbiped import ArgumentError
from jaxbiped.compiler import deferred_checks
from jaxbiped.compiler.runtime import _kernel
from jaxbiped.compiler.runtime._primitive import call
from jaxbiped.compiler.runtime._program import graph_of
from tests.compiler.one_shot import compiled, let_threads_run


def _called(function):
    program = compiled(function, ())
    return lambda x: call(program, [x])[0]


def _traced(monkeypatch):
    """How often a program has been traced."""
    times = []
    monkeypatch.setattr(_kernel, "graph_of", lambda *given: times.append(1) or graph_of(*given))
    return times


def test_a_program_is_traced_when_it_is_needed(monkeypatch):
    times = _traced(monkeypatch)
    run = jax.jit(_called(jnp.exp))
    assert jax.eval_shape(run, 1.0).dtype == jnp.float64
    assert not times
    np.testing.assert_allclose(run(1.0), np.e)
    np.testing.assert_allclose(run(2.0), np.e**2)
    assert times == [1]


def _at_once(run):
    return run(0.0)


def _compiled(run):
    return jax.jit(run)(0.0)


def _batched(run):
    return jax.jit(jax.vmap(run))(jnp.zeros(3))


@pytest.mark.parametrize("way", [_at_once, _compiled, _batched])
def test_who_runs_what_cannot_be_expressed_is_told(way):
    with pytest.raises(ArgumentError, match="'erf'"):
        way(_called(jax.scipy.special.erf))


def test_lowered_ahead_whoever_checks_is_told():
    run = jax.jit(_called(jax.scipy.special.erf))
    with deferred_checks() as programs:
        run.lower(0.0).compile()
    (program,) = programs
    with pytest.raises(ArgumentError, match="'erf'"):
        program.check()


def test_what_was_lowered_ahead_runs():
    run = jax.jit(_called(jnp.log))
    with deferred_checks() as programs:
        run.lower(1.0).compile()
    for program in programs:
        program.check()
    assert float(run(1.0)) == 0.0


def test_many_simulations_run_in_a_thread_though_one_is_quick(monkeypatch):
    """Only there an interrupt ends them; a single one would lose time by it."""
    quicks = []

    def watched(run, *given, quick):
        quicks.append(quick)
        run(*given, quick=quick)

    let_threads_run(monkeypatch, watched)
    program = compiled(jnp.exp, ())
    for quick in (True, False):
        run = lambda x, quick=quick: call(program, [x], quick=quick)[0]
        np.testing.assert_allclose(run(1.0), np.e)
        np.testing.assert_allclose(jax.vmap(run)(jnp.zeros(2)), np.ones(2))
    assert quicks == [True, False, False, False]
