"""User code: functions, classes and objects of the user's, told apart by all that they read.

A compiled program holds the numbers that such a function read while it was traced: from globals,
attributes, arrays, cells, helpers. They may change while the function stays the same object, so
every cache also compares the version of the code that a program was made of.
"""

import contextlib
import contextvars
import dis
import functools
import inspect
import io
import itertools
import pickle
import sys
import threading
import types
from collections.abc import Hashable, Iterator
from typing import Any

from jaxbiped._checks import LIBRARIES, ArgumentError

_NOT_READ = {"__dict__", "__weakref__", "__doc__", "__dataclass_fields__", "_abc_impl"}
_BY_ANY_NAME = {"getattr", "vars", "__dict__", "attrgetter", "asdict", "astuple", "fields"}
"""Names by which a function may read attributes that its code does not mention."""
_PLAIN: tuple[Any, ...] = (dict, list, tuple, set, frozenset, bytes, bool, int, float, complex, str)
_MOST_READINGS = 256


_READINGS: "dict[Hashable, _Reader]" = {}
_VERSIONS = itertools.count()
_LOCK = threading.RLock()


def users_code(*things: object) -> tuple[Hashable, ...]:
    """Finds the functions, classes and objects of the user's of which some things are made."""
    reader = _Reader(None)
    reader.dump(things)
    return tuple(reader.code)


def versions_of(code: tuple[Hashable, ...]) -> tuple[int, ...]:
    """Gives the version of each piece of code: another number once it reads anything else.

    Raises:
        ArgumentError: one reads a value that is traced.
    """
    with _LOCK:
        return tuple(map(_version, code))


def _version(piece: Hashable) -> int:
    last = _READINGS.get(piece)
    names, size = {} if last is None else last.by_code, -1
    while size < len(names):  # what is read may be more functions, which mention more
        size, reader = len(names), _Reader(piece, names)
        reader.dump(piece)
    if last is not None and last.file.getvalue() == reader.file.getvalue():
        return last.version
    if last is not None or len(_READINGS) >= _MOST_READINGS:
        if last is None:
            _READINGS.clear()
        sys.modules["jax"].clear_caches()  # what it traced of this and of equal functions
    reader.clear_memo()
    _READINGS[piece] = reader
    return reader.version


def _made(*parts: object) -> None:
    """It stands for the function that would make a thing again, which nobody does."""


class _Reader(pickle.Pickler):
    """It writes down all that a piece of code reads; without a piece, it finds those in a thing.

    Attributes:
        by_code: all that its functions mention, by their codes; `names` without these.
        kept: objects that are told apart by their identity, so that no other gets the same.
        version: a number that no other reader has.
    """

    def __init__(self, piece: object, names: dict[Any, frozenset[str]] | None = None) -> None:
        self.file, self.piece, self.kept = io.BytesIO(), piece, list[object]()
        self.code, self.finds, self.version = dict[Any, None](), names is None, next(_VERSIONS)
        self.by_code = {} if names is None else names
        self.names = set[str]().union(*self.by_code.values())
        super().__init__(self.file, protocol=5)

    def reducer_override(self, thing: Any) -> Any:
        """See `pickle.Pickler`. What is read is a state, as only states may contain themselves."""
        import jax

        kind = thing if isinstance(thing, type | types.FunctionType) else type(thing)
        users = kind is functools.partial or _is_users(kind)
        if thing is _made:
            return NotImplemented
        if isinstance(thing, jax.core.Tracer) and not self.finds:
            name = getattr(self.piece, "__qualname__", None) or type(self.piece).__qualname__
            raise ArgumentError(
                f"{name} reads a value that JAX traces from a closure or a global, which is not "
                "allowed: pass it as a leaf, of an equinox.Module that is the law, or for any "
                "other function of the scene or args that it is called with."
            )
        # Of a node of JAX's trees, the package reads the parts, so that all of them count.
        is_piece = thing is kind or jax.tree_util.all_leaves([thing])
        if users and self.finds and is_piece:
            with contextlib.suppress(TypeError):  # JAX takes nothing without a hash for a program's
                self.code[thing] = None
                return _made, ()
        return _made, (getattr(kind, "__qualname__", ""),), tuple(self._parts(thing, kind, users))

    def _parts(self, thing: Any, kind: Any, users: bool) -> Iterator[object]:
        if isinstance(thing, types.ModuleType):
            items, users = self._named(vars(thing)).items(), _is_users(thing)
            yield thing.__name__, [(n, x) for n, x in items if users or not callable(x)]
        elif isinstance(thing, types.FunctionType):
            yield thing.__code__, thing.__defaults__, thing.__kwdefaults__, thing.__closure__
            if users and thing.__code__ not in self.by_code:
                self.by_code[thing.__code__] = _names(thing.__code__)
                self.names |= self.by_code[thing.__code__]
            read = self.by_code.get(thing.__code__, ())
            yield {name: thing.__globals__.get(name) for name in sorted(read)}, vars(thing)
        elif isinstance(thing, types.CodeType):
            yield from code_members(thing)
        elif isinstance(thing, types.CellType):
            with contextlib.suppress(ValueError):  # a name that is not defined yet
                yield thing.cell_contents
        elif isinstance(thing, types.MethodType):
            yield thing.__func__, thing.__self__
        elif isinstance(thing, contextvars.ContextVar):
            yield thing.get(None)
        elif thing is kind:
            yield thing.__module__
            if users:
                members = {n: x for n, x in dict(vars(thing)).items() if n not in _NOT_READ}
                yield thing.__bases__, members
        elif users and kind is not functools.partial:
            yield kind, [plain(thing) for plain in _PLAIN if isinstance(thing, plain)]
            state = object.__getstate__(thing)
            for part in state if isinstance(state, tuple) else (state,):
                yield part if self.finds else self._named(part or {})
        elif isinstance(thing, sys.modules["jax"].tree_util.PyTreeDef):
            yield thing.unflatten(range(thing.num_leaves))
        elif hasattr(thing, "__fingerprint__"):
            yield thing.__fingerprint__()
        else:
            yield from self._library_parts(thing)

    def _library_parts(self, thing: Any) -> Iterator[object]:
        """Gives what an object of a library's class holds, or else its identity."""
        try:
            yield [list(x) if isinstance(x, Iterator) else x for x in thing.__reduce_ex__(5)]
        except Exception:  # whatever a library's class raises
            self.kept.append(thing)
            values = [getattr(thing, name, None) for name in sorted(self.names)]
            yield [value for value in values if isinstance(value, _PLAIN)]
            yield id(thing), getattr(thing, "__wrapped__", None), getattr(thing, "fget", None)

    def _named(self, attributes: dict[str, object]) -> dict[str, object]:
        """The attributes that the code may read."""
        if self.names & _BY_ANY_NAME:
            return dict(attributes)
        return {name: attributes[name] for name in sorted(self.names) if name in attributes}


def _is_users(thing: Any) -> bool:
    """Tells whether what a function, class or module reads is the user's to change."""
    bases = [base.__module__ for base in getattr(thing, "__mro__", ())]
    names = getattr(thing, "__globals__", vars(thing))
    name = bases[0] if bases else str(names.get("__name__"))
    if name.partition(".")[0] in LIBRARIES:
        return False
    # Classes of installed packages are many and do not change, unless they extend this package.
    extends = not bases or any(base.startswith("jaxbiped.") for base in bases)
    return extends or "site-packages" not in str(getattr(sys.modules.get(name), "__file__", None))


def _names(code: types.CodeType) -> frozenset[str]:
    """Finds what a function's code mentions: names, and texts that may be used as such."""
    steps = (step for step in dis.get_instructions(code) if step.opcode in dis.hasname)
    names = {step.argval for step in steps if step.opname != "STORE_ATTR"}
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            names |= _names(constant)
        texts = constant if isinstance(constant, tuple) else (constant,)
        names |= {text for text in texts if isinstance(text, str)}
    return frozenset(names)


def code_members(code: types.CodeType) -> Iterator[object]:
    """Of a function's code, where others of its name lie in its module: no lines and no words."""
    yield code.co_code
    yield (code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars)
    flag = getattr(inspect, "CO_HAS_DOCSTRING", None)  # since Python 3.14
    documented = code.co_flags & flag if flag else not code.co_name.startswith("<")
    first = isinstance(next(iter(code.co_consts), None), str) and documented
    yield code.co_consts[1 if first else 0 :]
