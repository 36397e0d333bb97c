"""Paused collection: the collector rests within, and is left as it was found."""

import gc
import threading
from collections.abc import Iterator

import pytest

from jaxbiped._paused_collection import paused_collection


@pytest.fixture(autouse=True)
def _collector_on() -> Iterator[None]:
    gc.enable()
    yield
    gc.enable()


def test_collector_rests_within_and_goes_on_after() -> None:
    with paused_collection():
        assert not gc.isenabled()
    assert gc.isenabled()


def test_an_error_lets_it_go_on() -> None:
    with pytest.raises(KeyError), paused_collection():
        raise KeyError
    assert gc.isenabled()


def test_the_last_of_several_threads_lets_it_go_on() -> None:
    inside, leave = threading.Event(), threading.Event()

    def pause() -> None:
        with paused_collection():
            inside.set()
            leave.wait(10.0)

    thread = threading.Thread(target=pause)
    thread.start()
    assert inside.wait(10.0)
    with paused_collection():
        pass
    assert not gc.isenabled()
    leave.set()
    thread.join()
    assert gc.isenabled()


def test_a_collector_that_the_user_switched_off_stays_off() -> None:
    gc.disable()
    with paused_collection(), paused_collection():
        assert not gc.isenabled()
    assert not gc.isenabled()
