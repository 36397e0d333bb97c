"""Cached compilation: functions that XLA compiles once for all processes.

A program that was compiled is kept on disk. The next process that calls the function with arguments
of the same structure neither traces nor compiles it.
"""

import functools
import threading
from collections.abc import Callable, Hashable, Sequence
from typing import Any, Generic, NamedTuple, ParamSpec, TypeVar

import equinox as eqx
import jax
import jax.tree_util as jtu
import numpy as np

from jaxbiped._debug_switches import without_switches
from jaxbiped._jax_versions import nothing_is_traced
from jaxbiped.caching import _caches
from jaxbiped.caching._caches import Once, register_programs
from jaxbiped.caching._collector_pause import long_trace
from jaxbiped.caching._compiled_store import CompiledCall, Skeleton, read_call, trace_call
from jaxbiped.caching._disk_cache import cache_folder
from jaxbiped.caching._fingerprint import fingerprint, settings

_P = ParamSpec("_P")
_T = TypeVar("_T")


class Arguments(NamedTuple):
    """Arguments of a call that nothing traces.

    Attributes:
        arrays: those among them; `skeleton` the rest.
        kind: what decides which program runs.
    """

    arrays: list[Any]
    skeleton: Skeleton
    kind: Hashable


class cached_jit(Generic[_P, _T]):  # noqa: N801
    """Decorator: `equinox.filter_jit`, whose compiled programs and traces are bounded and kept.

    What is not an array is compiled in, functions too: a new one at each call would compile
    and be kept each time. Beyond the bound all go. On disk are programs of what the package and
    its libraries define.
    """

    def __init__(self, function: Callable[_P, _T]) -> None:
        functools.update_wrapper(self, function)
        self._function: Callable[..., Any] = function
        self._jitted: Any = eqx.filter_jit(function)
        self._programs: dict[Hashable, Once[CompiledCall | None]] = {}
        self._lock = threading.Lock()
        register_programs(function, self._count, self.clear)

    @without_switches
    def __call__(self, *args: _P.args, **kwargs: _P.kwargs) -> _T:
        """Runs the function, compiled."""
        arguments = arguments_of((args, kwargs))
        program = None
        if arguments is not None:
            program = self._once(arguments)(functools.partial(self._make, arguments))
        found: _T
        if arguments is None or program is None:
            self._make_room()
            found = self._jitted(*args, **kwargs)
        else:
            found = program(arguments.arrays)
        return found

    @without_switches
    def begin(self, *args: _P.args, **kwargs: _P.kwargs) -> Callable[[], object]:
        """Traces the function, where no process did; what then compiles it, in any thread."""
        arguments = arguments_of((args, kwargs))
        key = None if arguments is None else self.key_of(arguments)
        if arguments is None or key is None:
            return self._jitted.lower(*args, **kwargs).compile
        once = self._once(arguments)
        kept = None if once.done else read_call(key)
        if once.done or kept is not None:
            return functools.partial(once, lambda: kept)
        return functools.partial(once, self._trace(arguments, key))

    @without_switches
    def lower(self, *args: _P.args, **kwargs: _P.kwargs) -> Any:
        """The function, ready to be compiled for these arguments; see `equinox.filter_jit`."""
        return self._jitted.lower(*args, **kwargs)

    @without_switches
    def result_shape(self, *args: _P.args, **kwargs: _P.kwargs) -> Any:
        """Its result with shapes instead of arrays."""
        arguments = arguments_of((args, kwargs))
        key = None if arguments is None else self.key_of(arguments)
        kept = None if key is None else read_call(key)
        if arguments is None or kept is None:
            with long_trace():
                return eqx.filter_eval_shape(self._jitted, *args, **kwargs)
        self._once(arguments)(lambda: kept)
        return kept.shapes()

    def clear(self) -> None:
        """Forgets its programs and traces."""
        self._jitted._cached.clear_cache()
        with self._lock:
            self._programs.clear()

    def _once(self, arguments: Arguments) -> Once[CompiledCall | None]:
        with self._lock:
            known = self._programs.get(arguments.kind)
        if known is None:
            self._make_room()
            with self._lock:
                known = self._programs.setdefault(arguments.kind, Once())
        return known

    def _make(self, arguments: Arguments) -> CompiledCall | None:
        """The program for such arguments; None where it is left to `equinox`."""
        key = self.key_of(arguments)
        return None if key is None else read_call(key) or self._trace(arguments, key)()

    def _trace(self, arguments: Arguments, key: str) -> Callable[[], CompiledCall]:
        return trace_call(self.flat(arguments), arguments.arrays, key)

    def flat(self, arguments: Arguments) -> Callable[[Sequence[Any]], Any]:
        """The function of the arrays among such arguments."""

        def function(arrays: Sequence[Any]) -> Any:
            args, kwargs = arguments.skeleton.filled(arrays)
            return self._function(*args, **kwargs)

        functools.update_wrapper(function, self._function, assigned=("__name__", "__qualname__"))
        return function

    def key_of(self, arguments: Arguments) -> str | None:
        """By what its program is found on disk; None where it is not to be kept."""
        if cache_folder() is None:
            return None
        skeleton = arguments.skeleton
        return fingerprint(cached_jit, self._function, skeleton.filled(skeleton.places))

    def _make_room(self) -> None:
        if self._count() >= _caches.PROGRAMS:
            self.clear()

    def _count(self) -> int:
        return int(self._jitted._cached._cache_size()) + len(self._programs)


def kept_alone(function: Callable[_P, _T]) -> Callable[_P, _T]:
    """Decorator: a function of arrays that is one kept program where it is called by itself.

    Operation by operation JAX would compile a program for each. Where something traces it, it is
    a part of the whole as it is.
    """
    kept = cached_jit(function)

    @without_switches
    @functools.wraps(function)
    def called(*args: _P.args, **kwargs: _P.kwargs) -> _T:
        if not nothing_is_traced():
            return function(*args, **kwargs)
        args, kwargs = jtu.tree_map(_as_array, (args, kwargs))
        return kept(*args, **kwargs)

    return called


def _as_array(leaf: Any) -> Any:
    """A number of Python's as an array, for it not to be compiled in."""
    return np.asarray(leaf) if isinstance(leaf, float | int) else leaf


def arguments_of(given: Any) -> Arguments | None:
    """Arguments of a program that can be kept; None where something traces or watches the call."""
    if not nothing_is_traced() or _is_watched():
        return None
    skeleton, arrays = Skeleton.of(given)
    if any(isinstance(x, jax.core.Tracer) or getattr(x, "committed", False) for x in arrays):
        return None
    leaves = tuple((type(leaf), leaf) for leaf in skeleton.leaves)
    kind = skeleton.structure, leaves, settings()
    try:
        hash(kind)
    except TypeError:
        return None
    return Arguments(arrays, skeleton, kind)


def _is_watched() -> bool:
    """Whether JAX is to run as never otherwise."""
    config: Any = jax.config
    return bool(
        config.jax_disable_jit
        or config.jax_debug_nans
        or config.jax_debug_infs
        or config.jax_default_device is not None
        or jax.default_backend() != "cpu"
    )
