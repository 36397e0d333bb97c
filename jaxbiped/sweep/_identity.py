"""Identity of models and functions: what distinguishes two of them besides numbers.

Only the model that began a store may continue it, and its laws may be a user's own code.
"""

import dataclasses
import enum
import functools
import hashlib
import inspect
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

_KNOWN = ("jaxbiped", "equinox", "diffrax", "builtins", "abc", "collections", "typing")
"""Packages whose code is no user's own."""


def qualified_name(thing: Any) -> str:
    """Module and qualified name of a class or function; of a script's own, the script's name."""
    module = thing.__module__
    if module == "__main__":
        script = getattr(sys.modules["__main__"], "__file__", None)
        module = f"__main__({Path(script).name})" if script else module
    return f"{module}.{thing.__qualname__}"


def identity(value: object) -> Any:
    """What a value is, ready for JSON; equal for two values that do the same.

    A dataclass (so every model and law) is told by its class's qualified name, its static fields
    and those of its parts. Its numeric leaves are parameters and not told here.
    """
    if isinstance(value, enum.Enum):
        return f"{qualified_name(type(value))}.{value.name}"
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, functools.partial):
        parts = {"args": value.args, "keywords": value.keywords}
        return {"partial": identity(value.func)} | identity(parts)
    if hasattr(value, "__array__"):
        return np.asarray(value).tolist()
    if isinstance(value, Mapping):
        return {str(key): identity(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [identity(each) for each in value]
    if isinstance(value, set | frozenset):
        return sorted(map(repr, value))
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {"class": qualified_name(type(value))} | {
            name: identity(part) for name, part in _telling(value)
        }
    if hasattr(value, "__qualname__"):
        return qualified_name(value)
    return repr(value)


def code_digests(*values: object) -> dict[str, str]:
    """Digest of the source of every class and function among these that is a user's own.

    By qualified name; "unknown" for source that cannot be read, as of an interactive session.
    """
    found: dict[str, str] = {}
    for own in _own_code(values):
        try:
            digest = hashlib.sha256(inspect.getsource(own).encode()).hexdigest()[:16]
        except (OSError, TypeError):
            digest = "unknown"
        found[qualified_name(own)] = digest
    return dict(sorted(found.items()))


def _telling(value: Any) -> Iterator[tuple[str, object]]:
    """Static fields, and parts that have such."""
    for field in dataclasses.fields(value):
        part = getattr(value, field.name)
        whole = isinstance(part, list | tuple | Mapping) or dataclasses.is_dataclass(part)
        if whole or field.metadata.get("static", False):
            yield field.name, part


def _own_code(value: object) -> Iterator[Any]:
    if isinstance(value, list | tuple):
        for each in value:
            yield from _own_code(each)
    elif isinstance(value, functools.partial):
        yield from _own_code(value.func)
    elif inspect.isfunction(value):
        if not _is_known(value):
            yield value
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        yield from (base for base in type(value).__mro__ if not _is_known(base))
        for field in dataclasses.fields(value):
            yield from _own_code(getattr(value, field.name))


def _is_known(thing: Any) -> bool:
    return thing.__module__.partition(".")[0] in _KNOWN
