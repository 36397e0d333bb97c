"""Progress lines on stderr: what a command is busy with, once that takes two seconds."""

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

_PATIENCE = 2.0
"""Seconds after which silence needs a word."""
_told = threading.Event()
"""Whether stages are told at all: in commands, not in a library call."""


def tell_stages() -> None:
    """From here on, stages that take long are told on stderr."""
    _told.set()


@contextmanager
def stage(message: str) -> Iterator[None]:
    """Tells `message` on stderr if what runs inside takes longer than two seconds."""
    if not _told.is_set():
        yield
        return
    timer = threading.Timer(_PATIENCE, _tell, (message,))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _tell(message: str) -> None:
    print(f"{message} …", file=sys.stderr, flush=True)
