"""Files of a store: made whole or not at all, and compared with what would go on in them.

A store lies in a directory, or at any address that zarr opens, such as s3://bucket/basin.zarr: a
path of the package universal-pathlib, over fsspec, which has the methods of `pathlib.Path`.
"""

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
from typing import TYPE_CHECKING, Any, cast

from jaxbiped._checks import ArgumentError, ResourceError
from jaxbiped._files import failure_kind, strict_json, user_path
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


def continue_store(
    path: Path,
    settings: JsonObject,
    writer: Mapping[str, str],
    *,
    any_version: bool,
    create: Callable[[Path], object],
) -> bool:
    """Makes a store, or goes on with one that the same settings made; returns whether it is new.

    Args:
        path: of the store's directory.
        settings: all that the results depend on.
        writer: the `provenance` of what is written; a new store says it of itself.
        any_version: whether to continue what another version, revision or user's code wrote. The
            store then says that this one wrote in it, too.
        create: writes a store without results at another path.

    Raises:
        ArgumentError: the directory holds something else, or a store made with other settings or by
            another version, or may not be written.
        ResourceError: its disk is full or fails.
    """
    with writing(path):
        new = is_new(path)
        if new:
            create_store(path, create)
        note(path, check_continued(path, settings, writer, any_version=any_version))
    return new


def check_continued(
    path: Path,
    settings: JsonObject,
    writer: Mapping[str, str],
    *,
    any_version: bool,
    but: str = "",
) -> dict[str, str]:
    """What a store that is there must note of a writer that is new to it; empty for a known one.

    Raises:
        ArgumentError: other settings than these made it, apart from the one named `but`; or another
            version wrote there, and `any_version` does not allow that.
    """
    import zarr

    try:
        attributes = zarr.open_group(str(path), mode="r", use_consolidated=False).attrs
        stored = json.loads(str(attributes[SETTINGS]))
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
    own = {name: writer[name] for name in DECISIVE}
    others = json.loads(str(attributes.get(_ALSO, "[]")))
    known = [{name: each.get(name) for name in DECISIVE} for each in (attributes, *others)]
    version = next((difference_of(each, own) for each in known if each != own), None)
    if version is not None and not any_version:
        raise ArgumentError(
            f"store = {str(path)!r} was written by another version: {version}; give it another "
            "store, or any_version=True (--any-version) to mix the labels of both."
        )
    return {} if own in known else {_ALSO: json.dumps([*others, dict(writer)])}


def _is_close(old: Any, new: Any, name: str) -> bool:
    """Gaits are found anew by each run, to their tolerance."""
    numbers = isinstance(old, float) and isinstance(new, float)
    own = name.startswith("gaits")
    return numbers and own and abs(old - new) <= _CLOSE * max(1e-3, abs(old))


def store_path(store: str | Path | None) -> Path | None:
    """The path that a user gives for a store, None for one in memory.

    Raises:
        ArgumentError: no path, a kind of address that nothing here opens, or a place where no store
            can be made or continued.
        ResourceError: a package that is missing for it, or a disk that fails.
    """
    if store is None:
        return None
    text = str(store)
    remote = "://" in text and not text.startswith("file:")
    path = _remote_path(text) if remote else user_path(store, "store").absolute()
    with writing(path):
        is_new(path)
    home = next(each for each in [path, *path.parents] if remote or each.is_dir())
    if not remote and not os.access(home, os.W_OK | os.X_OK):
        raise ArgumentError(
            f"store = {str(path)!r} cannot be written: its folder must be writable."
        )
    return path


def _remote_path(text: str) -> Path:
    """The path of an address; raises as `store_path`."""
    try:
        from upath import UPath

        address: Any = UPath(text, use_listings_cache=False)
        _ = address.fs  # imports its driver
    except ImportError:
        raise ResourceError(
            f"store = {text!r} needs a package that is missing: pip install jaxbiped[s3], or the "
            "package of fsspec for another kind of address."
        ) from None
    except ValueError:
        raise ArgumentError(
            f"store = {text!r} is not allowed: it must be a directory, or an address that fsspec "
            "opens, such as s3://bucket/basin.zarr."
        ) from None
    return cast("Path", address)


def what_is_kept(path: Path | None) -> str:
    """What an interrupt leaves of a sweep, in words."""
    if path is None:
        return "without a store nothing is kept"
    return f"what is done is in {path.name!r}, where the same call continues"


def open_store(path: Path) -> "xarray.Dataset":
    """The dataset of a store, read as it is needed."""
    import xarray

    return xarray.open_zarr(str(path), chunks=None)


@contextlib.contextmanager
def writing(path: Path) -> Iterator[None]:
    """Within, a disk that fails is told of in one sentence, and chunks are written whatever they
    hold: one that is not there was lost.

    Raises:
        ArgumentError: the store may not be written.
        ResourceError: its disk is full or fails.
    """
    import zarr

    try:
        with zarr.config.set({"array.write_empty_chunks": True}):
            yield
    except Exception as error:
        of_service = is_remote(path) and type(error).__module__.partition(".")[0] in _CLIENTS
        if not isinstance(error, OSError) and not of_service:
            raise
        why = (getattr(error, "strerror", None) or str(error)).lower().rstrip(".")
        kind = failure_kind(error) if isinstance(error, OSError) else ResourceError
        where = "an address that may be written" if is_remote(path) else "a directory on a disk"
        raise kind(
            f"store = {str(path)!r} cannot be written ({why}): it must be {where} with room; the "
            "chunks that are complete stay."
        ) from None


def create_store(path: Path, write: Callable[[Path], object]) -> None:
    """A store that is complete in itself or not there at all.

    Where another client makes the same one meanwhile, that one stays.
    """
    half = path.with_name(f".{path.name}.{uuid.uuid4().hex}.unfinished")
    unfinished = f".{glob.escape(path.name)}.*unfinished"
    for left in () if is_remote(path) else path.parent.glob(unfinished):
        if left.stat().st_mtime < time.time() - ABANDONED:
            remove_store(left)
    try:
        if not is_remote(half):  # else a bucket would be made
            half.parent.mkdir(parents=True, exist_ok=True)
        write(half)
        consolidate(half)
        with contextlib.suppress(OSError):
            path.rmdir()  # where it is there and empty
        try:
            move_store(half, path)
        except OSError:
            if is_new(path):
                raise
    finally:
        remove_store(half)


def note(path: Path, attributes: Mapping[str, str | float]) -> None:
    import zarr

    if attributes:
        zarr.open_group(str(path), mode="r+", use_consolidated=False).attrs.update(dict(attributes))
        consolidate(path)


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


_CLIENTS = ("botocore", "aiobotocore", "aiohttp", "google", "gcsfs", "azure", "adlfs", "fsspec")
"""Packages whose errors are those of a service."""


def is_remote(path: Path) -> bool:
    return not isinstance(path, Path)


def move_store(half: Path, path: Path) -> None:
    """Moves a store that is complete; raises `OSError` where a directory is there already.

    An object store has no rename: what makes a group of it, its own metadata, is copied last.
    """
    if not is_remote(half):
        half.rename(path)
        return
    files = cast("Any", half).fs
    found = files.find(str(half))
    own = files._strip_protocol(str(half))
    for file in sorted(found, key=lambda each: each == f"{own}/zarr.json"):
        files.copy(file, files._strip_protocol(str(path)) + file.removeprefix(own))


def remove_store(path: Path) -> None:
    """Removes what is left of a store that was not completed, if anything is."""
    if not is_remote(path):
        shutil.rmtree(path, ignore_errors=True)
    elif path.exists():
        cast("Any", path).fs.rm(str(path), recursive=True)
