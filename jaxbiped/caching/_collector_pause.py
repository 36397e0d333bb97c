"""Long traces: the collector rests meanwhile, and threads take longer spells of the interpreter.

A trace makes millions of objects that all live until it ends. The collector looks through them
again and again, and finds nothing. Several threads that trace at once hand the interpreter to one
another every 5 ms, and each finds the caches full of the others' objects: spells of 20 ms took 4 %
less time of a first gait, longer ones no less.
"""

import contextlib
import gc
import sys
import threading
from collections.abc import Iterator

_LOCK = threading.Lock()
_SPELL = 0.02
"""How long a thread keeps the interpreter that others wait for [s]."""
_TRACES = [0]
"""How many traces go on just now; the last to end leaves things as they were found."""
_FOUND: list[tuple[bool, float]] = []
"""Whether the collector was on, and how long a spell was, when the first of them began."""


@contextlib.contextmanager
def long_trace() -> Iterator[None]:
    """Within, no collection begins by itself and spells are long, in all threads."""
    with _LOCK:
        if not _TRACES[0]:
            _FOUND.append((gc.isenabled(), sys.getswitchinterval()))
            gc.disable()
            sys.setswitchinterval(max(_SPELL, _FOUND[0][1]))
        _TRACES[0] += 1
    try:
        yield
    finally:
        with _LOCK:
            _TRACES[0] -= 1
            if not _TRACES[0]:
                collects, spell = _FOUND.pop()
                sys.setswitchinterval(spell)
                if collects:
                    gc.enable()
