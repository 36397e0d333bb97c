"""Fingerprint: what decides the meaning of functions and settings, the same in every process.

By it a program on disk is found again. It holds for what the package and the libraries below it
define; functions and classes of a notebook could change without a sign, so they have none.

Of the package's own source it counts the modules that define the functions and classes in question,
and all that the imports of these lead to. Modules are digested as syntax trees, without comments,
docstrings and layout. So a change in another layer, or of words, leaves every program where it is.
"""

import ast
import dataclasses
import enum
import functools
import hashlib
import importlib.util
import os
import sys
import threading
import time
import types
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.tree_util as jtu
import numpy as np

from jaxbiped._checks import LIBRARIES
from jaxbiped.caching import IMPORT_BEGAN_AT
from jaxbiped.caching._caches import bounded_cache
from jaxbiped.caching._disk_cache import read_object, write_object
from jaxbiped.caching._user_code import code_members

_KIND = "sources"
_SETTLED = 1_000_000_000
"""Age [ns] from which a file is sure to have another stamp when it changes again."""


class _Module(NamedTuple):
    """What is known of a file.

    Attributes:
        stamp: of the file that was read.
        digest: of its code.
        imports: what it imports from the package, as a module and a name in it; no name where the
            module itself is imported.
    """

    stamp: list[int]
    digest: str
    imports: list[tuple[str, str]]


class SourceDigests:
    """Digests of the modules of a package, each with all that its imports lead to."""

    def __init__(self, folder: Path, *, loaded: int) -> None:
        """`folder` is the package's; it was imported at `loaded` [ns since the epoch]."""
        self._package, self._loaded = folder.name, loaded
        self._entry = hashlib.sha256(f"{folder.resolve()}\n{sys.version}".encode()).hexdigest()
        self._paths = {_module_of(path, folder): path for path in folder.rglob("*.py")}
        self._known: dict[str, _Module] = read_object(_KIND, self._entry, dict) or {}
        self._digests = dict[str, str]()
        self._current, self._unsaved = set[str](), False
        self._lock = threading.Lock()

    def digest(self, module: str) -> str:
        """Of a module's code and the code that it can reach.

        Raises:
            LookupError: there is none, or a file changed after the package was imported: what
                this process runs may be another one.
        """
        with self._lock:
            if module not in self._digests:
                reached = self._reachable(module)
                self._save()
                parts = "\n".join(f"{name} {self._known[name].digest}" for name in sorted(reached))
                self._digests[module] = hashlib.sha256(parts.encode()).hexdigest()
            return self._digests[module]

    def reached(self, module: str) -> set[str]:
        """A module with those that its imports, and the packages that it lies in, lead to."""
        with self._lock:
            return self._reachable(module)

    def _reachable(self, module: str) -> set[str]:
        reached, waiting = set[str](), [module]
        while waiting:
            name = waiting.pop()
            if name in reached:
                continue
            reached.add(name)
            for imported in self._of(name).imports:
                waiting.extend(self._led_to(*imported))
            # A package may fill the tables of its modules: functions that tell classes apart.
            package = name.rpartition(".")[0]
            waiting.extend([package] if package else [])
        return reached

    def _led_to(self, module: str, name: str) -> Iterator[str]:
        """The modules that an import may lead to."""
        whole = f"{module}.{name}"
        if whole in self._paths:
            yield from (module, *self._under(whole))
        elif not name or module == self._package:
            yield from self._under(module)  # any attribute of it
        else:
            yield module

    def _under(self, name: str) -> Iterator[str]:
        """A module, and all that lie in it where it is a package."""
        return (each for each in self._paths if f"{each}.".startswith(f"{name}."))

    def _of(self, name: str) -> _Module:
        """What is known of a module, read again where it changed."""
        known = self._known.get(name)
        if known is not None and name in self._current:
            return known
        try:
            path = self._paths[name]
            status = path.stat()
            stamp = [status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino]
            if status.st_ctime_ns > self._loaded:
                raise LookupError(f"{path} changed after it was imported")
            if known is None or known.stamp != stamp:
                known = _Module(stamp, *_read_module(path, name, self._package))
                self._known[name], self._unsaved = known, True
        except (OSError, SyntaxError, UnicodeDecodeError) as cause:
            raise LookupError(f"the source of {name} cannot be read") from cause
        self._current.add(name)
        return known

    def _save(self) -> None:
        if self._unsaved:
            before = time.time_ns() - _SETTLED
            found = {name: each for name, each in self._known.items() if each.stamp[2] < before}
            write_object(_KIND, self._entry, found)
            self._unsaved = False


def _module_of(path: Path, folder: Path) -> str:
    parts = (folder.name, *path.relative_to(folder).with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _read_module(path: Path, name: str, package: str) -> tuple[str, list[tuple[str, str]]]:
    """Its code's digest, and what it imports from the package."""
    tree = ast.parse(path.read_bytes())
    own = name if path.name == "__init__.py" else name.rpartition(".")[0]
    found = {each for node in _statements(tree) for each in _imports(node, own)}
    imports = sorted(each for each in found if each[0].split(".")[0] == package)
    return hashlib.sha256(ast.dump(tree).encode()).hexdigest(), imports


def _statements(tree: ast.AST) -> Iterator[ast.stmt]:
    """All statements in a tree, from which it takes those that are only a string."""
    for field in ("body", "orelse", "finalbody", "handlers", "cases"):
        nodes = getattr(tree, field, None)
        if not isinstance(nodes, list):
            continue
        nodes[:] = [node for node in nodes if not _is_string(node)]
        for node in nodes:
            if isinstance(node, ast.stmt):
                yield node
            yield from _statements(node)


def _is_string(node: ast.AST) -> bool:
    """Whether it is a docstring, or one below an attribute."""
    if not (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)):
        return False
    return isinstance(node.value.value, str)


def _imports(node: ast.stmt, own: str) -> Iterator[tuple[str, str]]:
    """What a statement in the package `own` imports."""
    if isinstance(node, ast.Import):
        for alias in node.names:
            yield alias.name, ""
    elif isinstance(node, ast.ImportFrom):
        dots = "." * node.level
        module = importlib.util.resolve_name(dots + (node.module or ""), own)
        for alias in node.names:
            yield module, alias.name


_PACKAGE = "jaxbiped"
_SETTINGS = (
    "jax_default_matmul_precision",
    "jax_default_prng_impl",
    "jax_enable_x64",
    "jax_numpy_dtype_promotion",
    "jax_numpy_rank_promotion",
    "jax_threefry_partitionable",
)
_PLAIN = (bool, int, float, complex, str, bytes, slice, np.dtype, np.generic)
_MOST_NESTED = 200


class UnknownMeaningError(ValueError):
    """Something whose meaning another process could not know."""


@dataclasses.dataclass(frozen=True)
class Leaf:
    """Where an array is that a program is given.

    Attributes:
        shape: of the array, with `dtype` and whether that is `weak`.
    """

    shape: tuple[int, ...]
    dtype: Any
    weak: bool


def fingerprint(*things: object) -> str | None:
    """The fingerprint of these in this version of all that they use; None where there is none."""
    digest = hashlib.sha256(_versions().encode())
    try:
        digest.update(_source_of(__name__).encode())
        for part in _parts(things, 0):
            digest.update(part)
            digest.update(b"\0")
    except UnknownMeaningError:
        return None
    return digest.hexdigest()


def _parts(thing: Any, depth: int) -> Iterator[bytes]:
    """What tells a thing from others, piece by piece."""
    if depth > _MOST_NESTED:
        raise UnknownMeaningError("nested too deeply, or within itself")
    yield _class_name(type(thing)).encode()
    own = getattr(thing, "__fingerprint__", None)
    if own is not None and not isinstance(thing, type):
        yield from _parts(own(), depth + 1)
    elif thing is None or thing is ... or isinstance(thing, _PLAIN):
        yield repr(thing).encode()
    elif isinstance(thing, enum.Enum):
        yield thing.name.encode()
    elif isinstance(thing, jax.core.Tracer):
        raise UnknownMeaningError("a traced array")
    elif isinstance(thing, np.ndarray | jax.Array):
        values = np.asarray(thing)
        yield f"{values.shape} {values.dtype}".encode()
        yield values.tobytes()
    elif isinstance(thing, type):
        yield _class_name(thing).encode()
    else:
        for each in _members(thing):
            yield from _parts(each, depth + 1)
        yield b"end"


def _members(thing: Any) -> Iterator[object]:
    if isinstance(thing, Mapping):
        yield from thing.items()
    elif isinstance(thing, tuple | list):
        yield from thing
    elif isinstance(thing, frozenset | set):
        yield from sorted(thing, key=repr)
    elif isinstance(thing, types.FunctionType):
        yield from _function_members(thing)
    elif isinstance(thing, types.CodeType):
        yield from code_members(thing)
    elif isinstance(thing, types.MethodType):
        yield from (thing.__func__, thing.__self__)
    elif isinstance(thing, types.BuiltinFunctionType | np.ufunc):
        yield _name(thing)
    elif isinstance(thing, functools.partial):
        yield from (thing.func, thing.args, thing.keywords)
    elif isinstance(thing, jtu.PyTreeDef):
        yield jtu.tree_unflatten(thing, [Leaf((), "", False)] * thing.num_leaves)
    elif dataclasses.is_dataclass(thing):
        for field in dataclasses.fields(thing):
            yield field.name
            yield getattr(thing, field.name, None)
    elif callable(thing) and callable(getattr(thing, "__wrapped__", None)):
        yield thing.__wrapped__  # under a transformation such as `jax.jit`
    elif type(thing).__module__.split(".")[0] == _PACKAGE and hasattr(thing, "__dict__"):
        yield from sorted(_attributes(thing).items())
    else:
        raise UnknownMeaningError(f"a {type(thing)}")


def _function_members(function: types.FunctionType) -> Iterator[object]:
    """Of a function: where it is defined, and what it was defined with."""
    yield _name(function)
    # A wrapper bears the name of what it wraps.
    yield _source_of(function.__globals__.get("__name__"))
    yield function.__code__
    yield function.__defaults__
    yield function.__kwdefaults__
    for cell in function.__closure__ or ():
        try:
            yield cell.cell_contents
        except ValueError as empty:
            raise UnknownMeaningError("a name that is not defined yet") from empty


def _attributes(thing: object) -> dict[str, object]:
    """What an object of one of the package's own classes was made with."""
    found = vars(thing)
    later = functools.cached_property
    return {n: found[n] for n in found if not isinstance(getattr(type(thing), n, None), later)}


def _class_name(kind: type) -> str:
    """The name of a class; one made in a call is known by a function and arguments that make it.

    Where it has no `__made_by__` that tells them, another call may make another of its name.
    """
    made_by = vars(kind).get("__made_by__")
    if made_by is not None:
        return hashlib.sha256(b"\0".join(_parts(made_by, 0))).hexdigest()
    name = _name(kind)
    found: Any = sys.modules.get(kind.__module__)
    for part in kind.__qualname__.split("."):
        found = getattr(found, part, None)
    if found is not kind and kind.__module__.split(".")[0] == _PACKAGE:
        raise UnknownMeaningError(f"a class {name} that its module does not have")
    return name


def _name(thing: Any) -> str:
    """The name of a class or function of the package or a library that it uses."""
    module = getattr(thing, "__module__", None) or getattr(type(thing), "__module__", "")
    name = getattr(thing, "__qualname__", getattr(thing, "__name__", ""))
    return f"{module}.{name} {_source_of(module)}"


def _source_of(module: Any) -> str:
    """A digest of all code that a module of the package can reach; a library has its version."""
    root = str(module).split(".")[0]
    if root not in LIBRARIES:
        raise UnknownMeaningError(f"code of {module}")
    if root != _PACKAGE:
        return ""
    try:
        return _sources().digest(module)
    except LookupError as unknown:
        raise UnknownMeaningError(str(unknown)) from unknown


@bounded_cache(1)
def _sources() -> SourceDigests:
    return SourceDigests(Path(__file__).parents[1], loaded=IMPORT_BEGAN_AT)


def settings() -> tuple[object, ...]:
    """Settings of JAX that change what a program does."""
    return tuple(getattr(jax.config, name, None) for name in _SETTINGS)


def _versions() -> str:
    """Of all that is used, with the machine and the settings."""
    flags = os.environ.get("XLA_FLAGS", "")
    return "\n".join([_libraries(), flags, *map(str, settings())])


@bounded_cache(1)
def _libraries() -> str:
    from importlib.metadata import version

    import llvmlite.binding as llvm

    names = ("diffrax", "equinox", "jax", "jaxlib", "lineax", "llvmlite", "numpy", "optax",
             "optimistix")  # fmt: skip
    cpu = f"{llvm.get_host_cpu_name()} {llvm.get_host_cpu_features().flatten()}"
    return "\n".join([sys.version, cpu, *(f"{n} {version(n)}" for n in names)])


def as_leaves(tree: Any) -> Any:
    return jtu.tree_map(leaf_of, tree)


def leaf_of(array: Any) -> Leaf:
    weak = bool(getattr(array, "weak_type", False))
    return Leaf(tuple(array.shape), array.dtype, weak)
