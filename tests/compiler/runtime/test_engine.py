"""Engines as twins, against each other: the same numbers, and what each cannot do."""

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


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("times", [[0.5, 1.0, 1.25, 1.5, 1.75, 4.0], [9.0], []])
def test_records_come_at_the_times_of_a_schedule(engine, times):
    """A clock of steps of 1 that ends at 3.5 or later: rows up to there, several in one step."""
    clock = Program(
        lambda end: jnp.zeros(()),
        lambda end, now: (now + 1.0, now + 1.0 >= end),
        lambda end, now: now,
        record=lambda end, now, due: (due <= now, [due, now]),
        scheduled=True,
    )
    found = engine.run(Request(clock, jnp.asarray(3.5), times=np.array(times)))
    expected = [(due, max(np.ceil(due), 1.0)) for due in times if due <= 4.0]
    assert int(found.records.counts) == len(expected)
    rows = np.asarray(found.records.values)
    assert rows.shape == (len(times), 2)
    np.testing.assert_array_equal(rows[: len(expected)], np.reshape(expected, (-1, 2)))


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
    scheduled = replace(RECORDED, scheduled=True)
    assert "not given" in XLA.can(Request(scheduled, number))
    assert XLA.can(Request(scheduled, number, times=np.ones(2))) is None
    for program in (STREAM, RECORDED):
        several = Request(program, np.ones(2), room=3, batch=True)
        assert LANES.can(several) is None
        assert "of a batch" in XLA.can(several)


@pytest.mark.parametrize("backwards", [False, True])
@pytest.mark.parametrize("engine", ENGINES)
def test_one_simulation_reads_what_another_recorded(engine, backwards):
    """Newton's iterates towards √x in the order that they come in, or from the last one on."""

    def attempt(given, carried, row):
        digits, read = carried
        return (digits * 10.0 + row[0], read + 1.0), read + 1.0 >= given

    reader = Program(
        lambda given: (jnp.zeros(()), jnp.zeros(())),
        attempt,
        lambda given, carried: carried[0],
        stream=1,
        backwards=backwards,
    )

    def both(x):
        first = engine.run(Request(RECORDED, x, room=30, keeps_records=True))
        count = first.outputs[1] - 2.0
        stream = first.recording
        total = engine.run(Request(reader, count, stream=stream)).outputs
        return total, count, stream.columns(jnp.zeros(1))[0]

    totals, counts, columns = jax.jit(jax.vmap(both))(jnp.array([16.0, 3e4, 0.5]))
    for total, count, column in zip(totals, counts, np.asarray(columns), strict=True):
        iterates = column[1 : int(count) + 1]
        assert column[0] == 0.0
        assert np.isnan(column[int(count) + 1 :]).all()
        order = iterates[::-1] if backwards else iterates
        expected = np.sum(order * 10.0 ** np.arange(len(order))[::-1])
        assert float(total) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_stream_may_be_an_array_and_ends_with_its_last_row(engine):
    def attempt(given, carried, row):
        total, read = carried
        return (total + row[0] * row[1], read + 1.0), read + 1.0 >= given

    zero = lambda given: (jnp.zeros(()), jnp.zeros(()))
    program = Program(zero, attempt, lambda given, carried: carried[0], stream=2)
    rows = jnp.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]])
    run = lambda most: engine.run(Request(program, jnp.asarray(most), stream=rows)).outputs
    assert float(run(2.0)) == 14.0
    assert float(run(5.0)) == 44.0 + 2.0 * 30.0
