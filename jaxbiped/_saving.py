"""Saving and loading: scenes and results in one file, to the last bit, and no code in it.

A file is a ZIP archive, which NumPy opens, too: what hangs together how in `contents.json`, and
every array in a `.npy` of its own. A module, a named tuple or an enumeration stands there by the
import path of its class and the values of its fields; nothing is pickled.
"""

import contextlib
import dataclasses
import enum
import functools
import importlib
import io
import json
import math
import pkgutil
import sys
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import jax
import numpy as np

from jaxbiped._checks import ArgumentError, warn
from jaxbiped._files import check_writable_file, failure_kind, user_path
from jaxbiped._identity import provenance, source_digests
from jaxbiped._types import JsonObject, as_array

_ARRAYS = (np.ndarray, np.ma.MaskedArray)
_NOWHERE = ("<locals>", "<lambda>")
"""In the names of functions and classes that nobody can import."""


class Encoder:
    """A value as JSON and arrays; `found` are the classes and functions in it by import path."""

    def __init__(self) -> None:
        self.arrays: list[np.ndarray] = []
        self.found: dict[str, Any] = {}

    def encode(self, value: Any, where: str) -> Any:
        """The value as JSON; `where` it lies, for what cannot be saved."""
        if isinstance(value, enum.Enum):
            return {
                "enum": self._path(type(value), where),
                "value": self.encode(value.value, where),
            }
        if isinstance(value, jax.core.Tracer):
            raise ArgumentError(f"{where} is traced: save what a transformed function returns.")
        if type(value) in _ARRAYS or isinstance(value, np.generic | jax.Array):
            return self._array(value, where)
        if value is None or type(value) in (bool, int, str):
            return value
        if type(value) is float:
            return value if math.isfinite(value) else {"float": str(value)}
        if type(value) is complex:
            return {"complex": [self.encode(part, where) for part in (value.real, value.imag)]}
        if hasattr(value, "_asdict") and not isinstance(value, type):
            return self._fields(value, value._asdict(), where)
        if type(value) in (list, tuple):
            items = [self.encode(each, f"{where}[{k}]") for k, each in enumerate(value)]
            return items if isinstance(value, list) else {"tuple": items}
        if type(value) is dict:
            pairs = [[self.encode(k, where), self.encode(v, f"{where}[{k!r}]")]
                     for k, v in value.items()]  # fmt: skip
            return {"dict": pairs}
        if dataclasses.is_dataclass(value) and not isinstance(value, type):
            names = (field.name for field in dataclasses.fields(value))
            fields = {name: getattr(value, name) for name in names if hasattr(value, name)}
            return self._fields(value, fields, where)
        if _is_dataset(value):
            return self._dataset(value, where)
        if callable(value) and hasattr(value, "__qualname__"):
            return {"import": self._path(value, where)}
        raise ArgumentError(
            f"{where} is not allowed: objects of type {type(value).__name__} cannot be saved."
        )

    def _array(self, value: Any, where: str) -> JsonObject:
        if isinstance(value, np.ma.MaskedArray):
            parts = (np.asarray(value.data), value.mask, value.fill_value)
            return {"masked": [self.encode(part, where) for part in parts]}
        if isinstance(value, jax.Array) and hasattr(value.dtype, "_impl"):
            raise ArgumentError(f"{where} is not allowed: {value.dtype} cannot be saved.")
        array, small = np.asarray(value), {}
        if array.dtype.type.__module__ == "ml_dtypes":  # such as bfloat16: a file holds its bits
            array, small = array.view(f"u{array.itemsize}"), {"dtype": array.dtype.name}
        if array.dtype == object:
            items = [self.encode(each, where) for each in array.ravel().tolist()]
            return {"objects": items, "shape": list(array.shape)}
        if not _is_kept(array.dtype):
            raise ArgumentError(f"{where} is not allowed: {array.dtype} cannot be saved.")
        self.arrays.append(array)
        kind = "scalar" if isinstance(value, np.generic) else "numpy"
        return {"jax" if isinstance(value, jax.Array) else kind: len(self.arrays) - 1} | small

    def _fields(self, value: Any, fields: Mapping[str, Any], where: str) -> JsonObject:
        own = {name: self.encode(each, f"{where}.{name}") for name, each in fields.items()}
        return {"class": self._path(type(value), where), "fields": own}

    def _dataset(self, value: Any, where: str) -> JsonObject:
        variables = {
            str(name): self.encode((each.dims, each.values, dict(each.attrs)), where)
            for name, each in value.variables.items()
        }
        coordinates = list(map(str, value.coords))
        attributes = self.encode(dict(value.attrs), where)
        return {"dataset": variables, "coords": coordinates, "attrs": attributes}

    def _path(self, thing: Any, where: str) -> str:
        name = f"{_home(thing)}:{thing.__qualname__}"
        nowhere = any(part in name for part in _NOWHERE)
        if nowhere or _imported(*name.split(":")) is not thing:
            raise ArgumentError(
                f"{where} is not allowed: {thing.__qualname__} has no import path; define it at "
                "the top of a module."
            )
        self.found[name] = thing
        return name


def _home(thing: Any) -> str:
    """The outermost public package that exports a class or function, else its module, which may
    move.
    """
    name, root = thing.__qualname__, thing.__module__.partition(".")[0]
    packages = [key for key, module in list(sys.modules.items()) if hasattr(module, "__path__")]
    public = [key for key in packages if key.partition(".")[0] == root and "._" not in key]
    for package in sorted(public, key=lambda key: (key.count("."), key)):
        module = sys.modules[package]
        if name in dir(module) and getattr(module, name) is thing:
            return package
    return str(thing.__module__)


def _is_kept(dtype: np.dtype) -> bool:
    """Whether a `.npy` file holds arrays of a type, without pickled objects."""
    form: Any = np.lib.format
    with contextlib.suppress(TypeError, ValueError):
        return not dtype.hasobject and form.descr_to_dtype(form.dtype_to_descr(dtype)) == dtype
    return False


def _is_dataset(value: Any) -> bool:
    xarray = sys.modules.get("xarray")
    return xarray is not None and isinstance(value, xarray.Dataset)


class Decoder:
    """Values from JSON and arrays; `found` are the classes and functions in them by import path."""

    def __init__(self, array: Callable[[int], np.ndarray], version: str) -> None:
        """`array` gives one by its number; `version` is the jaxbiped that wrote them."""
        self._array, self._version = array, version
        self.found: dict[str, Any] = {}

    def decode(self, tree: Any) -> Any:
        """The value that JSON stands for."""
        if isinstance(tree, list):
            return [self.decode(each) for each in tree]
        if not isinstance(tree, dict):
            return tree
        kind, held = next(iter(tree.items()))
        decoders: dict[str, Callable[[], Any]] = {
            "float": lambda: float(held),
            "complex": lambda: complex(*self.decode(held)),
            "tuple": lambda: tuple(self.decode(held)),
            "dict": lambda: {self.decode(key): self.decode(each) for key, each in held},
            "numpy": lambda: self._array_of(tree, held),
            "scalar": lambda: self._array_of(tree, held)[()],
            "jax": lambda: as_array(self._array_of(tree, held)),
            "masked": lambda: self._masked(*self.decode(held)),
            "objects": lambda: self._objects(held, tree["shape"]),
            "enum": lambda: self._import(held, enum.Enum)(self.decode(tree["value"])),
            "import": lambda: self._import(held),
            "class": lambda: self._instance(held, tree["fields"]),
            "dataset": lambda: self._dataset(tree),
        }
        return decoders[kind]()

    def _array_of(self, tree: JsonObject, number: int) -> np.ndarray:
        array = self._array(number)
        return array.view(jax.numpy.dtype(tree["dtype"])) if "dtype" in tree else array

    def _masked(self, values: np.ndarray, mask: np.ndarray, fill: Any = None) -> np.ndarray:
        return np.ma.MaskedArray(values, mask, fill_value=fill)

    def _objects(self, items: list[Any], shape: list[int]) -> np.ndarray:
        array = np.empty(len(items), object)
        for place, item in enumerate(items):  # an item may be an array itself
            array[place] = self.decode(item)
        return array.reshape(shape)

    def _dataset(self, tree: JsonObject) -> Any:
        import xarray

        variables = {name: self.decode(each) for name, each in tree["dataset"].items()}
        found = xarray.Dataset(variables, attrs=self.decode(tree["attrs"]))
        return found.set_coords(tree["coords"])

    def _import(self, name: str, *kinds: type) -> Any:
        module, _, inner = name.partition(":")
        thing = _imported(module, inner)
        if thing is None or (kinds and not (isinstance(thing, type) and issubclass(thing, kinds))):
            raise ArgumentError(
                f"it needs {inner} of the module {module}, which is not found{self._by(module)}; "
                "make that module importable."
            )
        self.found[name] = thing
        return thing

    def _instance(self, name: str, fields: JsonObject) -> Any:
        kind = self._import(name)
        values = {each: self.decode(tree) for each, tree in fields.items()}
        if dataclasses.is_dataclass(kind):
            own: dict[str, Any] = {field.name: field for field in dataclasses.fields(kind)}
            defaults = {name for name, field in own.items() if _has_default(field)}
            for each in defaults - set(values):
                factory = own[each].default_factory
                values[each] = own[each].default if factory is dataclasses.MISSING else factory()
        else:
            own = dict.fromkeys(getattr(kind, "_fields", ()))
            defaults = set(getattr(kind, "_field_defaults", own))
        odd = sorted((set(own) - defaults - set(values)) | (set(values) - set(own)))
        if odd:
            raise ArgumentError(
                f"{name.partition(':')[2]} has other fields here: {', '.join(odd)}{self._by(name)}."
            )
        if issubclass(kind, tuple):
            return kind(**values)
        # As it was, and not made anew: what was saved has been checked, and NaN stays.
        made = object.__new__(kind)
        for each, value in values.items():
            object.__setattr__(made, each, value)
        return made

    def _by(self, module: str) -> str:
        """That another version wrote it, of the package's own."""
        own = provenance()["version_jaxbiped"]
        if not module.startswith("jaxbiped") or own == self._version:
            return ""
        return f" (written by jaxbiped {self._version}; this is {own})"


def _imported(module: str, name: str) -> Any:
    """What lies in a module by this name; None where it is not found."""
    # Nothing that can be saved lies in the standard library, and a file may come from anybody.
    if module.partition(".")[0] in sys.stdlib_module_names:
        return None
    with contextlib.suppress(ImportError, AttributeError):
        # Types of states are found by one name, which has no points.
        return functools.reduce(getattr, name.split("."), importlib.import_module(module))
    return _moved(module, name) if module.startswith("jaxbiped.") else None


def _moved(module: str, name: str) -> Any:
    """What an earlier version had in another module of a subpackage; None if it is gone."""
    package = ".".join(module.split(".")[:2]) if module.count(".") > 1 else "jaxbiped"
    with contextlib.suppress(ImportError):
        searched = importlib.import_module(package)
        for _, path, _ in pkgutil.walk_packages(searched.__path__, f"{package}."):
            thing = getattr(importlib.import_module(path), name, None)
            if getattr(thing, "__module__", "") == path:
                return thing
    return None


def _has_default(field: Any) -> bool:
    missing = dataclasses.MISSING
    return field.default is not missing or field.default_factory is not missing


FORMAT = 1
"""Of files: another one is written where this version could not read what is in them."""
_CONTENTS = "contents.json"
_BEGAN = (1980, 1, 1, 0, 0, 0)
"""Time that archives tell of their parts: equal contents make equal files."""


def save(path: str | Path, value: Any) -> None:
    """Saves scenes and results to a file, from which `load` restores them bit by bit.

    Args:
        path: file to write, such as "gait.npz"; an existing file is replaced.
        value: a scene of any kind, a state, a trajectory, a gait, branch, fit or optimum, any other
            result, an xarray dataset; or several of them in lists, tuples and dictionaries.

    Raises:
        ArgumentError: the file cannot be written; or a part has no import path, such as a lambda,
            or is not data.
        ResourceError: the disk is full or fails.

    Examples:
        >>> import jaxbiped as jb, tempfile, pathlib
        >>> path = pathlib.Path(tempfile.mkdtemp()) / "scene.npz"
        >>> jb.save(path, {"scene": jb.seed_scene(), "start": jb.seed_state()})
        >>> float(jb.load(path)["scene"].normal.K)
        1000000.0
    """
    file = check_writable_file("path", path)
    written = Encoder()
    try:
        tree = written.encode(value, "value")
    except RecursionError:
        raise ArgumentError("value is not allowed: it is nested too deeply.") from None
    own = {**provenance(), "user_code": source_digests(written.found.values())}
    contents = {"jaxbiped": FORMAT, "written_by": own, "value": tree}
    half = file.with_name(f".{file.name}.unfinished")
    try:
        with zipfile.ZipFile(half, "w", compresslevel=1) as archive:
            text = json.dumps(contents, allow_nan=False, indent=1)
            archive.writestr(_entry(_CONTENTS), text)
            for number, array in enumerate(written.arrays):
                bytes_ = io.BytesIO()
                np.lib.format.write_array(bytes_, array, allow_pickle=False)
                archive.writestr(_entry(f"{number}.npy"), bytes_.getvalue())
        half.replace(file)
    except OSError as error:
        why = (error.strerror or str(error)).lower()
        raise failure_kind(error)(f"path = {str(path)!r} cannot be written ({why}).") from None
    finally:
        half.unlink(missing_ok=True)


def load(path: str | Path) -> Any:
    """Loads what `save` wrote, with the same types and the same numbers.

    Classes of your own are imported from the module that defined them. A `RuntimeWarning` is issued
    if their source has changed. Because loading imports the modules that a file names, load only
    files that you trust.

    Args:
        path: the file.

    Returns:
        The value that was saved.

    Raises:
        ArgumentError: the file cannot be read, was not written by `save` or has another format; or
            one of its classes is not found or has other fields in this version.
    """
    try:
        with zipfile.ZipFile(user_path(path)) as archive:
            contents = json.loads(archive.read(_CONTENTS))
            if not isinstance(contents, dict) or "jaxbiped" not in contents:
                raise KeyError
            own = contents["written_by"]
            if contents["jaxbiped"] != FORMAT:
                raise ArgumentError(
                    f"the file has format {contents['jaxbiped']} of jaxbiped "
                    f"{own['version_jaxbiped']}, and this version reads format {FORMAT}."
                )
            read = Decoder(lambda number: _array(archive, number), own["version_jaxbiped"])
            value = read.decode(contents["value"])
    except OSError as error:
        why = (error.strerror or str(error)).lower()
        raise ArgumentError(f"path = {str(path)!r} cannot be read ({why}).") from None
    except (KeyError, TypeError, ValueError, zipfile.BadZipFile) as error:
        if isinstance(error, ArgumentError):
            raise ArgumentError(f"path = {str(path)!r} is not allowed here: {error}") from None
        raise ArgumentError(
            f"path = {str(path)!r} is not allowed: it must be a whole file of jaxbiped.save."
        ) from error
    before, now = own.get("user_code", {}), source_digests(read.found.values())
    changed = sorted(name for name in now if before.get(name) != now[name])
    if changed:
        warn(
            f"path = {str(path)!r} was saved with another source of {', '.join(changed)}: the "
            "numbers are the same, but what is computed from them may differ.",
        )
    return value


def _entry(name: str) -> zipfile.ZipInfo:
    entry = zipfile.ZipInfo(name, _BEGAN)
    entry.compress_type = zipfile.ZIP_DEFLATED
    return entry


def _array(archive: zipfile.ZipFile, number: int) -> np.ndarray:
    content = io.BytesIO(archive.read(f"{number:d}.npy"))
    return np.asarray(np.lib.format.read_array(content, allow_pickle=False))
