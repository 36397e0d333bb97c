"""Host compilation: functions of JAX that NumPy runs where nothing traces them."""

import functools
import threading
from collections.abc import Callable, Hashable
from typing import Any, Generic, ParamSpec, TypeVar

from jaxbiped._debug_switches import without_switches
from jaxbiped.caching import _caches
from jaxbiped.caching._cached_jit import Arguments, arguments_of, cached_jit
from jaxbiped.caching._caches import Once, register_programs
from jaxbiped.compiler.host_code._host_program import (
    HostProgram,
    read_host_program,
    write_host_program,
)
from jaxbiped.compiler.host_code._host_writer import UnwrittenError

_P = ParamSpec("_P")
_T = TypeVar("_T")


class HostJit(Generic[_P, _T]):
    """A function that is a host program, or else compiled by `cached_jit`."""

    def __init__(
        self, function: Callable[_P, _T], where: Callable[..., bool], *, within: bool
    ) -> None:
        functools.update_wrapper(self, function)
        self._compiled, self._where, self._within = cached_jit(function), where, within
        self._programs: dict[Hashable, Once[HostProgram | None]] = {}
        self._lock = threading.Lock()
        register_programs(self, lambda: len(self._programs), self.clear)

    @without_switches
    def __call__(self, *args: _P.args, **kwargs: _P.kwargs) -> _T:
        """Runs the function."""
        arguments = self._arguments(*args, **kwargs)
        program = None if arguments is None else self._program(arguments)
        if arguments is None or program is None:
            return self._compiled(*args, **kwargs)
        found: _T = program(arguments.arrays, _as_given if self._within else _of_jax)
        return found

    @without_switches
    def begin(self, *args: _P.args, **kwargs: _P.kwargs) -> Callable[[], object]:
        """Writes the function, where no process did; or what compiles it, in any thread."""
        if self._written(*args, **kwargs) is None:
            return self._compiled.begin(*args, **kwargs)
        return lambda: None

    @without_switches
    def result_shape(self, *args: _P.args, **kwargs: _P.kwargs) -> Any:
        """Its result with shapes instead of arrays."""
        program = self._written(*args, **kwargs)
        if program is None:
            return self._compiled.result_shape(*args, **kwargs)
        return program.shapes()

    def clear(self) -> None:
        """Forgets its programs."""
        self._compiled.clear()
        with self._lock:
            self._programs.clear()

    def _arguments(self, *args: _P.args, **kwargs: _P.kwargs) -> Arguments | None:
        arguments = arguments_of((args, kwargs))
        return arguments if arguments is not None and self._where(*args, **kwargs) else None

    def _written(self, *args: _P.args, **kwargs: _P.kwargs) -> HostProgram | None:
        arguments = self._arguments(*args, **kwargs)
        return None if arguments is None else self._program(arguments)

    def _program(self, arguments: Arguments) -> HostProgram | None:
        with self._lock:
            if arguments.kind not in self._programs and len(self._programs) >= _caches.PROGRAMS:
                self._programs.clear()
            once = self._programs.setdefault(arguments.kind, Once())
        return once(functools.partial(self._make, arguments))

    def _make(self, arguments: Arguments) -> HostProgram | None:
        """The program for such arguments; None where NumPy lacks one of its operations."""
        key = self._compiled.key_of(arguments)
        kept = None if key is None else read_host_program(key)
        if kept is not None:
            return kept
        try:
            return write_host_program(self._compiled.flat(arguments), arguments.arrays, key)
        except UnwrittenError:
            return None


def host_jit(
    where: Callable[..., bool] = lambda *_, **__: True, *, within: bool = False
) -> Callable[[Callable[_P, _T]], HostJit[_P, _T]]:
    """Decorator: a function that NumPy runs `where` that pays and nothing traces the call.

    It pays where programs of lanes do the work. Else, and where NumPy lacks one of its operations,
    XLA compiles it; see `cached_jit`. Results that stay `within` the package are left arrays of
    NumPy.
    """
    return lambda function: HostJit(function, where, within=within)


def _as_given(arrays: list[Any]) -> list[Any]:
    return arrays


_of_jax = cached_jit(_as_given)
"""Makes all of them arrays of JAX, for which `jax.device_put` takes 20 µs each."""
