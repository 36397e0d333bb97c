"""Caches: all that the process keeps between calls is created here, with its bound.

What is kept makes the next call faster and changes no number. `docs/memory.md` lists it.
"""

import contextlib
import functools
import gc
import threading
import weakref
from collections.abc import Callable, Hashable
from typing import Any, Generic, NamedTuple, TypeVar

from jaxbiped._files import CACHE_BYTES_VARIABLE, environment_number
from jaxbiped.caching._user_code import users_code, versions_of

_CACHE_BYTES = 1 << 30
PROGRAMS = 64
"""Compiled programs that each maker of such keeps; the one unused for longest goes first."""

_T = TypeVar("_T")


class CacheInfo(NamedTuple):
    """How full a cache is.

    Attributes:
        size: what it holds, in `unit`.
        bound: what it may hold at most.
        unit: "entries" or "bytes".
    """

    size: int
    bound: int
    unit: str


class _Cache(NamedTuple):
    info: Callable[[], CacheInfo]
    clear: Callable[[], object]


_CACHES: dict[str, _Cache] = {}


def register_cache(
    name: str,
    size: Callable[[], int],
    bound: Callable[[], int],
    clear: Callable[[], object],
    unit: str = "entries",
) -> None:
    """Puts a cache that bounds itself under `clear_caches` and `cache_info`."""
    _CACHES[name] = _Cache(lambda: CacheInfo(size(), bound(), unit), clear)


def clear_caches() -> None:
    """Empties all caches in memory: compiled programs, records of simulations, buffers.

    Later calls compile again and give the same numbers. It can be called at any time and from any
    thread: a running call keeps what it uses until it ends. Compiled code on disk stays.
    """
    for _ in range(2):  # what goes in the first round may give buffers back
        for cache in list(_CACHES.values()):
            cache.clear()
        # Programs and their traces refer to each other.
        gc.collect()


def cache_info() -> dict[str, CacheInfo]:
    """Current size and limit of each cache, by name.

    Returns:
        A `CacheInfo` with size, bound and unit for each cache.
    """
    return {name: cache.info() for name, cache in sorted(_CACHES.items())}


def half_of_cache_bytes() -> int:
    """Bound of the records, and that of the buffers [bytes]."""
    chosen = environment_number(CACHE_BYTES_VARIABLE)
    return (_CACHE_BYTES if chosen is None else chosen) // 2


class Once(Generic[_T]):
    """A value that is made once: of many threads one makes it, the others wait for it."""

    def __init__(self) -> None:
        self._lock, self._made = threading.Lock(), list[_T]()

    @property
    def done(self) -> bool:
        return bool(self._made)

    def __call__(self, make: Callable[[], _T]) -> _T:
        """The value, made where it is not; where making fails, the next call tries again."""
        if not self._made:
            with self._lock:
                if not self._made:
                    self._made.append(make())
        return self._made[0]


class OncePerVersion(Generic[_T]):
    """A `Once` for the present version of the user's code in a key, with that version."""

    def __init__(self, key: object) -> None:
        self._code = users_code(key)
        self._last: tuple[tuple[int, ...], Once[_T]] = (), Once()

    def __call__(self) -> tuple[tuple[int, ...], Once[_T]]:
        versions = versions_of(self._code)
        if versions != self._last[0]:
            self._last = versions, Once()
        return self._last


class OfObjects(Generic[_T]):
    """A value for each of some immutable objects, kept for as long as the object lives."""

    def __init__(self) -> None:
        self._known: dict[int, tuple[weakref.ref[Any], _T]] = {}

    def __call__(self, thing: Any, make: Callable[[], _T]) -> _T:
        """The object's value, made where it is not; it must not hold the object."""
        number = id(thing)
        known = self._known.get(number)
        if known is None or known[0]() is not thing:
            gone = weakref.ref(thing, lambda _: self._known.pop(number, None))
            known = self._known[number] = (gone, make())
        return known[1]


def bounded_cache(bound: int) -> Callable[[Callable[..., _T]], Callable[..., _T]]:
    """Decorator: keeps a function's last `bound` results by its hashable positional arguments.

    As `functools.lru_cache`, but there are never two results of the same arguments: calls at the
    same time make one, and one that somebody still has is found again when it was forgotten here.
    A trace that holds a program, for one, goes on with the same.
    """

    def decorate(function: Callable[..., _T]) -> Callable[..., _T]:
        lock = threading.Lock()
        alive: weakref.WeakValueDictionary[tuple[Hashable, ...], Any] = (
            weakref.WeakValueDictionary()
        )

        @functools.lru_cache(maxsize=bound)
        def result_of(*args: Hashable) -> OncePerVersion[_T]:
            return OncePerVersion(args)

        def make(args: tuple[Hashable, ...], versions: tuple[int, ...]) -> _T:
            with lock:
                kept = alive.get((versions, *args))
            if kept is not None:
                return kept
            made = function(*args)
            with lock, contextlib.suppress(TypeError):  # plain values have no identity to keep
                made = alive.setdefault((versions, *args), made)
            return made

        @functools.wraps(function)
        def cached(*args: Hashable) -> _T:
            with lock:
                versions, result = result_of(*args)()
            return result(lambda: make(args, versions))

        def size() -> int:
            return result_of.cache_info().currsize

        register_cache(name_of(function), size, lambda: bound, result_of.cache_clear)
        return cached

    return decorate


def name_of(function: Callable[..., object]) -> str:
    """By which the results of a function are listed."""
    return f"{function.__module__}.{function.__qualname__}"
