"""Batches on an emulated CUDA device, against lanes: queue, endings, refill, failures."""

import ctypes
import functools
import threading

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxbiped import ResourceError
from jaxbiped.compiler import CUDA, LANES, LaneEngine, Program, Request
from jaxbiped.compiler.runtime._cuda_device import CudaDriver, CudaError, devices
from tests.compiler.fake_driver import NOT_READY, FakeDriver, install, limit_room, load

NEVER = 2000.0


def _attempt(inputs, carried):
    length, growth = inputs
    x, turns = carried
    x = jnp.sin(x) * growth + x
    ended = (turns + 1).astype(jnp.float64) >= jnp.where(jnp.isnan(length), NEVER, length)
    return (x, turns + 1), ended


def _record(inputs, carried, _):
    x, turns = carried
    return jnp.sin(3.0 * turns.astype(jnp.float64)) > 0.0, [x, turns.astype(jnp.float64)]


COUNTING = Program(
    start=lambda inputs: (inputs[1], jnp.zeros((), jnp.int64)),
    attempt=_attempt,
    finish=lambda inputs, carried: carried,
    record=_record,
)


def _inputs(lengths):
    lengths = np.asarray(lengths, dtype=float)
    return lengths, np.linspace(0.1, 0.9, len(lengths))


def run_counting(engine, lengths, room=5):
    found = engine.run(Request(COUNTING, _inputs(lengths), room=room, batch=True))
    return [*found.outputs, *found.records]


def _same(found, expected):
    for a, b in zip(found, expected, strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("count", [1, 3, 8, 9, 100])
def test_every_start_is_taken_once_and_gives_the_lanes_bits(monkeypatch, count):
    fake = install(monkeypatch, lanes=4, multiprocessors=1)
    lengths = 1 + np.random.default_rng(count).integers(0, 40, count)
    found = run_counting(CUDA, lengths)
    _same(found, run_counting(LANES, lengths))
    np.testing.assert_array_equal(found[1], lengths)
    assert fake.launches == [1]
    assert not fake.memory


def test_an_empty_batch_launches_nothing(monkeypatch):
    fake = install(monkeypatch)
    found = CUDA.run(Request(COUNTING, _inputs([]), batch=True))
    assert [len(each) for each in found.outputs] == [0, 0]
    assert not fake.launches


def test_an_endless_or_poisoned_start_does_not_hold_up_the_others(monkeypatch):
    fake = install(monkeypatch, lanes=4, multiprocessors=1)
    lengths, growths = _inputs(np.full(400, 100.0))
    lengths[7], growths[[90, 150]] = np.nan, np.nan
    found = CUDA.run(Request(COUNTING, (lengths, growths), batch=True)).outputs
    expected = np.where(np.isnan(lengths), NEVER, lengths)
    np.testing.assert_array_equal(found[1], expected)
    np.testing.assert_array_equal(np.isnan(found[0]), np.isnan(growths))
    # What all threads of the warps went through, idle or not: to stop, to record, to refill.
    assert np.sum(expected) <= fake.attempts(votes=3) < 1.05 * np.sum(expected)


@pytest.mark.parametrize(("many", "room"), [(3, 1 << 30), (1, 4000)])
def test_devices_share_a_batch_in_parts_that_have_room(monkeypatch, many, room):
    fake = install(monkeypatch, devices=many, lanes=2, multiprocessors=1)
    limit_room(monkeypatch, room)
    lengths = 1 + np.arange(300) % 17
    _same(run_counting(CUDA, lengths), run_counting(LANES, lengths))
    assert len(fake.launches) == 3 if many == 3 else len(fake.launches) > 4
    assert not fake.memory


def test_streams_are_read_in_both_directions(monkeypatch):
    install(monkeypatch, lanes=4, multiprocessors=1)
    for backwards in (False, True):
        program = Program(
            start=lambda inputs: (jnp.zeros(()), jnp.zeros(())),
            attempt=lambda inputs, now, row: (
                (now[0] * 0.5 + row[0] - row[1], now[1] + 1),
                now[1] + 1 >= inputs,
            ),
            finish=lambda inputs, now: now[0],
            stream=2,
            backwards=backwards,
        )
        random = np.random.default_rng(3)
        rows = [random.standard_normal((length, 2)) for length in (1, 4, 7, 2, 9)]
        request = Request(program, np.array([3.0, 4.0, 5.0, 6.0, 7.0]), stream=rows, batch=True)
        _same([CUDA.run(request).outputs], [LANES.run(request).outputs])


@pytest.mark.parametrize("kind", [jnp.int32, jnp.int64])
def test_numbers_beyond_whole_ones_become_the_lanes(monkeypatch, kind):
    """As quadrants of angles are, of a step that has gone astray."""
    install(monkeypatch, lanes=4, multiprocessors=1)
    program = Program(
        start=lambda inputs: inputs,
        attempt=lambda inputs, now: (now, jnp.asarray(True)),
        finish=lambda inputs, now: now.astype(kind),
    )
    end = 2.0 ** (8 * jnp.dtype(kind).itemsize - 1)
    numbers = [2.9, -2.9, end - 1024.0, end, -end, 1e300, -1e300, np.inf, -np.inf, np.nan]
    request = Request(program, np.array(numbers), batch=True)
    found = CUDA.run(request).outputs
    assert int(found[3]) == int(found[-1]) == -int(end)
    _same([found], [LANES.run(request).outputs])


def test_under_jit_and_vmap(monkeypatch):
    install(monkeypatch, lanes=4, multiprocessors=1)

    def run(engine):
        def one(length, growth):
            return engine.run(Request(COUNTING, (length, growth), room=5)).outputs

        return jax.jit(jax.vmap(one))(*map(jnp.asarray, _inputs([3, 9, 1, 12])))

    _same(run(CUDA), run(LANES))


def test_a_device_without_room_says_so_in_a_sentence(monkeypatch):
    fake = install(monkeypatch, room=100)
    with pytest.raises(ResourceError, match=r"out of memory.*smaller batches or chunks"):
        run_counting(CUDA, [3.0] * 50)
    assert not fake.memory


def test_an_interrupt_stops_the_kernel(monkeypatch):
    fake = install(monkeypatch, lanes=2, multiprocessors=1)
    run_counting(CUDA, [1.0])
    stop = threading.Timer(0.3, lambda: ctypes.pythonapi.PyErr_SetInterrupt())
    stop.start()
    with pytest.raises(KeyboardInterrupt):
        run_counting(CUDA, [1e15, 1e15])
    assert not fake.memory


@pytest.mark.parametrize(
    ("options", "why"),
    [
        (dict(devices=0), "there is no CUDA device"),
        (dict(capability=(7, 5)), "older than compute capability 8.0"),
    ],
)
def test_why_there_is_no_device(monkeypatch, options, why):
    fake = FakeDriver(**options)
    load(monkeypatch, fake)
    found = devices.__wrapped__()
    assert not found.usable
    assert why in found.missing


def test_a_driver_that_fails_is_no_device(monkeypatch):
    fake = FakeDriver()
    fake.cuInit = functools.partial(lambda *args: 100)
    load(monkeypatch, fake)
    assert "finds no device" in devices.__wrapped__().missing
    load(monkeypatch, None)
    assert devices.__wrapped__().missing == "no CUDA driver is installed"
    with pytest.raises(CudaError, match="cuInit: launch failed"):
        CudaDriver(fake).call("cuInit", 0)


def test_batches_fill_a_device(monkeypatch):
    install(monkeypatch, multiprocessors=100)
    processor = CUDA.processor
    assert processor.fills(3200)
    assert not processor.fills(3199)
    assert processor.hindrance() is None


def test_without_a_device_the_engine_cannot(monkeypatch):
    install(monkeypatch, devices=0)
    engine = LaneEngine(CUDA.processor)
    assert engine.can(Request(COUNTING, _inputs([1]), batch=True)) == "there is no CUDA device"
    assert not CUDA.processor.fills(1 << 30)


class Answering(FakeDriver):
    """A driver whose streams answer what they are told to."""

    def cuStreamQuery(self, stream):  # noqa: N802
        return self.answer


@pytest.mark.parametrize("code", [1, 2, 400, 719])
def test_a_stream_is_busy_or_idle_or_tells_of_an_error(code):
    fake = Answering()
    driver = CudaDriver(fake)
    for fake.answer, busy in ((0, False), (NOT_READY, True)):
        assert driver.is_busy(None) is busy
    fake.answer = code
    with pytest.raises(CudaError) as told:
        driver.is_busy(None)
    assert told.value.code == code
