"""Disk cache: what takes long to make, kept for the next process.

Some of it is run as code. So nothing is read that others could have written, and what is damaged is
made again.
"""

import contextlib
import hashlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

CACHE_VARIABLE = "JAXBIPED_CACHE"
"""Environment variable: the folder of the cache; empty for none."""
BYTES = 1 << 30
"""What the folder may hold; what was read or written longest ago goes first."""
KINDS = ("lanes", "programs", "xla")
"""Machine code of lanes, what goes with it, and programs compiled by XLA."""
_DIGEST = 32
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
    return Path(chosen) if chosen else None


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
    return content if hashlib.sha256(content).digest() == digest else None


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
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=".")
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(hashlib.sha256(content).digest() + content)
            os.replace(temporary, path)
        except BaseException:
            with contextlib.suppress(OSError):
                os.unlink(temporary)
            raise
        _prune(path.parent.parent)
    except OSError:
        return


def disk_use() -> dict[str, DiskUse]:
    """How much of each kind is kept."""
    sizes: dict[str, list[int]] = {kind: [] for kind in KINDS}
    folder = cache_folder()
    for stat, path in _files(folder) if folder is not None else ():
        sizes[path.parent.name].append(stat.st_size)
    return {kind: DiskUse(len(each), sum(each)) for kind, each in sizes.items()}


def clear_disk() -> DiskUse:
    """Removes all that is kept, and tells how much that was. Programs that run go on."""
    folder, removed = cache_folder(), [0, 0]
    for stat, path in list(_files(folder)) if folder is not None else ():
        with contextlib.suppress(OSError):
            path.unlink()
            removed = [removed[0] + 1, removed[1] + stat.st_size]
    return DiskUse(*removed)


def _path(kind: str, name: str) -> Path | None:
    assert kind in KINDS
    folder = cache_folder()
    return None if folder is None else folder / kind / name


def _is_own(path: Path) -> bool:
    """Whether nobody else can write there. Systems without owners have other guards."""
    if not hasattr(os, "geteuid"):
        return True
    stat = path.stat()
    return stat.st_uid == os.geteuid() and not stat.st_mode & _WRITABLE_BY_OTHERS


def _files(folder: Path) -> Iterator[tuple[os.stat_result, Path]]:
    """All that is kept; what was cut off while it was written, too."""
    for kind in KINDS:
        with contextlib.suppress(OSError), os.scandir(folder / kind) as entries:
            for entry in entries:
                with contextlib.suppress(OSError):
                    yield entry.stat(), Path(entry.path)


def _prune(folder: Path) -> None:
    """Removes what is too much for the disk: who misses it makes it again."""
    files = list(_files(folder))
    excess = sum(stat.st_size for stat, _ in files) - BYTES
    for stat, path in sorted(files, key=lambda file: file[0].st_mtime_ns):
        if excess <= 0:
            return
        path.unlink(missing_ok=True)
        excess -= stat.st_size
