"""Disk cache: what takes long to make, kept for the next process.

Some of it is run as code. So nothing is read that others could have written, and what is damaged is
made again.
"""

import contextlib
import hashlib
import os
import pickle
import stat
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

_T = TypeVar("_T")

CACHE_VARIABLE = "JAXBIPED_CACHE"
"""Environment variable: the folder of the cache; empty for none."""
BYTES = 1 << 30
"""What the folder may hold; what was read or written longest ago goes first."""
KINDS = ("lanes", "programs", "sources", "xla", "host")
"""Machine code of lanes, what goes with it, digests of the package's source, programs compiled by
XLA, and those of the host."""
ABANDONED = 3600.0
"""Age [s] from which a temporary file is one that a killed process left."""
_DIGEST = 32
_TEMPORARY = "."
"""What their names begin with; no entry's does."""
_WRITABLE_BY_OTHERS = 0o022


class DiskUse(NamedTuple):
    """How much of one kind there is.

    Attributes:
        entries: how many.
        size: their bytes.
    """

    entries: int
    size: int


def cache_folder() -> Path | None:
    """Where things are kept: safe to delete at any time."""
    chosen = os.environ.get(CACHE_VARIABLE)
    if chosen is None:
        base = os.environ.get("XDG_CACHE_HOME")
        return (Path(base) if base else Path.home() / ".cache") / "jaxbiped"
    return Path(chosen).expanduser() if chosen else None


def read_entry(kind: str, name: str) -> bytes | None:
    """What was kept; None where there is none, it is damaged, or others can write to it."""
    path = _path(kind, name)
    if path is None:
        return None
    try:
        if not (_is_own(path.parent.parent) and _is_own(path.parent) and _is_own(path)):
            return None
        whole = path.read_bytes()
        os.utime(path)
    except OSError:
        return None
    digest, content = whole[:_DIGEST], whole[_DIGEST:]
    return content if _digest(kind, name, content) == digest else None


def write_entry(kind: str, name: str, content: bytes) -> None:
    """Keeps it, whole or not at all; without a place to keep it there is no harm."""
    path = _path(kind, name)
    if path is None:
        return
    try:
        for folder in (path.parent.parent, path.parent):
            folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            if not _is_own(folder):
                os.chmod(folder, 0o700)
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=_TEMPORARY)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(_digest(kind, name, content) + content)
            os.replace(temporary, path)
        except BaseException:
            with contextlib.suppress(OSError):
                os.unlink(temporary)
            raise
        _prune(path.parent.parent)
    except OSError:
        return


def read_object(kind: str, name: str, load: Callable[..., _T | None]) -> _T | None:
    """What `load` makes of the parts that were kept; None where there are none it can use."""
    content = read_entry(kind, name)
    if content is not None:
        with contextlib.suppress(Exception):  # whatever is amiss with them, they are made again
            return load(*pickle.loads(content))
    return None


def write_object(kind: str, name: str, *parts: Any) -> None:
    """Keeps these, unless they cannot be pickled."""
    with contextlib.suppress(Exception):
        write_entry(kind, name, pickle.dumps(parts))


def disk_use() -> dict[str, DiskUse]:
    """How much of each kind is kept."""
    sizes: dict[str, list[int]] = {kind: [] for kind in KINDS}
    folder = cache_folder()
    for status, path in _files(folder) if folder is not None else ():
        sizes[path.parent.name].append(status.st_size)
    return {kind: DiskUse(len(each), sum(each)) for kind, each in sizes.items()}


def clear_disk() -> DiskUse:
    """Removes all that is kept, and tells how much that was. Programs that run go on."""
    folder, removed = cache_folder(), [0, 0]
    for status, path in list(_files(folder)) if folder is not None else ():
        with contextlib.suppress(OSError):
            path.unlink()
            removed = [removed[0] + 1, removed[1] + status.st_size]
    return DiskUse(*removed)


def _path(kind: str, name: str) -> Path | None:
    assert kind in KINDS
    folder = cache_folder()
    return None if folder is None else folder / kind / name


def _digest(kind: str, name: str, content: bytes) -> bytes:
    """Of an entry with its place: undamaged content under another's name is no entry either."""
    return hashlib.sha256(f"{kind}/{name}\0".encode() + content).digest()


def _is_own(path: Path) -> bool:
    """Whether nobody else can write there. Systems without owners have other guards."""
    if not hasattr(os, "geteuid"):
        return True
    status = path.stat()
    return status.st_uid == os.geteuid() and not status.st_mode & _WRITABLE_BY_OTHERS


def _files(folder: Path) -> Iterator[tuple[os.stat_result, Path]]:
    """All that is kept; what was cut off while it was written, too."""
    for kind in KINDS:
        with contextlib.suppress(OSError), os.scandir(folder / kind) as entries:
            for entry in entries:
                with contextlib.suppress(OSError):
                    status = entry.stat()
                    if stat.S_ISREG(status.st_mode):
                        yield status, Path(entry.path)


def _prune(folder: Path) -> None:
    """Removes what killed processes left, and what is too much for the disk.

    Who misses an entry makes it again.
    """
    kept, oldest = [], time.time() - ABANDONED
    for status, path in _files(folder):
        if path.name.startswith(_TEMPORARY) and status.st_mtime < oldest:
            path.unlink(missing_ok=True)
        else:
            kept.append((status, path))
    excess = sum(status.st_size for status, _ in kept) - BYTES
    for status, path in sorted(kept, key=lambda file: file[0].st_mtime_ns):
        if excess <= 0:
            return
        path.unlink(missing_ok=True)
        excess -= status.st_size
