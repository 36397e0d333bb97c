"""Cached compilation: functions that XLA compiles once for all processes.

A program that was compiled is kept on disk. The next process that calls the function with arguments
of the same structure neither traces nor compiles it.
"""

import contextlib
import functools
import threading
from collections.abc import Callable, Hashable, Sequence
from typing import Any, Generic, NamedTuple, ParamSpec, TypeVar

import equinox as eqx
import jax

from jaxbiped._jax_versions import nothing_is_traced, without_switches
from jaxbiped.caching import _caches
from jaxbiped.caching._caches import Once, OncePerVersion, bounded_cache, name_of, register_cache
from jaxbiped.caching._compiled_store import (
    ArrayFunction,
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


class Form(NamedTuple):
    """In which form a function is run.

    Attributes:
        where: whether it is, by its arguments.
        make: its program, by a function of arrays, these and a key; None where it has none.
    """

    where: Callable[..., bool]
    make: Callable[[ArrayFunction, Sequence[Any], str | None], KeptProgram | None]


def _compiled(
    function: ArrayFunction, arrays: Sequence[Any], key: str | None
) -> KeptProgram | None:
    """A program of XLA; None where it is not to be kept and so left to `equinox`."""
    return None if key is None else read_call(key) or trace_call(function, arrays, key)[0]()


_XLA = Form(lambda *_, **__: True, _compiled)


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

    def __init__(self, function: Callable[_P, _T], form: Form | None = None) -> None:
        functools.update_wrapper(self, function)
        self._others = [] if form is None else [form]
        self._function: Callable[..., Any] = function
        self._jitted: Any = eqx.filter_jit(function)
        self._programs: dict[Hashable, OncePerVersion[KeptProgram | None]] = {}
        self._lock = threading.Lock()
        register_cache(name_of(function), self._count, lambda: _caches.PROGRAMS, self.clear)

    @without_switches
    def __call__(self, *args: _P.args, **kwargs: _P.kwargs) -> _T:
        arguments = arguments_of((args, kwargs))
        program = None if arguments is None else self._program(arguments, *self._others, _XLA)
        if arguments is None:
            note_code(args, kwargs)
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
        program = None if arguments is None else self._program(arguments, *self._others)
        if program is None and arguments is not None and key is not None:
            once = self._once((_XLA, arguments.kind))
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
        self._jitted._cached.clear_cache()
        with self._lock:
            self._programs.clear()

    def _once(self, kind: Hashable) -> Once[KeptProgram | None]:
        with self._lock:
            known = self._programs.get(kind)
        if known is None:
            self._make_room()
            with self._lock:
                known = self._programs.setdefault(kind, OncePerVersion(kind))
        return known()[1]

    def _program(self, arguments: Arguments, *forms: Form) -> KeptProgram | None:
        """The program for such arguments in the first of these forms that it has."""
        args, kwargs = arguments.given
        for form in forms:
            if form.where(*args, **kwargs):
                make = functools.partial(self._make, arguments, form)
                program = self._once((form, arguments.kind))(make)
                if program is not None:
                    return program
        return None

    def _make(self, arguments: Arguments, form: Form) -> KeptProgram | None:
        return form.make(self._flat(arguments), arguments.arrays, self._key_of(arguments))

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


def note_code(*given: object) -> None:
    """Has JAX trace again what it traced of these, if code of the user's in it reads anything else.

    It comes before anything is looked up that JAX made of them.
    """
    leaves, structure = jax.tree.flatten(given)
    with contextlib.suppress(TypeError):  # unhashable
        _note_code(structure, *(leaf for leaf in leaves if not eqx.is_array_like(leaf)))


@bounded_cache(_caches.PROGRAMS)
def _note_code(*given: Hashable) -> None:
    """It makes nothing: whatever is looked up in a cache has its code compared."""


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
