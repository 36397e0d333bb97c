"""Long traces, against the collector's state before and after."""

import gc
import sys
import threading
from collections.abc import Iterator

import pytest

from jaxbiped.caching import _cached_jit
from jaxbiped.caching._cached_jit import long_trace

SHORT, LONG = 0.005, 0.5


@pytest.fixture(autouse=True)
def _settings_of_the_interpreter(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(_cached_jit, "_FROZEN", threading.Event())
    spell = sys.getswitchinterval()
    gc.enable()
    sys.setswitchinterval(SHORT)
    yield
    gc.enable()
    sys.setswitchinterval(spell)


def _as_found() -> bool:
    return gc.isenabled() and sys.getswitchinterval() == pytest.approx(SHORT)


def test_collector_rests_and_spells_are_longer_within() -> None:
    with long_trace():
        assert not gc.isenabled()
        assert sys.getswitchinterval() > 2.0 * SHORT
    assert _as_found()


def test_an_error_leaves_both_as_they_were_found() -> None:
    with pytest.raises(KeyError), long_trace():
        raise KeyError
    assert _as_found()


def test_the_last_of_several_threads_leaves_both_as_they_were_found() -> None:
    inside, leave = threading.Event(), threading.Event()

    def trace() -> None:
        with long_trace():
            inside.set()
            leave.wait(10.0)

    thread = threading.Thread(target=trace)
    thread.start()
    assert inside.wait(10.0)
    with long_trace():
        pass
    assert not gc.isenabled()
    assert sys.getswitchinterval() > 2.0 * SHORT
    leave.set()
    thread.join()
    assert _as_found()


def test_a_collector_switched_off_and_longer_spells_stay_as_the_user_chose() -> None:
    gc.disable()
    sys.setswitchinterval(LONG)
    with long_trace(), long_trace():
        assert sys.getswitchinterval() == pytest.approx(LONG)
    assert not gc.isenabled()
    assert sys.getswitchinterval() == pytest.approx(LONG)


def test_what_a_trace_made_counts_as_old_when_it_ends() -> None:
    gc.unfreeze()  # the suite's own
    with long_trace():
        made = [[None] for _ in range(5000)]
    assert not any(each is made[0] for each in gc.get_objects(generation=0))


def test_what_the_user_froze_stays_frozen() -> None:
    gc.freeze()
    try:
        with long_trace():
            pass
        assert gc.get_freeze_count()
    finally:
        gc.unfreeze()


def test_what_is_frozen_is_counted_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Python walks through all of it: for milliseconds after each of thousands of short traces."""
    counts = []
    monkeypatch.setattr(gc, "get_freeze_count", lambda: counts.append(1) or 1)
    for _ in range(3):
        with long_trace():
            pass
    assert len(counts) == 1
