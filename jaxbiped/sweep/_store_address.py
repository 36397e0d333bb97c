"""Address of a store: a directory, or any address that zarr opens, such as s3://bucket/basin.zarr.

Elsewhere than on a disk an address is a path of the package universal-pathlib, over fsspec: it has
the methods of `pathlib.Path`, so that stores know no difference but for what is here.
"""

import os
import shutil
from pathlib import Path
from typing import Any, cast

from jaxbiped._checks import ArgumentError, ResourceError
from jaxbiped._files import user_path

_CLIENTS = ("botocore", "aiobotocore", "aiohttp", "google", "gcsfs", "azure", "adlfs", "fsspec")
"""Packages whose errors are those of a service."""


def store_address(store: str | Path) -> Path:
    """The path that a user gives for a store.

    Raises:
        ArgumentError: no path, or a kind of address that nothing here opens.
        ResourceError: a package that is missing for it.
    """
    text = str(store)
    if "://" not in text:
        return user_path(store, "store").absolute()
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


def is_remote(path: Path) -> bool:
    """Whether a store lies elsewhere than on a disk."""
    return not isinstance(path, Path)


def is_of_service(error: Exception) -> bool:
    """Whether an error is one of the service that an address belongs to."""
    return type(error).__module__.partition(".")[0] in _CLIENTS


def is_writable(path: Path) -> bool:
    """Whether a store can be made or continued here, as far as can be told beforehand."""
    if is_remote(path):
        return True
    home = next(each for each in [path, *path.absolute().parents] if each.is_dir())
    return os.access(home, os.W_OK | os.X_OK)


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
