"""Host programs: functions of JAX that NumPy runs, written once for all processes."""

import contextlib
import importlib.util
import marshal
import pickle
import re
import types
from collections.abc import Callable, Sequence
from typing import Any, Protocol, runtime_checkable

import jax
import numpy as np

from jaxbiped.caching._collector_pause import long_trace
from jaxbiped.caching._compiled_store import Skeleton
from jaxbiped.caching._disk_cache import read_entry, write_entry
from jaxbiped.caching._fingerprint import fingerprint
from jaxbiped.compiler.host_code._control_flow import CONTROL_FLOW
from jaxbiped.compiler.host_code._host_writer import NAMES, HostWriter, Rule, Value
from jaxbiped.compiler.host_code._indexing import INDEXING
from jaxbiped.compiler.host_code._linear_algebra import LINEAR_ALGEBRA
from jaxbiped.compiler.host_code._moves import MOVES
from jaxbiped.compiler.host_code._operations import OPERATIONS

_KIND = "host"
_RULES: dict[str, Rule] = OPERATIONS | MOVES | INDEXING | LINEAR_ALGEBRA | CONTROL_FLOW


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
