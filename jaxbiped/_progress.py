"""Progress of what takes time: what is being done, how far it is, and what was found so far.

One mechanism for all calls: `stage`. The outermost stage shows itself once it has lasted two
seconds; stages within it are named on its line. An interrupt that passes through says the same.
"""

import contextvars
import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeAlias

_PATIENCE, _PAUSE = 2.0, 0.5
"""Seconds after which a stage shows itself, and between updates of its line."""
_BAR = 12
"""Characters of a bar."""
_in_command = threading.Event()
"""Whether a command runs, which reports its stages also where nobody watches."""
_outermost: contextvars.ContextVar["Stage | None"] = contextvars.ContextVar("stage", default=None)


def tell_stages() -> None:
    """From here on, stages that take long are reported on stderr also where it is a file."""
    _in_command.set()


Write: TypeAlias = Callable[["Stage", bool | None], None]
"""Writes a stage; the last time when it has ended, and None to take it away for a moment."""


class Stage:
    """What a call is busy with.

    Attributes:
        doing: in words, as "searching for a gait".
        count, total, unit: how much of it is done; `total` is None where that is not known.
        found: what was found so far, in words.
        within: the stage inside this one that runs now.
        write: writes it where a person sees it; None for nowhere.
    """

    def __init__(self, doing: str, total: int | None, unit: str, done: int) -> None:
        self.doing, self.count, self.total, self.unit = doing, done, total, unit
        self.found = ""
        self.within: Stage | None = None
        self.write: Write | None = None
        self._done, self._began = done, time.monotonic()

    def update(self, count: int = 1, found: str | None = None) -> None:
        """Counts what is done, and keeps in words what was found."""
        self.count += count
        self.found = self.found if found is None else found

    def clear(self) -> None:
        """Takes its line away for a moment, so that others can be printed."""
        if self.write is not None:
            self.write(self, None)

    def progress(self) -> str:
        """How far it is and what was found, in words; empty where nothing is known."""
        parts = []
        if self.total is not None:
            parts.append(f"{self.count:,} of {self.total:,} {self.unit}")
        elif self.count:
            parts.append(f"{self.count:,} {self.unit}")
        return ", ".join([*parts, self.found] if self.found else parts)

    def times(self) -> str:
        """Time so far, and time left and rate where they are known."""
        elapsed, fresh = time.monotonic() - self._began, self.count - self._done
        told = f"{elapsed:.0f} s"
        if not self.total or not fresh:
            return told
        rate, left = fresh / elapsed, elapsed * (self.total - self.count) / fresh
        return f"{told}, {left:.0f} s left" + (f", {rate:,.0f} {self.unit}/s" if rate > 1 else "")

    def line(self) -> str:
        """All of it on a line: a bar, what is found, times, stages within."""
        told = self.doing
        if self.total:
            share = min(1.0, self.count / self.total)
            told += f": |{'█' * round(_BAR * share):<{_BAR}}|"
        told = f"{told} {self.progress()}".rstrip() + f" [{self.times()}]"
        return told if self.within is None else f"{told} › {self.within.words()}"

    def words(self) -> str:
        """What is being done and how far, stages within too, without times."""
        told = ": ".join(filter(None, [self.doing, self.progress()]))
        return told if self.within is None else f"{told} › {self.within.words()}"


@contextmanager
def stage(
    doing: str,
    *,
    total: int | None = None,
    unit: str = "",
    done: int = 0,
    show: bool | None = None,
    kept: str = "",
) -> Iterator[Stage]:
    """Reports what runs inside once that has taken two seconds.

    Args:
        doing: what is being done, in words.
        total, unit: how much there is to do, if that is known, and of what.
        done: how much of it was done before.
        show: whether to show it; if None, in a terminal, in a notebook and in a command. Stages
            within another one are shown on its line.
        kept: in words, what an interrupt leaves.
    """
    now, outermost = Stage(doing, total, unit, done), _outermost.get()
    outer = outermost
    while outer is not None and outer.within is not None:
        outer = outer.within
    if outer is not None:
        outer.within = now
    token, ended = _outermost.set(outermost or now), threading.Event()
    now.write = _writer(show) if outer is None else None
    watch = threading.Thread(target=_watch, args=(now, ended, now.write), daemon=True)
    if now.write is not None:
        watch.start()
    try:
        yield now
    except KeyboardInterrupt as error:
        if not hasattr(error, "__notes__"):  # the innermost stage says it, while all are known
            error.add_note(f"Interrupted: {(outermost or now).words()}.")
        if kept:
            error.add_note(kept[0].upper() + kept[1:] + ".")
        raise
    finally:
        _outermost.reset(token)
        if outer is not None:
            outer.within = None
        ended.set()
        if now.write is not None:
            watch.join()


def _watch(now: Stage, ended: threading.Event, write: Write | None) -> None:
    if write is None or ended.wait(_PATIENCE):
        return
    while True:
        write(now, False)
        if ended.wait(_PAUSE):
            write(now, True)
            return


def _writer(show: bool | None) -> Write | None:
    """Where a stage is written; None for nowhere."""
    kernel = getattr(
        getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)(), "kernel", 0
    )
    if show is False or (sys.stderr is None and not kernel):
        return None
    if kernel:
        return _notebook_writer()
    if sys.stderr.isatty():
        return _terminal_writer(kept=show is True)
    return _log_writer() if show or _in_command.is_set() else None


def _terminal_writer(*, kept: bool) -> Write:
    """A line that is written over; what was asked for stays when it has ended."""

    def write(now: Stage, ended: bool | None) -> None:
        width = shutil.get_terminal_size().columns - 1
        line = "" if ended is None or (ended and not kept) else now.line()[:width]
        print(f"\r{line:<{width}}\r{line}", end="\n" if ended and kept else "", file=sys.stderr)
        sys.stderr.flush()

    return write


def _notebook_writer() -> Write:
    """A line below the cell, which is gone when the stage has ended."""
    handle: Any = None

    def write(now: Stage, ended: bool | None) -> None:
        nonlocal handle
        if ended is None or (ended and handle is None):
            return
        data = {"text/plain": "" if ended else now.line()}
        if handle is None:
            handle = sys.modules["IPython.display"].DisplayHandle()
            handle.display(data, raw=True)
        else:
            handle.update(data, raw=True)

    return write


def _log_writer() -> Write:
    """Lines in a file, after two seconds and then each time that the time so far has doubled."""
    due, began = 0.0, time.monotonic()

    def write(now: Stage, ended: bool | None) -> None:
        nonlocal due
        passed = time.monotonic() - began
        if ended is None:
            return
        if passed >= due or (ended and now.total is not None):
            after = f" [{now.times()}]" if due else ""
            print(f"{now.words()}{after}{'.' if ended else ' …'}", file=sys.stderr, flush=True)
            due = 2.0 * passed

    return write
