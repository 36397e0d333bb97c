"""Source digest: what the package's code says, without what only people read.

A kept program depends on the module in which a function of it is defined, and on all that the
imports of this module lead to. Modules are digested as syntax trees, without comments, docstrings
and layout. So a change in another layer, or of words, leaves every program where it is found.
"""

import ast
import hashlib
import importlib.util
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from jaxbiped.caching._disk_cache import read_object, write_object

_KIND = "sources"
_SETTLED = 1_000_000_000
"""Age [ns] from which a file is sure to have another stamp when it changes again."""


class _Module(NamedTuple):
    """What is known of a file.

    Attributes:
        stamp: of the file that was read.
        digest: of its code.
        imports: what it imports from the package, as a module and a name in it; no name where the
            module itself is imported.
    """

    stamp: list[int]
    digest: str
    imports: list[tuple[str, str]]


class SourceDigests:
    """Digests of the modules of a package, each with all that its imports lead to."""

    def __init__(self, folder: Path, *, loaded: int) -> None:
        """`folder` is the package's; it was imported at `loaded` [ns since the epoch]."""
        self._package, self._loaded = folder.name, loaded
        self._entry = hashlib.sha256(f"{folder.resolve()}\n{sys.version}".encode()).hexdigest()
        self._paths = {_module_of(path, folder): path for path in folder.rglob("*.py")}
        self._known: dict[str, _Module] = read_object(_KIND, self._entry, dict) or {}
        self._digests = dict[str, str]()
        self._current, self._unsaved = set[str](), False
        self._lock = threading.Lock()

    def digest(self, module: str) -> str:
        """Of a module's code and the code that it can reach.

        Raises:
            LookupError: there is none, or a file changed after the package was imported: what
                this process runs may be another one.
        """
        with self._lock:
            if module not in self._digests:
                reached = self._reachable(module)
                self._save()
                parts = "\n".join(f"{name} {self._known[name].digest}" for name in sorted(reached))
                self._digests[module] = hashlib.sha256(parts.encode()).hexdigest()
            return self._digests[module]

    def reached(self, module: str) -> set[str]:
        """A module with those that its imports, and the packages that it lies in, lead to."""
        with self._lock:
            return self._reachable(module)

    def _reachable(self, module: str) -> set[str]:
        reached, waiting = set[str](), [module]
        while waiting:
            name = waiting.pop()
            if name in reached:
                continue
            reached.add(name)
            for imported in self._of(name).imports:
                waiting.extend(self._led_to(*imported))
            # A package may fill the tables of its modules: functions that tell classes apart.
            package = name.rpartition(".")[0]
            waiting.extend([package] if package else [])
        return reached

    def _led_to(self, module: str, name: str) -> Iterator[str]:
        """The modules that an import may lead to."""
        whole = f"{module}.{name}"
        if whole in self._paths:
            yield from (module, *self._under(whole))
        elif not name or module == self._package:
            yield from self._under(module)  # any attribute of it
        else:
            yield module

    def _under(self, name: str) -> Iterator[str]:
        """A module, and all that lie in it where it is a package."""
        return (each for each in self._paths if f"{each}.".startswith(f"{name}."))

    def _of(self, name: str) -> _Module:
        """What is known of a module, read again where it changed."""
        known = self._known.get(name)
        if known is not None and name in self._current:
            return known
        try:
            path = self._paths[name]
            status = path.stat()
            stamp = [status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino]
            if status.st_ctime_ns > self._loaded:
                raise LookupError(f"{path} changed after it was imported")
            if known is None or known.stamp != stamp:
                known = _Module(stamp, *_read_module(path, name, self._package))
                self._known[name], self._unsaved = known, True
        except (OSError, SyntaxError, UnicodeDecodeError) as cause:
            raise LookupError(f"the source of {name} cannot be read") from cause
        self._current.add(name)
        return known

    def _save(self) -> None:
        if self._unsaved:
            before = time.time_ns() - _SETTLED
            found = {name: each for name, each in self._known.items() if each.stamp[2] < before}
            write_object(_KIND, self._entry, found)
            self._unsaved = False


def _module_of(path: Path, folder: Path) -> str:
    parts = (folder.name, *path.relative_to(folder).with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _read_module(path: Path, name: str, package: str) -> tuple[str, list[tuple[str, str]]]:
    """Its code's digest, and what it imports from the package."""
    tree = ast.parse(path.read_bytes())
    own = name if path.name == "__init__.py" else name.rpartition(".")[0]
    found = {each for node in _statements(tree) for each in _imports(node, own)}
    imports = sorted(each for each in found if each[0].split(".")[0] == package)
    return hashlib.sha256(ast.dump(tree).encode()).hexdigest(), imports


def _statements(tree: ast.AST) -> Iterator[ast.stmt]:
    """All statements in a tree, from which it takes those that are only a string."""
    for field in ("body", "orelse", "finalbody", "handlers", "cases"):
        nodes = getattr(tree, field, None)
        if not isinstance(nodes, list):
            continue
        nodes[:] = [node for node in nodes if not _is_string(node)]
        for node in nodes:
            if isinstance(node, ast.stmt):
                yield node
            yield from _statements(node)


def _is_string(node: ast.AST) -> bool:
    """Whether it is a docstring, or one below an attribute."""
    if not (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)):
        return False
    return isinstance(node.value.value, str)


def _imports(node: ast.stmt, own: str) -> Iterator[tuple[str, str]]:
    """What a statement in the package `own` imports."""
    if isinstance(node, ast.Import):
        for alias in node.names:
            yield alias.name, ""
    elif isinstance(node, ast.ImportFrom):
        dots = "." * node.level
        module = importlib.util.resolve_name(dots + (node.module or ""), own)
        for alias in node.names:
            yield module, alias.name
