"""Files of a store: made whole or not at all, and compared with what would go on in them."""

import contextlib
import glob
import json
import os
import shutil
import time
import uuid
import warnings
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jaxbiped._checks import ArgumentError
from jaxbiped._files import failure_kind, strict_json
from jaxbiped._identity import DECISIVE, difference_of
from jaxbiped._types import JsonObject
from jaxbiped.caching._disk_cache import ABANDONED

if TYPE_CHECKING:
    import xarray

SETTINGS = "settings"
"""Attribute that holds, as JSON, all that the labels depend on."""
GAITS = "gaits"
"""Of the settings, what a run finds for itself."""
_ALSO = "also_written_by"
"""Attribute that holds, as JSON, the provenance of all that wrote in it but the first."""
_CLOSE = 1e-6
"""Relative difference of two gaits' numbers that counts as none."""


def check_same(path: Path, settings: JsonObject, *, but: str = "") -> None:
    """Raises `ArgumentError` unless a store that is there was made with these settings."""
    import zarr

    try:
        group = zarr.open_group(str(path), mode="r", use_consolidated=False)
        stored = json.loads(str(group.attrs[SETTINGS]))
    except (KeyError, ValueError, zarr.errors.GroupNotFoundError, FileNotFoundError):
        raise ArgumentError(
            f"store = {str(path)!r} holds something else: it must be a new directory, or a store "
            "of the same sweep."
        ) from None
    here = json.loads(strict_json(settings))
    for each in (stored, here):
        each.pop(but, None)
    difference = difference_of(stored, here, alike=_is_close)
    if difference is not None:
        raise ArgumentError(
            f"store = {str(path)!r} was made with other settings: {difference}; give it those, or "
            "another store."
        )


def check_writers(path: Path, writer: Mapping[str, str], any_version: bool) -> dict[str, str]:
    """What a store that is there must note of a writer that is new to it; empty for a known one.

    Raises:
        ArgumentError: another version wrote there, and `any_version` does not allow that.
    """
    import zarr

    attributes = zarr.open_group(str(path), mode="r", use_consolidated=False).attrs
    here = {name: writer[name] for name in DECISIVE}
    others = json.loads(str(attributes.get(_ALSO, "[]")))
    known = [{name: each.get(name) for name in DECISIVE} for each in (attributes, *others)]
    difference = next((difference_of(each, here) for each in known if each != here), None)
    if difference is not None and not any_version:
        raise ArgumentError(
            f"store = {str(path)!r} was written by another version: {difference}; give it another "
            "store, or any_version=True (--any-version) to let the labels of both stand in it."
        )
    return {} if here in known else {_ALSO: json.dumps([*others, dict(writer)])}


def _is_close(old: Any, new: Any, name: str) -> bool:
    """Gaits are found anew by each run, to their tolerance."""
    numbers = isinstance(old, float) and isinstance(new, float)
    own = name.startswith("gaits")
    return numbers and own and abs(old - new) <= _CLOSE * max(1e-3, abs(old))


def check_store(path: Path) -> None:
    """Raises `ArgumentError` where no store can be made or continued at this path."""
    is_new(path)
    home = next(each for each in [path, *path.absolute().parents] if each.is_dir())
    if not os.access(home, os.W_OK | os.X_OK):
        raise ArgumentError(
            f"store = {str(path)!r} cannot be written: its folder must be writable."
        )


def open_store(path: Path) -> "xarray.Dataset":
    """The dataset of a store, read as it is needed."""
    import xarray

    return xarray.open_zarr(path, chunks=None)


@contextlib.contextmanager
def writing(path: Path) -> Iterator[None]:
    """Within, a disk that fails is told of in one sentence.

    Raises:
        ArgumentError: the store may not be written.
        ResourceError: its disk is full or fails.
    """
    try:
        yield
    except OSError as error:
        why = (error.strerror or str(error)).lower()
        raise failure_kind(error)(
            f"store = {str(path)!r} cannot be written ({why}): it must be a directory on a disk "
            "with room; the chunks that are complete stay."
        ) from None


def create_store(path: Path, write: Callable[[Path], object]) -> None:
    """A store that is complete in itself or not there at all.

    Where another client makes the same one meanwhile, that one stays.
    """
    half = path.with_name(f".{path.name}.{uuid.uuid4().hex}.unfinished")
    for left in path.parent.glob(f".{glob.escape(path.name)}.*unfinished"):
        if left.stat().st_mtime < time.time() - ABANDONED:
            shutil.rmtree(left, ignore_errors=True)
    try:
        half.parent.mkdir(parents=True, exist_ok=True)
        write(half)
        consolidate(half)
        with contextlib.suppress(OSError):
            path.rmdir()  # where it is there and empty
        try:
            half.rename(path)
        except OSError:
            if is_new(path):
                raise
    finally:
        shutil.rmtree(half, ignore_errors=True)


def consolidate(path: Path) -> None:
    """Lets `xarray.open_zarr` read all arrays' metadata at once, without a warning."""
    import zarr

    with warnings.catch_warnings():
        # Zarr's third format has no word on it yet.
        warnings.simplefilter("ignore")
        zarr.consolidate_metadata(str(path))


def is_new(path: Path) -> bool:
    """Whether nothing is there yet, or an empty directory.

    Raises:
        ArgumentError: a file is there.
    """
    if path.exists() and not path.is_dir():
        raise ArgumentError(f"store = {str(path)!r} is a file: it must be a directory.")
    return not path.exists() or not any(path.iterdir())
