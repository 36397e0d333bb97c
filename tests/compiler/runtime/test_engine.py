"""Engines as twins: the same programs, the same numbers, and what each says that it cannot do."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxbiped.compiler import LANES, XLA, LoopEngine, Program, Request

ENGINES = (LANES, XLA)


def _attempt(x, carried):
    """Newton's step towards √x, and whether it is there."""
    y, count = carried
    new = 0.5 * (y + x / y)
    return (new, count + 1.0), jnp.abs(new - y) <= 1e-14 * new


ROOT = Program(lambda x: (x, jnp.zeros_like(x)), _attempt, lambda x, carried: carried)
RECORDED = replace(ROOT, record=lambda x, carried, _: (carried[1] > 2.0, [carried[0]]))
STREAM = replace(ROOT, attempt=lambda x, c, row: _attempt(x + 0.0 * row[0], c), stream=1)
ERF = replace(ROOT, finish=lambda x, carried: jax.scipy.special.erf(carried[0]))


@pytest.mark.parametrize("engine", ENGINES)
def test_one_simulation_many_and_a_batch_are_the_same(engine):
    values = np.array([2.0, 9.0, 1e6, 1e-3])
    one = [engine.run(Request(ROOT, jnp.asarray(x))).outputs[0] for x in values]
    many = jax.vmap(lambda x: engine.run(Request(ROOT, x)).outputs[0])(jnp.asarray(values))
    batch = engine.run(Request(ROOT, values, batch=True)).outputs[0]
    np.testing.assert_allclose(one, np.sqrt(values), rtol=1e-15)
    np.testing.assert_array_equal(one, many)
    np.testing.assert_array_equal(one, batch)


def test_both_engines_take_the_same_steps():
    for x in (2.0, 1e5):
        lanes, xla = (engine.run(Request(ROOT, jnp.asarray(x))).outputs for engine in ENGINES)
        assert lanes[1] == xla[1]
        np.testing.assert_allclose(lanes[0], xla[0], rtol=3e-16)  # products may be fused


@pytest.mark.parametrize("engine", ENGINES)
def test_records_are_those_that_the_program_makes(engine):
    found = engine.run(Request(RECORDED, jnp.asarray(1e4), room=30))
    count = int(found.records.counts)
    assert count == int(found.outputs[1]) - 2
    kept = np.asarray(found.records.values)[:count, 0]
    assert (np.diff(kept) <= 0.0).all()
    np.testing.assert_allclose(kept[-1], 100.0, rtol=1e-15)


def test_a_batch_larger_than_the_slots_keeps_its_order():
    values = np.linspace(1.0, 50.0, 23)
    found = LoopEngine(slots=4).run(Request(ROOT, values, batch=True)).outputs[0]
    np.testing.assert_allclose(found, np.sqrt(values), rtol=1e-15)


def test_the_loop_has_forward_derivatives():
    slope = jax.jacfwd(lambda x: XLA.run(Request(ROOT, x)).outputs[0])(jnp.asarray(4.0))
    assert float(slope) == pytest.approx(0.25, rel=1e-12)


def test_engines_say_what_hinders():
    number = jnp.asarray(2.0)
    assert LANES.can(Request(ROOT, number)) is None
    assert XLA.can(Request(ROOT, number)) is None
    assert "'erf'" in LANES.can(Request(ERF, number))
    assert XLA.can(Request(ERF, number)) is None
    assert LANES.can(Request(STREAM, number)) is None
    assert "read a stream" in XLA.can(Request(STREAM, number))
    assert "given times" in XLA.can(Request(ROOT, number, times=np.ones(2)))
    assert "stay on the host" in XLA.can(Request(RECORDED, number, room=3, keeps_records=True))
