"""Paused collection: Python's garbage collector, held back while programs are traced.

A trace makes millions of objects that all live until it ends. The collector looks through them
again and again, and finds nothing.
"""

import contextlib
import gc
import threading
from collections.abc import Iterator

_LOCK = threading.Lock()
_PAUSES = [0]
"""How many pauses hold the collector back just now; the last to end lets it go on."""


@contextlib.contextmanager
def paused_collection() -> Iterator[None]:
    """Within, no collection begins by itself, if the collector was on; in all threads."""
    with _LOCK:
        holds = _PAUSES[0] > 0 or gc.isenabled()
        if holds:
            _PAUSES[0] += 1
            gc.disable()
    try:
        yield
    finally:
        if holds:
            with _LOCK:
                _PAUSES[0] -= 1
                if not _PAUSES[0]:
                    gc.enable()
