"""Nearness: which files of tests see a place of the package, the likeliest first.

Where the map of executed blocks was observed it says which do. Elsewhere names tell: the file that
mirrors the module, then files that name the function, its class or its module, then those that name
a function that calls it, over some calls. A name that many files have says little.
"""

import ast
import re
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path

from tests.mutants.drawing import Drawn
from tests.mutants.mutations import ROOT

_CALLS = 4
"""Over how many calls a test may reach a function that it does not name."""
_NAMES = 3
"""How many of the names that a file has count: the best."""
_OWN, _IMPORTED, _CALLED, _ALIKE, _FOLDER = 100.0, 3.0, 6.0, 1.0, 0.3
"""What the mirroring file is ahead of others, one that imports the module, one that mirrors a
caller's, one with a word of the module's name in its own, and those of the package's folder."""
_WORD = 5
"""Letters that words have in common that are forms of one."""
_NAME = re.compile(r"\b[A-Za-z_]\w+\b")


class Nearness:
    """Names of the package's functions and of the files of tests, read once."""

    def __init__(self, root: Path = ROOT) -> None:
        self._words = {
            path.relative_to(root).as_posix(): frozenset(_words_of(path, root))
            for path in sorted((root / "tests").rglob("test_*.py"))
            if "mutants" not in path.parts
        }
        self._shares: dict[str, int] = defaultdict(int)
        for words in self._words.values():
            for word in words:
                self._shares[word] += 1
        package = root / "jaxbiped"
        defined = {
            path.relative_to(package).as_posix(): list(_definitions(ast.parse(path.read_text())))
            for path in sorted(package.rglob("*.py"))
        }
        names = Counter(name for rows in defined.values() for name in {name for name, _ in rows})
        self._alone = {name for name, files in names.items() if files == 1}
        self._callers: dict[str, set[str]] = defaultdict(set)
        self._mirrors: dict[str, set[str]] = defaultdict(set)
        for file, rows in defined.items():
            for name, used in rows:
                self._mirrors[self._known_as(file, name)].add(_mirror(file))
                for word in used - {name}:
                    self._callers[self._known_as(file, word)].add(self._known_as(file, name))

    def _known_as(self, file: str, name: str) -> str:
        """A private name is its file's own, and so is one that several files have."""
        return name if name in self._alone and not name.startswith("_") else f"{file} {name}"

    def files(self, drawn: Drawn) -> list[str]:
        """Files of tests, the nearest first; those that nothing leads to are left out."""
        module = Path(drawn.file)
        folder = f"{(Path('tests') / module.parent).as_posix()}/"
        top = f"tests/{module.parts[0]}/"
        weights: dict[str, float] = {}
        mirrors: dict[str, float] = {}
        for name, weight in self._names(drawn).items():
            bare = name.rpartition(" ")[2]
            weights[bare] = max(weight, weights.get(bare, 0.0))
            for file in self._mirrors[name]:
                mirrors[file] = max(weight, mirrors.get(file, 0.0))
        scores: dict[str, float] = {}
        for file, words in self._words.items():
            worths = (w / self._shares[name] for name, w in weights.items() if name in words)
            score = sum(sorted(worths, reverse=True)[:_NAMES]) + _CALLED * mirrors.get(file, 0.0)
            score += _OWN * (file == _mirror(drawn.file)) + _IMPORTED * (module.stem in words)
            if file.startswith(top):
                score += _FOLDER * (1 + file.startswith(folder)) + _ALIKE * _alike(file, module)
            if score > 0.0:
                scores[file] = score
        return sorted(scores, key=lambda file: (-scores[file], file))

    def _names(self, drawn: Drawn) -> dict[str, float]:
        """Names that lead to a place, with what each is worth."""
        parts = [p for p in drawn.within.split(".") if p and not p.startswith("__")]
        layer = {
            self._known_as(drawn.file, n) for n in parts or re.findall(r"^\w+", drawn.statement)
        }
        weights, worth = dict.fromkeys(layer, 1.0), 1.0
        for _ in range(_CALLS):
            layer = {caller for name in layer for caller in self._callers[name]} - weights.keys()
            worth /= 3.0
            weights |= dict.fromkeys(layer, worth)
        return weights


def _mirror(file: str) -> str:
    """The file of tests that mirrors a module."""
    module = Path(file)
    return (Path("tests") / module.parent / f"test_{module.stem.lstrip('_')}.py").as_posix()


def _alike(file: str, module: Path) -> int:
    """How many words the names of a file of tests and of a module have in common."""
    tests, package = (
        {word[:_WORD] for word in Path(name).stem.split("_")} - {"", "test"}
        for name in (file, module.as_posix())
    )
    return len(tests & package)


def _words_of(path: Path, root: Path) -> set[str]:
    """The names in a file of tests, and in the helpers among the tests that it imports."""
    text = path.read_text()
    words = set(_NAME.findall(text))
    for module in re.findall(r"^from (tests[\w.]*) import", text, flags=re.MULTILINE):
        helper = root / (module.replace(".", "/") + ".py")
        words |= set(_NAME.findall(helper.read_text())) if helper.exists() else set()
    return words


def _definitions(tree: ast.Module) -> Iterator[tuple[str, set[str]]]:
    """The functions, classes and constants of a module, each with the names that it uses."""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name, _used(node)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            for target in targets:
                if isinstance(target, ast.Name):
                    yield target.id, _used(node)
        if isinstance(node, ast.ClassDef):
            for method in node.body:
                if isinstance(method, ast.FunctionDef) and not method.name.startswith("__"):
                    yield method.name, _used(method)


def _used(tree: ast.AST) -> set[str]:
    names = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    return names | {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
