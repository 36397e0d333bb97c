"""Identity of models and functions, and provenance of results: what distinguishes two of them.

Only the model that began a store may continue it, and its laws may be a user's own code.
"""

import dataclasses
import enum
import functools
import hashlib
import inspect
import json
import platform
import re
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from jaxbiped._checks import LIBRARIES
from jaxbiped.caching._caches import bounded_cache

_OWN_MODULE = re.compile(r"^jaxbiped\.(?:[a-z]\w*\.)*_\w+\.")


def qualified_name(thing: Any) -> str:
    """Module and qualified name of a class or function; of a script's own, the script's name.

    The package's own are told without their module, which may move from version to version.
    """
    module = thing.__module__
    if module == "__main__":
        script = getattr(sys.modules["__main__"], "__file__", None)
        module = f"__main__({Path(script).name})" if script else module
    return _without_module(f"{module}.{thing.__qualname__}")


def _without_module(name: str) -> str:
    """A name in the package without the private module that it lies in."""
    return _OWN_MODULE.sub("jaxbiped.", name)


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
            name: identity(part) for name, part in _telling_fields(value)
        }
    if inspect.isfunction(value):
        return _function_identity(value)
    if hasattr(value, "__qualname__"):
        return qualified_name(value)
    return repr(value)


def _function_identity(function: Any) -> Any:
    """A function's name, with what it was made with where that differs from call to call."""
    nonlocals = inspect.getclosurevars(function).nonlocals.items()
    bound = {
        "defaults": function.__defaults__,
        "keywords": function.__kwdefaults__,
        "closure": {name: each for name, each in nonlocals if each is not function},
    }
    bound = {name: identity(each) for name, each in bound.items() if each}
    return {"function": qualified_name(function), **bound} if bound else qualified_name(function)


def difference_of(
    old: object,
    new: object,
    name: str = "",
    alike: Callable[[Any, Any, str], bool] = lambda old, new, name: False,
) -> str | None:
    """The first difference of two identities in words, None for none.

    `alike` may say of two values and their name that they count as equal. Names of the package's
    own classes and functions are compared without their modules, which stores of version 0.1 have.
    """
    if isinstance(old, dict) and isinstance(new, dict):
        for key in dict.fromkeys([*new, *old]):
            inner = f"{name}.{key}" if name else key
            if key not in old or key not in new:
                here = "only in the store" if key in old else "not in the store"
                return f"{inner} is {here}"
            found = difference_of(old[key], new[key], inner, alike)
            if found is not None:
                return found
        return None
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        pairs = enumerate(zip(old, new, strict=True))
        found_ = (difference_of(a, b, f"{name}[{i}]", alike) for i, (a, b) in pairs)
        return next((each for each in found_ if each is not None), None)
    if isinstance(old, str) and isinstance(new, str):
        old, new = _without_module(old), _without_module(new)
    if old == new or alike(old, new, name):
        return None
    return f"{name} = {_short_json(old)} there, {_short_json(new)} here"


def _short_json(value: object) -> str:
    text = json.dumps(value)
    return text if len(text) < 60 else f"{text[:57]}..."


def code_digests(*values: object) -> dict[str, str]:
    """Digest of the source of every class and function among these that is a user's own.

    By qualified name; "unknown" for source that cannot be read, as of an interactive session.
    """
    return source_digests(_own_code(values))


def source_digests(things: Iterable[Any]) -> dict[str, str]:
    """Digests of the source of those of these classes and functions that are a user's own.

    By qualified name, of classes also of those that they inherit from.
    """
    found: dict[str, str] = {}
    parts = (base for each in things for base in getattr(each, "__mro__", (each,)))
    for code in (part for part in parts if part.__module__.partition(".")[0] not in LIBRARIES):
        try:
            digest = hashlib.sha256(inspect.getsource(code).encode()).hexdigest()[:16]
        except (OSError, TypeError):
            digest = "unknown"
        name = qualified_name(code)  # which several functions without names of their own share
        found[name] = f"{found[name]} {digest}" if name in found else digest
    return dict(sorted(found.items()))


def _telling_fields(value: Any) -> Iterator[tuple[str, object]]:
    """Static fields, texts, and parts that have such."""
    for field in dataclasses.fields(value):
        part = getattr(value, field.name)
        whole = isinstance(part, str | list | tuple | Mapping) or dataclasses.is_dataclass(part)
        if whole or field.metadata.get("static", False):
            yield field.name, part


def _own_code(value: object) -> Iterator[Any]:
    if isinstance(value, list | tuple):
        for each in value:
            yield from _own_code(each)
    elif isinstance(value, functools.partial):
        yield from _own_code(value.func)
    elif inspect.isfunction(value):
        yield value
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        yield type(value)
        for field in dataclasses.fields(value):
            yield from _own_code(getattr(value, field.name))


_PACKAGES = ("jaxbiped", "jax", "diffrax", "numpy", "llvmlite")


DECISIVE = ("version_jaxbiped", "git_revision", "user_code")
"""Of the provenance, what decides on results; other packages' versions change their rounding."""


def provenance(*models: object) -> dict[str, str]:
    """Versions and revision, by attribute name, and digests of a user's own code in the models."""
    found = {f"version_{name}": _version(name) for name in _PACKAGES}
    found |= {"version_python": platform.python_version(), "git_revision": _revision()}
    return found | {"user_code": json.dumps(code_digests(*models))}


@bounded_cache(len(_PACKAGES))
def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "unknown"


@bounded_cache(1)  # what runs is what was imported
def _revision() -> str:
    """Of the source that runs, "unknown" where it is not a checkout.

    Where the checkout was changed, with a digest of the package's changes.
    """
    try:
        found = _git("describe", "--always", "--dirty", "--abbrev=40").strip()
        if not found.endswith("-dirty"):
            return found
        changes = _git("diff", "HEAD", "--", ".")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return f"{found}-{hashlib.sha256(changes.encode()).hexdigest()[:12]}"


def _git(*command: str) -> str:
    """What git says of the package's own folder."""
    package = Path(__file__).parent
    asked = ["git", "-C", str(package), *command]
    return subprocess.run(asked, capture_output=True, text=True, check=True).stdout
