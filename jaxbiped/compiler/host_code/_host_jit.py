"""Host compilation: functions of JAX that NumPy runs where nothing traces them, written once."""

import contextlib
import functools
import importlib.util
import marshal
import re
import types
from collections.abc import Callable, Sequence
from typing import Any, ParamSpec, Protocol, TypeAlias, TypeVar, runtime_checkable

import jax
import jax.tree_util as jtu
import numpy as np

from jaxbiped._jax_versions import nothing_is_traced, without_switches
from jaxbiped.caching._cached_jit import (
    ArrayFunction,
    Form,
    Skeleton,
    cached_jit,
    flattened,
    long_trace,
)
from jaxbiped.caching._disk_cache import read_object, write_object
from jaxbiped.caching._fingerprint import fingerprint
from jaxbiped.compiler.host_code._host_writer import NAMES, HostWriter, Rule, UnwrittenError, Value
from jaxbiped.compiler.host_code._moves import MOVES
from jaxbiped.compiler.host_code._operations import CONTROL_FLOW, LINEAR_ALGEBRA, OPERATIONS

_KIND = "host"
_FEW = 1000
"""Numbers in an array up to which NumPy runs a function: it holds all that lies in between."""
_RULES: dict[str, Rule] = OPERATIONS | MOVES | LINEAR_ALGEBRA | CONTROL_FLOW
Converter: TypeAlias = Callable[[list[Any]], list[Any]]
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

    def __init__(
        self, code: types.CodeType, constants: dict[str, Any], result: Skeleton, convert: Converter
    ) -> None:
        """Arrays of the result are converted from NumPy's."""
        self.code, self.constants, self.result, self._convert = code, constants, result, convert
        names = dict(NAMES) | constants
        exec(code, names)
        self._function = names["program"]

    def __call__(self, arrays: Sequence[Any]) -> Any:
        given = [np.asarray(each)[()] for each in arrays]
        with np.errstate(all="ignore"):
            found = self._function(*given)
        return self.result.filled(self._convert(found))

    @property
    def prepared(self) -> list[Prepared]:
        """What it holds that has to be made before it runs."""
        return [each for each in self.constants.values() if isinstance(each, Prepared)]


def write_host_program(
    function: ArrayFunction,
    arrays: Sequence[Any],
    key: str | None = None,
    convert: Converter = list,
) -> HostProgram:
    """Writes a function of arrays, and keeps it by its key.

    Raises:
        UnwrittenError: it holds an operation that has no form in NumPy here.
    """
    flat, results = flattened(function)
    with long_trace():
        closed = jax.make_jaxpr(flat)(*arrays)
        made = HostProgram(*_written(closed), results[-1], convert)
    if key is not None and all(fingerprint(each) is not None for each in made.prepared):
        # For another process of the same Python.
        code = marshal.dumps(made.code)
        write_object(_KIND, key, importlib.util.MAGIC_NUMBER, code, made.constants, made.result)
    return made


def read_host_program(key: str, convert: Converter) -> HostProgram | None:
    """What was kept by a key; None where that is nothing, or what it calls is not there."""

    def load(
        magic: bytes, code: bytes, constants: dict[str, Any], result: Skeleton
    ) -> HostProgram | None:
        if magic != importlib.util.MAGIC_NUMBER:
            return None
        made = HostProgram(marshal.loads(code), constants, result, convert)
        return made if all(each.ready() for each in made.prepared) else None

    return read_object(_KIND, key, load)


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


def host_jit(
    where: Callable[..., bool] = lambda *_, **__: True, *, within: bool = False
) -> Callable[[Callable[_P, _T]], cached_jit[_P, _T]]:
    """Decorator: a function that NumPy runs `where` that pays and nothing traces the call.

    It pays where programs of lanes do the work. Else, and where NumPy lacks one of its operations,
    XLA compiles it; see `cached_jit`. Results that stay `within` the package are left arrays of
    NumPy.
    """
    convert = list if within else lambda arrays: _of_jax(arrays)

    def make(function: ArrayFunction, arrays: Sequence[Any], key: str | None) -> HostProgram | None:
        kept = None if key is None else read_host_program(key, convert)
        with contextlib.suppress(UnwrittenError):
            return kept or write_host_program(function, arrays, key, convert)
        return None

    return lambda function: cached_jit(function, Form(where, make))


@cached_jit
def _of_jax(arrays: list[Any]) -> list[Any]:
    """Makes all of them arrays of JAX, for which `jax.device_put` takes 20 µs each."""
    return arrays


def kept_alone(function: Callable[_P, _T]) -> Callable[_P, _T]:
    """Decorator: a function of arrays that is one kept program where it is called by itself.

    Operation by operation JAX would compile a program for each. NumPy runs it where arrays are
    small: its program is written many times sooner than XLA compiles one. Where something traces
    it, it is a part of the whole as it is.
    """
    kept = host_jit(_are_small)(function)

    @without_switches
    @functools.wraps(function)
    def called(*args: _P.args, **kwargs: _P.kwargs) -> _T:
        if not nothing_is_traced():
            return function(*args, **kwargs)
        args, kwargs = jtu.tree_map(_as_array, (args, kwargs))
        return kept(*args, **kwargs)

    return called


def _are_small(*args: Any, **kwargs: Any) -> bool:
    return all(getattr(leaf, "size", 1) <= _FEW for leaf in jtu.tree_leaves((args, kwargs)))


def _as_array(leaf: Any) -> Any:
    """A number of Python's as an array, for it not to be compiled in."""
    return np.asarray(leaf) if isinstance(leaf, float | int) else leaf
