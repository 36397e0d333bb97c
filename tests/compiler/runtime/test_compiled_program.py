"""Batches of any kind, against the bits of single runs; nothing takes the interpreter down."""

import concurrent.futures
import os
import signal
import threading
import types

import equinox as eqx
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import jaxbiped as jb
from jaxbiped import ArgumentError
from jaxbiped.compiler import LANES, Request, default_threads, host
from jaxbiped.compiler.runtime import _machine_code
from jaxbiped.hybrid._scales import units_of
from jaxbiped.solve._adaptive_program import AdaptiveSolve, Solve, adaptive_program
from jaxbiped.solve.controllers._wrapped_control import just_before_end
from tests.compiler.one_shot import let_threads_run, stepped

SCENE = jb.seed_scene()
SEED = np.array([float(leaf) for leaf in jb.seed_state()])
WATCH = ("fall", "stop", "stumble")


def _program():
    steps = AdaptiveSolve(
        jb.hybrid.Walking(), jb.solvers.Rodas4(), WATCH, counting=False, located=True
    )
    one = jtu.tree_map(lambda leaf: leaf[0], _inputs([SEED]))
    return LANES.compile(Request(adaptive_program(steps), one, quick=True))


def _inputs(starts, duration=0.3, most=20000.0, scene=SCENE):
    count = len(starts)

    def each(value):
        return np.full(count, float(value))

    return Solve(
        scene=jtu.tree_map(each, scene),
        state=jb.State(*np.asarray(starts, dtype=float).T),
        duration=each(duration),
        almost=each(just_before_end(jnp.asarray(duration))),
        rtol=each(1e-6),
        atol=each(1e-8),
        units=jtu.tree_map(each, units_of(SCENE, jb.seed_state())),
        footsteps=each(0),
        patience=each(0),
        max_attempts=each(most),
    )


def _perturbed(count, by=1e-2):
    return SEED * (1.0 + by * np.random.default_rng(count).standard_normal((count, 8)))


def _same(a, b):
    for x, y in zip(jtu.tree_leaves(a), jtu.tree_leaves(b), strict=True):
        np.testing.assert_array_equal(x, y)


def test_same_bits_whatever_the_width_the_threads_and_the_order():
    starts = _perturbed(37, by=0.1)
    first = _program().run(_inputs(starts), width=1, threads=1).outputs
    for width, threads in ((1, 3), (host().width, 1), (host().width, 2), (2 * host().width, 1)):
        _same(_program().run(_inputs(starts), width=width, threads=threads).outputs, first)
    backwards = _program().run(_inputs(starts[::-1]), threads=2).outputs
    _same(jtu.tree_map(lambda leaf: leaf[::-1], backwards), first)


@pytest.mark.parametrize("count", [0, 1, 2, 7, 8, 9, 33])
def test_any_size_of_batch(count):
    starts = _perturbed(33)[:count]
    found = _program().run(_inputs(starts)).outputs
    assert found.t.shape == (count,)
    assert np.all(found.t == 0.3)
    assert np.all(found.accepted + found.rejected > 100)


def test_arrays_of_any_layout_and_dtype():
    starts = np.asfortranarray(np.repeat(_perturbed(5), 2, axis=0))[::2]
    inputs = _inputs(_perturbed(5))
    odd = inputs._replace(
        state=jb.State(*[starts[:, i] for i in range(8)]),
        max_attempts=np.full(5, 20000, dtype=np.int16),
        scene=jtu.tree_map(lambda leaf: np.broadcast_to(leaf[0], (5,)), inputs.scene),
    )
    _same(_program().run(odd).outputs, _program().run(inputs).outputs)


_NUMBERS = st.one_of(
    st.floats(width=64),
    st.sampled_from([np.nan, np.inf, -np.inf, 1e300, -1e300, 5e-324, 0.0, -0.0, 1e-310]),
)


@given(st.lists(st.tuples(*[_NUMBERS] * 8), min_size=1, max_size=12), st.data())
@settings(max_examples=25, deadline=None)
def test_no_start_and_no_parameter_takes_the_interpreter_down(starts, data):
    inputs = _inputs(np.array(starts), most=500.0)
    leaves, structure = jtu.tree_flatten(inputs)
    place = data.draw(st.integers(0, len(leaves) - 2))
    leaves[place] = np.full(len(starts), data.draw(_NUMBERS))
    found = _program().run(jtu.tree_unflatten(structure, leaves)).outputs
    assert set(found.ending) <= {int(ending) for ending in jb.Ending}
    assert np.all(found.accepted + found.rejected <= 500)


def test_a_lane_without_numbers_fails_alone():
    starts = _perturbed(9)
    good = _program().run(_inputs(starts)).outputs
    starts[4, 2] = np.nan
    found = _program().run(_inputs(starts)).outputs
    assert found.ending[4] == jb.Ending.SOLVER_FAILED
    others = np.arange(9) != 4
    _same(*(jtu.tree_map(lambda leaf: leaf[others], each) for each in (found, good)))


def test_parameters_are_inputs_of_each_lane():
    starts, slopes = np.repeat(SEED[None], 4, axis=0), np.array([0.01, 0.015, 0.02, 0.025])
    varied = eqx.tree_at(lambda inputs: inputs.scene.ground.slope, _inputs(starts), slopes)
    found = _program().run(varied).outputs
    assert len(set(found.state.hip_x)) == 4
    alone = _program().run(_inputs(starts[:1])).outputs
    assert found.state.hip_x[2] == alone.state.hip_x[0]


def _endless():
    return stepped(lambda inputs, carried: (carried + 1.0, carried < 0.0))


@pytest.fixture
def _heard():
    """What a shell starts in the background ignores interrupts."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("_heard")
def test_an_interrupt_ends_a_run(monkeypatch):
    """It raises, and none of its threads is still at work on memory that may be given back."""
    program, at_work = _endless(), []

    def counted(run, work, *given, **how):
        def one():
            at_work.append(threading.get_ident())
            work()
            at_work.remove(threading.get_ident())

        run(one, *given, **how)

    let_threads_run(monkeypatch, counted)
    program.kernel.code(host().width)
    timer = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        program.run(np.zeros(100))
    assert not at_work


class _Interrupted(threading.Event):
    """The end of a work for which one waits in vain: the user interrupts the first look at it."""

    waits = 0

    def wait(self, timeout=None):
        type(self).waits += 1
        if timeout is not None:
            raise KeyboardInterrupt
        return super().wait()


def test_an_interrupt_is_heard_at_the_first_look(monkeypatch):
    """Counted, for how long it takes depends on the machine."""
    monkeypatch.setattr(_Interrupted, "waits", 0)
    names = types.SimpleNamespace(Thread=threading.Thread, Event=_Interrupted)
    monkeypatch.setattr(_machine_code, "threading", names)
    with pytest.raises(KeyboardInterrupt):
        _endless().run(np.zeros(100), threads=3)
    # One look, and then the end of each of the three is awaited.
    assert _Interrupted.waits == 1 + 3


@pytest.mark.parametrize("attempts", [1, 2, 1000])
def test_a_run_that_is_stopped_attempts_nothing_more(attempts, monkeypatch):
    """Each simulation would be done after so many; threads that come after a stop do none."""
    program = stepped(
        lambda inputs, carried: (carried + 1.0, carried + 1.0 >= inputs), start=jnp.zeros_like
    )
    inputs = np.full(20, float(attempts))
    np.testing.assert_array_equal(program.run(inputs).outputs, inputs)

    def stopped(run, work, workers, stop, **how):
        stop[0] = 1
        run(work, workers, stop, **how)

    let_threads_run(monkeypatch, stopped)
    assert np.isnan(program.run(inputs).outputs).all()


def _summary(_):
    found = _program().run(_inputs(_perturbed(9)), threads=1).outputs
    return [leaf.tolist() for leaf in jtu.tree_leaves(found)]


def test_runs_from_many_threads_at_once():
    expected = _summary(0)
    with concurrent.futures.ThreadPoolExecutor(6) as pool:
        assert all(each == expected for each in pool.map(_summary, range(12)))


def test_the_environment_chooses_the_threads(monkeypatch):
    monkeypatch.setenv("JAXBIPED_THREADS", "3")
    assert default_threads() == 3
    monkeypatch.setenv("JAXBIPED_THREADS", "none")
    with pytest.raises(ArgumentError, match="it must be a whole number of threads above 0"):
        default_threads()


def test_records_at_the_times_of_a_schedule():
    program = stepped(
        lambda inputs, carried: (carried + 0.5, carried + 0.5 >= inputs),
        start=jnp.zeros_like,
        record=lambda inputs, carried, time: (time <= carried, [time, carried]),
        scheduled=True,
    )
    times = np.array([0.1, 0.2, 0.9, 2.0])
    ran = program.run(np.array([1.0, 3.0, 0.5]), schedule=times, room=4)
    assert ran.recorded.counts.tolist() == [3, 4, 2]
    np.testing.assert_array_equal(ran.recorded.values[1, :, 0], times)
    np.testing.assert_array_equal(ran.recorded.values[1, :, 1], [0.5, 0.5, 1.0, 2.0])
    assert np.isnan(ran.recorded.values[2, 2:]).all()


def test_without_room_all_records_are_counted_and_none_is_kept():
    program = stepped(
        lambda inputs, carried: (carried + 1.0, carried + 1.0 >= inputs),
        start=jnp.zeros_like,
        record=lambda inputs, carried, time: (carried >= 0.0, [carried]),
    )
    for room in ({}, dict(room=0), dict(room=2)):
        recorded = program.run(np.array([1.0, 3.0]), **room).recorded
        assert recorded.values.shape == (2, room.get("room", 0), 1)
        assert recorded.counts.tolist() == [1, 3]
