"""Saving and loading: scenes and results in one file, to the last bit, and no code in it.

A file is a ZIP archive, which NumPy opens, too: what hangs together how in `contents.json`, and
every array in a `.npy` of its own. A module, a named tuple or an enumeration stands there by the
import path of its class and the values of its fields; nothing is pickled.
"""

import io
import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from jaxbiped._checks import ArgumentError, warn
from jaxbiped._encoding import Decoder, Encoder
from jaxbiped._files import check_writable_file, failure_kind, user_path
from jaxbiped._identity import provenance, source_digests

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
