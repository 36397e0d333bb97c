"""What the process keeps, against its bounds; it leaves no trace in results."""

import concurrent.futures
import contextlib
import gc
import threading
import weakref

import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.caching import _caches
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.caching._caches import Once, bounded_cache
from jaxbiped.compiler import LaneEngine, Request
from jaxbiped.compiler.runtime import _lane_call
from jaxbiped.compiler.runtime._machine_code import _LOADED
from jaxbiped.compiler.runtime._primitive import call
from jaxbiped.gait._search_starts import default_guess
from jaxbiped.hybrid import Rolling
from jaxbiped.hybrid._endings import WATCHES, ending_events
from jaxbiped.solve._landing_program import LandingSolve
from jaxbiped.solve._landing_steps import Landing
from jaxbiped.solve._recorders import StrikeRecorder, program_of
from tests.compiler.one_shot import compiled, let_threads_run, stepped
from tests.sweep.walkers import same

POINTS = np.linspace(-1.0, 1.0, 5)


@pytest.fixture(scope="module", autouse=True)
def _what_others_left_is_not_searched():
    """Every clearing collects garbage, for seconds among what a worker's other files have made."""
    gc.collect()
    gc.freeze()
    yield
    gc.unfreeze()


def test_calls_at_once_make_one_result(registry):
    made, barrier = [], threading.Barrier(4)

    @bounded_cache(2)
    def slowly(number):
        made.append(number)
        threading.Event().wait(0.05)
        return object()

    def ask(number):
        barrier.wait()
        return slowly(number)

    with concurrent.futures.ThreadPoolExecutor(4) as pool:
        first, *others = pool.map(ask, [7] * 4)
    assert all(other is first for other in others)
    assert made == [7]
    slowly(8)
    assert slowly(7) is first
    slowly(9)  # 8 was unused for longest
    assert slowly(7) is first
    (info,) = registry.values()
    assert info.info() == (2, 2, "entries")
    jb.clear_caches()
    assert info.info().size == 0
    assert made == [7, 8, 9]


class _Result:
    """What a trace may hold."""


@pytest.mark.parametrize("forget", [jb.clear_caches, lambda: None], ids=["cleared", "evicted"])
def test_what_somebody_has_is_not_made_twice(registry, forget):
    """Else one trace would hold two programs of one kind, and their results not fit together."""
    entered, finish = threading.Event(), threading.Event()

    @bounded_cache(1)
    def make(number, slow=False):
        if slow:
            entered.set()
            finish.wait()
        return _Result()

    def forgotten(*args):
        forget()
        make(0)
        return make(*args)

    held = make(7)
    assert forgotten(7) is held
    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        first = pool.submit(make, 8, True)
        entered.wait()
        second = pool.submit(forgotten, 8, True)
        finish.set()
        assert first.result() is second.result()
    known = weakref.ref(held)
    del held
    forgotten(9)
    gc.collect()
    assert known() is None


def test_what_fails_is_tried_again():
    once = Once()
    with pytest.raises(ZeroDivisionError):
        once(lambda: 1 / 0)
    assert once(lambda: 3) == 3
    assert once(lambda: 1 / 0) == 3


def test_functions_that_are_new_at_each_call_do_not_pile_up(registry, monkeypatch):
    monkeypatch.setattr(_caches, "PROGRAMS", 4)

    @cached_jit
    def apply(function, x):
        return function(x)

    for k in range(20):
        assert apply(lambda x, k=k: x + k, jnp.ones(())) == 1.0 + k
        (info,) = jb.cache_info().values()
        assert 1 <= info.size <= info.bound == 4


def test_machine_code_goes_with_its_program(registry):
    gc.collect()
    before = len(_LOADED)

    @bounded_cache(3)
    def program(number):
        return compiled(lambda x: jnp.exp(x) * number, ())

    def run(number):
        found = program(number).run([POINTS]).outputs
        np.testing.assert_allclose(found, np.exp(POINTS) * number)
        return found

    first = run(1.5)
    for k in range(8):
        run(2.5 + k)
    gc.collect()
    assert len(_LOADED) == before + 3
    np.testing.assert_array_equal(run(1.5), first)
    jb.clear_caches()
    assert len(_LOADED) == before
    np.testing.assert_array_equal(run(1.5), first)


def test_code_lives_as_long_as_a_thread_that_runs_it(monkeypatch):
    left = []

    def interrupted(run, work, *given, **how):
        left.append(work)
        raise KeyboardInterrupt

    let_threads_run(monkeypatch, interrupted)
    program = compiled(lambda x: jnp.cos(x) - 0.123, ())
    code = weakref.ref(program.kernel.code(1))
    with contextlib.suppress(KeyboardInterrupt):
        program.run([POINTS[:1]])
    del program
    gc.collect()
    assert code() is not None
    left.clear()
    gc.collect()
    assert code() is None


@pytest.mark.parametrize("limit", ["0", "100", ""])
def test_the_environment_bounds_records_and_buffers(monkeypatch, limit):
    def attempt(given, carried):
        return carried + given, carried + given > 4.0

    def record(given, carried, time):
        return carried > 0.0, [carried]

    program = stepped(attempt, start=jnp.zeros_like, record=record)
    jb.clear_caches()
    monkeypatch.setenv("JAXBIPED_CACHE_BYTES", limit)
    _, recording = call(program, jnp.asarray(1.0), room=6, quick=True, keeps_records=True)
    half = {"0": 0, "100": 50}.get(limit, 1 << 29)
    # One input and five records of one number each are 48 bytes.
    assert _lane_call._RECORDS.kept == (48 if half else 0)
    (values,) = recording.columns(np.zeros(1))
    np.testing.assert_array_equal(values[:6], range(6))
    gc.collect()
    for name in ("records of simulations", "buffers for records"):
        info = jb.cache_info()[name]
        assert info.size <= info.bound == half
        assert info.unit == "bytes"


def test_events_are_the_same_functions_each_time():
    """Else every trace of a solve would stay in JAX's caches under names of its own."""
    assert list(ending_events(WATCHES).values()) == list(ending_events(WATCHES).values())
    assert len(ending_events(WATCHES)) == 5
    assert list(ending_events(("stop",))) == [jb.Ending.SOLVER_FAILED, jb.Ending.STOPPED]


def test_nothing_is_left_when_caches_are_cleared_and_results_stay():
    scene, rigid = jb.seed_scene(), jb.ladder()["rigid"]

    def walk():
        end = jb.simulate(scene, jb.seed_state(), duration=0.2, save="end", engine="lanes")
        return end.state, jb.rigid_walk(rigid, default_guess(rigid), footsteps=2).state

    first = walk()
    assert sum(info.size for info in jb.cache_info().values()) > 3
    jb.clear_caches()
    assert not {name for name, info in jb.cache_info().items() if info.size}
    same(walk(), first)


def test_a_compiled_program_that_somebody_has_is_found_again():
    rigid = jb.ladder()["rigid"]
    walk = Landing(Rolling(), rigid, default_guess(rigid), *[jnp.ones(())] * 4)

    def program():
        return LaneEngine().compile(
            Request(program_of(LandingSolve(system=Rolling(), recorder=StrikeRecorder())), walk)
        )

    held = program()
    jb.clear_caches()
    assert program() is held
