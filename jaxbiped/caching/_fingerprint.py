"""Fingerprint: what decides the meaning of functions and settings, the same in every process.

By it a program on disk is found again. It holds for what the package and the libraries below it
define; functions and classes of a notebook could change without a sign, so they have none. Of the
package's own source it counts what the functions and classes in question can reach.
"""

import dataclasses
import enum
import functools
import hashlib
import os
import sys
import types
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import jax
import jax.tree_util as jtu
import numpy as np

from jaxbiped._checks import LIBRARIES
from jaxbiped.caching import IMPORT_BEGAN_AT
from jaxbiped.caching._caches import bounded_cache
from jaxbiped.caching._source_digest import SourceDigests
from jaxbiped.caching._user_code import code_members

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
