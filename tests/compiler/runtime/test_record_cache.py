"""Records that stay on the host, against runs that keep nothing; memory that is used again."""

import concurrent.futures
import gc

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxbiped.compiler import Recording
from jaxbiped.compiler.runtime._compiled_program import CompiledProgram
from jaxbiped.compiler.runtime._lane_call import BufferPool, LaneCall, LaneRun, Part, RecordCache
from jaxbiped.compiler.runtime._primitive import call
from tests.compiler.one_shot import NUMBER, count_runs, stepped, two_zeros

ROOM = 8


def _record(given, carried, time):
    return carried[1] > 0.0, [carried[1], carried[0]]


@pytest.fixture(scope="module")
def powers():
    """Records factor, factor², … up to as high a power as the inputs say; gives the last."""

    def attempt(given, carried):
        factor, steps = given
        power, count = carried
        return (power * factor, count + 1.0), count + 1.0 >= steps

    start = lambda given: (jnp.ones(()), jnp.zeros(()))
    finish = lambda given, carried: carried[0]
    return stepped(attempt, (NUMBER, NUMBER), start=start, finish=finish, record=_record)


def _doubled():
    """Records twice the second number of each row; gives how many."""

    def attempt(steps, carried, row):
        count = carried[1] + 1.0
        return (2.0 * row[1], count), count >= steps

    finish = lambda steps, carried: carried[1]
    return stepped(attempt, start=two_zeros, finish=finish, record=_record, stream=2)


def _last_sum():
    """Σ of the second numbers in as many rows as the input says."""

    def attempt(steps, carried, row):
        total, count = carried
        return (total + row[1], count + 1.0), count + 1.0 >= steps

    return stepped(attempt, start=two_zeros, finish=lambda steps, c: c[0], stream=2)


@pytest.fixture
def runs(powers, monkeypatch):
    """Asked for, how many simulations each run of the program took."""
    every = count_runs(monkeypatch)
    return lambda: [simulations for program, simulations, _ in every if program == powers]


@pytest.fixture
def holds(monkeypatch):
    """Lets records be held up to so many bytes."""

    def held(most):
        monkeypatch.setattr(
            "jaxbiped.compiler.runtime._lane_call._RECORDS", RecordCache(lambda: most)
        )

    return held


def _recording(powers, factor, steps):
    given = (jnp.asarray(factor), jnp.asarray(steps))
    return call(powers, given, room=ROOM, quick=True, keeps_records=True)


def test_what_was_recorded_is_told_later_without_a_run(powers, runs):
    last, recording = _recording(powers, 3.0, 4.0)
    counts, values = recording.columns(np.array([0.0, 1.0]))
    nothing = [np.nan] * (ROOM - 4)
    np.testing.assert_array_equal(counts, [0, 1, 2, 3, 4, *nothing])
    np.testing.assert_array_equal(values, [1, 3, 9, 27, 81, *nothing])
    assert float(last) == 81.0
    assert runs() == [1]
    _recording(powers, 3.0, 4.0)
    assert runs() == [1, 1]


def test_what_is_no_longer_held_is_run_again(powers, runs, holds):
    holds(0)
    _, recording = _recording(powers, 1.5, 2.0)
    _, values = recording.columns(np.array([0.0, 1.0]))
    np.testing.assert_array_equal(values[:3], [1.0, 1.5, 2.25])
    assert runs() == [1, 1]


def test_a_recording_is_another_programs_stream(powers, runs):
    reader = _last_sum()

    def both(factor, steps):
        _, recording = _recording(powers, factor, steps)
        total, _ = call(reader, steps, stream=recording)
        return total, recording.columns(jnp.zeros(2))[1]

    factors, steps = jnp.array([2.0, 3.0, 0.5]), jnp.array([3.0, 1.0, 5.0])
    totals, values = jax.jit(jax.vmap(both))(factors, steps)
    np.testing.assert_allclose(totals, [14.0, 3.0, 0.96875])
    np.testing.assert_allclose(np.nansum(values, axis=1), totals)
    assert runs() == [3]
    assert float(both(jnp.asarray(2.0), jnp.asarray(3.0))[0]) == 14.0


def test_what_is_read_but_once_is_then_no_longer_held(powers, runs):
    given = (jnp.asarray(0.25), jnp.asarray(2.0))
    _, recording = call(powers, given, room=ROOM, quick=True, keeps_records=True, reads_once=True)
    reader = _last_sum()
    sums = [float(call(reader, jnp.asarray(2.0), stream=recording)[0]) for _ in range(3)]
    assert sums == [0.3125] * 3
    assert runs() == [1, 1, 1]


@pytest.mark.parametrize("most", [0, 1 << 20])
def test_what_reads_a_recording_may_record_as_well(powers, holds, most):
    holds(most)
    doubled, reader = _doubled(), _last_sum()

    def total(factor, steps):
        _, recording = _recording(powers, factor, steps)
        count, twice = call(
            doubled, steps, room=ROOM, quick=True, stream=recording, keeps_records=True
        )
        return count, call(reader, steps, stream=twice)[0], twice.columns(jnp.zeros(1))[0]

    factors, steps = jnp.array([2.0, 3.0]), jnp.array([3.0, 2.0])
    counts, sums, numbers = jax.jit(jax.vmap(total))(factors, steps)
    np.testing.assert_array_equal(counts, steps)
    np.testing.assert_allclose(sums, [28.0, 24.0])
    np.testing.assert_array_equal(numbers[:, :4], [[0.0, 1.0, 2.0, 3.0], [0.0, 1.0, 2.0, np.nan]])


def test_more_than_are_run_at_once(powers):
    reader = _last_sum()

    def total(factor):
        _, recording = _recording(powers, factor, jnp.asarray(2.0))
        return call(reader, jnp.asarray(2.0), stream=recording)[0]

    factors = jnp.linspace(0.1, 2.0, 1200)
    np.testing.assert_allclose(jax.vmap(total)(factors), factors + factors**2)


def test_leaves_can_be_stacked(powers):
    _, one = _recording(powers, 2.0, 3.0)
    _, other = _recording(powers, 4.0, 2.0)
    stacked = jax.tree.map(lambda *pair: jnp.stack(pair), one, other)
    _, values = jax.vmap(Recording.columns)(stacked, jnp.zeros((2, 2)))
    np.testing.assert_array_equal(values[:, 2], [4.0, 16.0])


def test_what_came_first_goes_first():
    ran = []

    def run(table):
        ran.extend(table[:, 0])
        return table.copy(), np.ones((len(table), 3, 1)), np.full(len(table), 2)

    # An input and two records of one number each: 24 bytes a simulation.
    held = RecordCache(lambda: 50)
    for number in (1.0, 2.0, 3.0):
        np.testing.assert_array_equal(held.run("program", np.array([[number]]), run)[0], [[number]])
    held.records("program", np.array([[3.0], [2.0]]), run)
    assert ran == [1.0, 2.0, 3.0]
    rows = held.records("program", np.array([[1.0], [3.0]]), run)
    assert [each.shape for each in rows] == [(2, 1), (2, 1)]
    assert ran == [1.0, 2.0, 3.0, 1.0]
    held.records("another", np.array([[3.0]]), run)
    assert ran == [1.0, 2.0, 3.0, 1.0, 3.0]


def test_simulations_without_records_take_room_as_well():
    held = RecordCache(lambda: 800)

    def run(table):
        n = len(table)
        return table, np.zeros((n, 3, 1)), np.zeros(n, dtype=int)

    held.run("program", np.arange(1000.0)[:, None], run)
    assert held.kept == 800
    held.clear()
    assert held.kept == 0


def _address(array):
    return array.ctypes.data


def test_memory_that_nobody_uses_is_given_again():
    memory = BufferPool(lambda: 1 << 20)
    first = memory.array((10, 100))
    first[:] = 1.0
    where = _address(first)
    del first
    # Not quite as large, but as nearly as sizes are told apart.
    assert _address(memory.array((10, 99))) == where


def test_memory_that_a_view_refers_to_is_not_given_again():
    memory = BufferPool(lambda: 1 << 20)
    first = memory.array((10, 100))
    where, row = _address(first), first[3, 5:]
    del first
    gc.collect()
    row[:] = 7.0
    other = memory.array((10, 100))
    assert _address(other) != where
    other[:] = 0.0
    np.testing.assert_array_equal(row, np.full(95, 7.0))
    del row
    assert _address(memory.array((10, 100))) == where


def test_no_more_is_kept_than_allowed():
    memory = BufferPool(lambda: 20_000)
    arrays = [memory.array((1000,)) for _ in range(3)]
    places = [_address(each) for each in arrays]
    while arrays:
        arrays.pop(0)
    # There is room for two of 8192 bytes: the last ones.
    assert memory.kept == 2 * 8192
    again = [memory.array((1000,)) for _ in range(2)]
    assert [_address(each) for each in again] == [places[2], places[1]]
    assert memory.kept == 0
    del again
    memory.array((10_000,))
    assert memory.kept == 2 * 8192


def test_threads_never_share_memory():
    memory = BufferPool(lambda: 1 << 20)

    def use(number):
        for _ in range(300):
            array = memory.array((50,))
            array[:] = number
            view = array[10:]
            del array
            if not np.all(view == number):
                return False
        return True

    with concurrent.futures.ThreadPoolExecutor(8) as threads:
        assert all(threads.map(use, range(8)))


@pytest.mark.parametrize("shape", [(0, 5), (1,), (3, 0), (7, 11, 13)])
def test_shapes(shape):
    array = BufferPool(lambda: 0).array(shape)
    assert array.shape == shape
    assert array.dtype == np.float64
    array[...] = 2.0
    assert np.sum(array) == 2.0 * array.size


def test_a_reader_is_ready_only_with_the_code_that_makes_its_records_again(powers, monkeypatch):
    reader = _last_sum()
    call_kept = LaneCall(1, LaneRun(reader, reads=LaneRun(powers, ROOM)), Part.ALL)
    for has_code, ready in (({reader}, False), ({reader, powers}, True), ({powers}, False)):
        monkeypatch.setattr(
            CompiledProgram, "runs_at_once", lambda program, count, known=has_code: program in known
        )
        assert call_kept.ready() is ready
