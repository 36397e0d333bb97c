"""Host compilation: functions of JAX that NumPy runs where nothing traces them, written once."""

import contextlib
import functools
import importlib.util
import marshal
import pickle
import re
import threading
import types
from collections.abc import Callable, Hashable, Sequence
from typing import Any, Generic, ParamSpec, Protocol, TypeVar, runtime_checkable

import jax
import numpy as np

from jaxbiped._debug_switches import without_switches
from jaxbiped.caching import _caches
from jaxbiped.caching._cached_jit import Arguments, arguments_of, cached_jit
from jaxbiped.caching._caches import Once, register_programs
from jaxbiped.caching._collector_pause import long_trace
from jaxbiped.caching._compiled_store import Skeleton
from jaxbiped.caching._disk_cache import read_entry, write_entry
from jaxbiped.caching._fingerprint import fingerprint
from jaxbiped.compiler.host_code._control_flow import CONTROL_FLOW
from jaxbiped.compiler.host_code._host_writer import NAMES, HostWriter, Rule, UnwrittenError, Value
from jaxbiped.compiler.host_code._indexing import INDEXING
from jaxbiped.compiler.host_code._moves import MOVES
from jaxbiped.compiler.host_code._operations import LINEAR_ALGEBRA, OPERATIONS

_KIND = "host"
_RULES: dict[str, Rule] = OPERATIONS | MOVES | INDEXING | LINEAR_ALGEBRA | CONTROL_FLOW
_P = ParamSpec("_P")
_T = TypeVar("_T")


def register_rule(name: str, rule: Rule) -> None:
    """How a primitive that JAX does not have is written."""
    _RULES[name] = rule


@runtime_checkable
class Prepared(Protocol):
    """What a program holds that has to be made before it runs."""

    def ready(self) -> bool:
        """Whether it runs without compiling anything first."""


class HostProgram:
    """A function of arrays; call it."""

    def __init__(self, code: types.CodeType, constants: dict[str, Any], result: Skeleton) -> None:
        self._code, self._constants, self._result = code, constants, result
        names = dict(NAMES) | constants
        exec(code, names)
        self._function = names["program"]

    def __call__(self, arrays: Sequence[Any], convert: Callable[[list[Any]], list[Any]]) -> Any:
        """The result, its arrays converted from NumPy's."""
        given = [np.asarray(each)[()] for each in arrays]
        with np.errstate(all="ignore"):
            found = self._function(*given)
        return self._result.filled(convert(found))

    def shapes(self) -> Any:
        """The result with shapes instead of arrays."""
        places = self._result.places
        return self._result.filled([jax.ShapeDtypeStruct(x.shape, x.dtype) for x in places])

    def packed(self) -> bytes:
        """All of it, for another process of the same Python."""
        leaves, structure = self._result
        skeleton = structure.unflatten(range(len(leaves)))
        magic, code = importlib.util.MAGIC_NUMBER, marshal.dumps(self._code)
        return pickle.dumps((magic, code, self._constants, leaves, skeleton))


def write_host_program(
    function: Callable[[Sequence[Any]], Any], arrays: Sequence[Any], key: str | None
) -> HostProgram:
    """Writes a function of arrays, and keeps it by its key.

    Raises:
        UnwrittenError: it holds an operation that has no form in NumPy here.
    """
    results: list[Skeleton] = []

    def flat(*given: Any) -> list[Any]:
        result, found = Skeleton.of(function(given))
        results.append(result)
        return found

    with long_trace():
        closed = jax.make_jaxpr(flat)(*arrays)
        made = HostProgram(*_written(closed), results[-1])
    things = [each for each in made._constants.values() if isinstance(each, Prepared)]
    if key is not None and all(fingerprint(each) is not None for each in things):
        with contextlib.suppress(Exception):  # what cannot be pickled stays in this process
            write_entry(_KIND, key, made.packed())
    return made


def read_host_program(key: str) -> HostProgram | None:
    """What was kept by a key; None where that is nothing, or what it calls is not there."""
    content = read_entry(_KIND, key)
    if content is None:
        return None
    with contextlib.suppress(Exception):  # whatever is amiss with it, it is written again
        magic, code, constants, leaves, skeleton = pickle.loads(content)
        things = [each for each in constants.values() if isinstance(each, Prepared)]
        if magic == importlib.util.MAGIC_NUMBER and all(each.ready() for each in things):
            result = Skeleton(leaves, jax.tree.structure(skeleton))
            return HostProgram(marshal.loads(code), constants, result)
    return None


def _written(closed: Any) -> tuple[types.CodeType, dict[str, Any]]:
    """The code of a program of JAX, and the constants in it."""
    writer = HostWriter(_RULES)
    given = [
        Value(writer.block, tuple(v.aval.shape), v.aval.dtype, tuple(v.aval.shape), f"a{k}")
        for k, v in enumerate(closed.jaxpr.invars)
    ]
    found = writer.inline(closed.jaxpr, closed.consts, given)
    texts = [writer.text(writer.full(each)) for each in found if each is not None]
    lines = [*writer.block.lines, f"return [{', '.join(texts)}]"]
    head = f"def program({', '.join(str(each.name) for each in given)}):"
    text = "\n".join([head, *("    " + line for line in lines), ""])
    used = set(re.findall(r"\bk\d+\b", text))
    constants = {name: each for name, each in writer.constants.items() if name in used}
    return compile(text, "<host program>", "exec"), constants


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
