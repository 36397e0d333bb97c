"""Files and the environment: paths and numbers that a user gives there, checked; strict JSON."""

import errno
import json
import math
import os
import urllib.parse
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeAlias

from jaxbiped._checks import ArgumentError, ResourceError

CACHE_BYTES_VARIABLE = "JAXBIPED_CACHE_BYTES"
"""Bytes for records of simulations and for buffers; 0 to keep none."""
THREADS_VARIABLE = "JAXBIPED_THREADS"
"""Threads to use, else as many as the process has cores."""
VECTOR_VARIABLE = "JAXBIPED_VECTOR_BITS"
"""The bits of a vector where the CPU has as many or more."""
_ALLOWED: dict[str, tuple[str, Callable[[int], bool]]] = {
    CACHE_BYTES_VARIABLE: ("a whole number of bytes, 0 to keep none", lambda n: True),
    THREADS_VARIABLE: ("a whole number of threads above 0", lambda n: n > 0),
    VECTOR_VARIABLE: ("128, 256 or 512", (128, 256, 512).__contains__),
}


JsonObject: TypeAlias = dict[str, Any]
"""Numbers and words by name, ready for JSON: what a command writes, settings of a store."""
_WRONG_PATH = ("EACCES", "EPERM", "EROFS", "ENOENT", "EEXIST", "ENOTDIR", "EISDIR", "ENAMETOOLONG")
"""Errors of a file system where another path would do; any other is the disk's own."""


def failure_kind(error: OSError) -> type[ArgumentError] | type[ResourceError]:
    """Whether a path that cannot be written is to blame itself, or what it lies on."""
    # Clients of object stores give the kind alone, without a number.
    wrong = errno.errorcode.get(error.errno or 0) in _WRONG_PATH or (
        error.errno is None and isinstance(error, FileNotFoundError | PermissionError)
    )
    return ArgumentError if wrong else ResourceError


def user_path(path: str | Path, name: str = "path") -> Path:
    """A path as the user means it: "~" is the home folder, and file:///FOLDER an address of it.

    Raises:
        ArgumentError: no path, a home folder that is not known, or a file of another machine.
    """
    try:
        text = os.fspath(path)
        if text[:5] == "file:":
            address = text[5:].removeprefix("//localhost").removeprefix("//")
            if text[5:7] == "//" and address[:1] != "/":
                raise RuntimeError("an address of a file begins with file:///")
            return Path(urllib.parse.unquote(address))
        return Path(path).expanduser()
    except (TypeError, RuntimeError) as error:
        raise ArgumentError(f"{name} = {path!r} is not allowed: {error}.") from None


def read_text(name: str, path: str | Path) -> str:
    """What a text file holds; raises `ArgumentError` for one that cannot be read."""
    try:
        return user_path(path, name).read_text(encoding="utf-8-sig")
    except OSError as error:
        reason = (error.strerror or "unreadable").lower()
        raise ArgumentError(f"{name} = {str(path)!r} cannot be read ({reason}).") from None
    except UnicodeDecodeError:
        raise ArgumentError(f"{name} = {str(path)!r} is not a text in UTF-8.") from None


def read_json(name: str, path: str | Path) -> Any:
    """What a JSON file holds; raises `ArgumentError` for one that cannot be read or is no JSON."""
    text = read_text(name, path)
    try:
        return json.loads(text)
    except ValueError as error:
        raise ArgumentError(f"{name} = {str(path)!r} is not JSON ({error}).") from None


def read_csv(name: str, path: str | Path) -> list[tuple[int, list[str]]]:
    """Rows of a CSV file, the header first: the line of each and its cells.

    Lines that begin with # are left out, and so are rows of empty cells, and empty columns without
    a name. Raises `ArgumentError` for a file that is none, by the line.
    """
    import csv

    file = f"{name} = {str(path)!r}"
    lines = read_text(name, path).splitlines()
    reader = csv.reader("" if line.lstrip().startswith("#") else line for line in lines)
    table = [(reader.line_num, [cell.strip() for cell in cells]) for cells in reader]
    rows = [(line, cells) for line, cells in table if any(cells)]
    if len(rows) < 2:
        raise ArgumentError(f"{file} is not allowed: it must have a header and at least one row.")
    header = rows[0][1]
    named = [k for k, cell in enumerate(header) if cell]
    for line, cells in rows:
        unlike = len(cells) <= named[-1] or any(x for k, x in enumerate(cells) if k not in named)
        if unlike or (len(named) == 1 and {";", "\t"} & set(header[named[0]])):
            raise ArgumentError(
                f"{file}: line {line} has {len(cells)} cells, and the header {len(header)}: "
                "separate them by commas, and write numbers with a point."
            )
    return [(line, [cells[k] for k in named]) for line, cells in rows]


def check_writable_directory(name: str, path: Path) -> None:
    """Creates the directory if need be; raises where files cannot be written.

    Raises:
        ArgumentError: the path is not allowed.
        ResourceError: its disk is full or fails.
    """
    allowed = "it must be a directory in which files can be written"
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = (error.strerror or "cannot be made").lower()
        raise failure_kind(error)(
            f"{name} = {str(path)!r} is not allowed ({reason}): {allowed}."
        ) from None
    if not os.access(path, os.W_OK | os.X_OK):
        raise ArgumentError(f"{name} = {str(path)!r} is not allowed (not writable): {allowed}.")


def check_writable_file(name: str, path: str | Path) -> Path:
    """The path, "~" expanded; raises `ArgumentError` where no such file can be written."""
    path = user_path(path, name)
    if path.is_dir():
        raise ArgumentError(f"{name} = {str(path)!r} is a directory: it must be a file to write.")
    parent = path.parent
    if not parent.is_dir() or not os.access(path if path.exists() else parent, os.W_OK):
        raise ArgumentError(
            f"{name} = {str(path)!r} cannot be written: its folder must exist and be writable."
        )
    return path


def strict_json(
    value: object, *, indent: int | None = None, unknown: Callable[[float], Any] = lambda _: None
) -> str:
    """A value as JSON.

    Args:
        value: plain values, complex ones as pairs of their parts, arrays and numbers of NumPy, in
            mappings and sequences.
        indent: indent of each level. Default: everything on one line.
        unknown: value in place of numbers that are not finite. Default: null.

    Returns:
        The text, without a line's end.
    """
    plain = _plain(value, unknown)
    return json.dumps(plain, indent=indent, ensure_ascii=False, allow_nan=False)


def _plain(value: Any, unknown: Callable[[float], Any]) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(each, unknown) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each, unknown) for each in value]
    if hasattr(value, "tolist"):
        return _plain(value.tolist(), unknown)
    if isinstance(value, complex):
        known = math.isfinite(value.real) and math.isfinite(value.imag)
        return _plain([value.real, value.imag] if known else [math.nan, math.nan], unknown)
    if isinstance(value, float) and not math.isfinite(value):
        return unknown(value)
    return value


def environment_number(name: str) -> int | None:
    """The whole number that a variable holds, None where it is not set or empty.

    Raises:
        ArgumentError: it holds something else.
    """
    text, (allowed, test) = os.environ.get(name, "").strip(), _ALLOWED[name]
    if text and not (text.isdecimal() and test(int(text))):
        raise ArgumentError(f"{name} = {text!r} in the environment: it must be {allowed}.")
    return int(text) if text else None


def check_environment() -> None:
    """Raises `ArgumentError` for a variable that is not understood."""
    for name in _ALLOWED:
        environment_number(name)
