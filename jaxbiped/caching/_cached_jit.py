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
from jaxbiped.caching._compiled_store import (
    ArrayFunction,
    CompiledCall,
    KeptProgram,
    Skeleton,
    read_call,
    trace_call,
)
from jaxbiped.caching._disk_cache import cache_folder
from jaxbiped.caching._fingerprint import fingerprint, settings

_P = ParamSpec("_P")
_T = TypeVar("_T")


class Arguments(NamedTuple):
    """Arguments of a call that nothing traces.

    Attributes:
        given: all of them, as a tuple and a dictionary.
        arrays: those among them; `skeleton` the rest.
        kind: what decides which program runs.
    """

    given: tuple[tuple[Any, ...], dict[str, Any]]
    arrays: list[Any]
    skeleton: Skeleton
    kind: Hashable


class OtherForm(NamedTuple):
    """How a function is run without XLA.

    Attributes:
        where: whether it is, by its arguments.
        make: its program, by a function of arrays, these and a key; None where it has none.
    """

    where: Callable[..., bool]
    make: Callable[[ArrayFunction, Sequence[Any], str | None], KeptProgram | None]


class Begun(NamedTuple):
    """A function that is traced.

    Attributes:
        finish: compiles what is not compiled, in any thread.
        result: the function's result with shapes instead of arrays.
    """

    finish: Callable[[], object]
    result: Any


class cached_jit(Generic[_P, _T]):  # noqa: N801
    """Decorator: `equinox.filter_jit`, whose compiled programs and traces are bounded and kept.

    What is not an array is compiled in, functions too: a new one at each call would compile
    and be kept each time. Beyond the bound all go. On disk are programs of what the package and
    its libraries define. Another `form` goes before XLA's.
    """

    def __init__(self, function: Callable[_P, _T], form: OtherForm | None = None) -> None:
        functools.update_wrapper(self, function)
        self._form = form
        self._function: Callable[..., Any] = function
        self._jitted: Any = eqx.filter_jit(function)
        self._programs: dict[Hashable, Once[KeptProgram | None]] = {}
        self._lock = threading.Lock()
        register_programs(function, self._count, self.clear)

    @without_switches
    def __call__(self, *args: _P.args, **kwargs: _P.kwargs) -> _T:
        """Runs the function, compiled."""
        arguments = arguments_of((args, kwargs))
        program = None
        if arguments is not None:
            program = self._in_other_form(arguments)
            program = program or self._once(arguments.kind)(lambda: self._make(arguments))
        found: _T
        if arguments is None or program is None:
            self._make_room()
            found = self._jitted(*args, **kwargs)
        else:
            found = program(arguments.arrays)
        return found

    @without_switches
    def begin(self, *args: _P.args, **kwargs: _P.kwargs) -> Begun:
        """Traces the function, where no process did."""
        arguments = arguments_of((args, kwargs))
        key = None if arguments is None else self._key_of(arguments)
        program = None if arguments is None else self._in_other_form(arguments)
        if program is None and arguments is not None and key is not None:
            once = self._once(arguments.kind)
            kept = None if once.done else read_call(key)
            if once.done or kept is not None:
                program = once(lambda: kept)
            else:
                compile_it, result = trace_call(self._flat(arguments), arguments.arrays, key)
                return Begun(functools.partial(once, compile_it), result.shapes())
        if program is not None:
            return Begun(lambda: None, program.result.shapes())
        lowered = self._jitted.lower(*args, **kwargs)
        return Begun(lowered.compile, eqx.filter_eval_shape(self._jitted, *args, **kwargs))

    @without_switches
    def lower(self, *args: _P.args, **kwargs: _P.kwargs) -> Any:
        """The function, ready to be compiled for these arguments; see `equinox.filter_jit`."""
        return self._jitted.lower(*args, **kwargs)

    def clear(self) -> None:
        """Forgets its programs and traces."""
        self._jitted._cached.clear_cache()
        with self._lock:
            self._programs.clear()

    def _once(self, kind: Hashable) -> Once[KeptProgram | None]:
        with self._lock:
            known = self._programs.get(kind)
        if known is None:
            self._make_room()
            with self._lock:
                known = self._programs.setdefault(kind, Once())
        return known

    def _in_other_form(self, arguments: Arguments) -> KeptProgram | None:
        form = self._form
        args, kwargs = arguments.given
        if form is None or not form.where(*args, **kwargs):
            return None

        def make() -> KeptProgram | None:
            return form.make(self._flat(arguments), arguments.arrays, self._key_of(arguments))

        return self._once((form, arguments.kind))(make)

    def _make(self, arguments: Arguments) -> CompiledCall | None:
        """The program for such arguments; None where it is left to `equinox`."""
        key = self._key_of(arguments)
        if key is None:
            return None
        return read_call(key) or trace_call(self._flat(arguments), arguments.arrays, key)[0]()

    def _flat(self, arguments: Arguments) -> ArrayFunction:
        """The function of the arrays among such arguments."""

        def function(arrays: Sequence[Any]) -> Any:
            args, kwargs = arguments.skeleton.filled(arrays)
            return self._function(*args, **kwargs)

        functools.update_wrapper(function, self._function, assigned=("__name__", "__qualname__"))
        return function

    def _key_of(self, arguments: Arguments) -> str | None:
        """By what its program is found on disk; None where it is not to be kept."""
        if cache_folder() is None:
            return None
        return fingerprint(cached_jit, self._function, arguments.skeleton.tree)

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


def arguments_of(given: tuple[tuple[Any, ...], dict[str, Any]]) -> Arguments | None:
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
    return Arguments(given, arrays, skeleton, kind)


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
