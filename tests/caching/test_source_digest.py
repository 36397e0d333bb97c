"""Source digests: held against what Python imports, and against copies of the package, edited."""

import ast
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

import jaxbiped as jb
from jaxbiped.caching import _fingerprint
from jaxbiped.caching._fingerprint import SourceDigests

PACKAGE = Path(jb.__file__).parent
LATER = time.time_ns() + 10**15

COULOMB = "scene/laws/friction/_coulomb.py"
WORDS = {
    "comment in a figure": ("plot/style.py", "import re\n", "import re  # of any kind\n"),
    "line above functions": ("gait/_find_gait.py", "import jax\n", "import jax\n\n# A word.\n"),
    "docstring": ("dynamics/_stance_motion.py", "rolls without slip", "rolls and does not slip"),
    "new docstring": (COULOMB, "switches(self, slip_speed: Scalar) -> tuple[Scalar, ...]:",
                      "switches(self, slip_speed: Scalar) -> tuple[Scalar, ...]:\n        'None.'"),
    "attribute's docstring": ("hybrid/_endings.py", "Rate of a leg at rest",
                              "A resting leg's rate"),
    "layout": ("hybrid/_endings.py", "_LOST_RATE = 0.1", "_LOST_RATE = (\n    0.10\n)"),
}  # fmt: skip
CODE = {
    "sign of a law": (COULOMB, "return -self.mu", "return self.mu"),
    "constant": ("hybrid/_endings.py", "_LOST_RATE = 0.1", "_LOST_RATE = 0.2"),
    "string": ("gait/_find_gait.py", '"newton"', '"newtons"'),
    "registered for a class": (
        "hybrid/_walker_systems.py",
        "return _REDUNDANT_WALKING",
        "return _WALKING",
    ),
    "compiler": ("compiler/ir/_liveness.py", "value.op in", "value.op not in"),
    "how programs are kept": ("caching/_cached_jit.py", '_KIND = "xla"', '_KIND = "lax"'),
    "what laws there are": ("scene/laws/__init__.py", "Tsuji as Tsuji", "Tsuji as Fuji"),
}
ELSEWHERE = {
    "plot": ("plot/style.py", '"#0072B2"', '"#0072B3"'),
    "sweep": ("sweep/_labelling.py", "\nimport", "\nimport sys as _\nimport"),
    "cli": ("cli/__init__.py", "import io", "import io as _io"),
}
_SEED = jb.seed_scene()
MODULES = {
    "gait": {jb.find_gait.__module__},
    "scene": {
        type(part).__module__
        for part in (_SEED, _SEED.walker, _SEED.normal, _SEED.friction, _SEED.clearance)
    },
    "figure": {jb.plot.basin.__module__},
}
"""Modules that define what a program is made of."""


@pytest.fixture(scope="module")
def copied(tmp_path_factory):
    folder = tmp_path_factory.mktemp("copied") / PACKAGE.name
    shutil.copytree(PACKAGE, folder, ignore=shutil.ignore_patterns("__pycache__", "assets"))
    return folder


@pytest.fixture
def keys(copied, monkeypatch, tmp_path):
    """Digests behind the programs, were the package the copy; an edit of it may be given."""
    monkeypatch.setenv("JAXBIPED_CACHE", str(tmp_path / "cache"))

    def found(file=None, old="", new=""):
        whole = None
        if file is not None:
            path = copied / file
            whole = path.read_text()
            assert old in whole, "the test's edit has no place any more"
            path.write_text(whole.replace(old, new, 1))
        try:
            digests = SourceDigests(copied, loaded=LATER)
            return {name: set(map(digests.digest, modules)) for name, modules in MODULES.items()}
        finally:
            if whole is not None:
                path.write_text(whole)

    return found


def test_words_change_no_key(keys):
    before = keys()
    for name, edit in WORDS.items():
        assert keys(*edit) == before, name


def test_code_that_a_program_can_reach_changes_its_key(keys):
    before = keys()
    for name, edit in CODE.items():
        assert keys(*edit)["gait"] != before["gait"], name


def test_code_of_other_layers_changes_no_key(keys):
    """Figures see all layers but the command line."""
    before = keys()
    for name, edit in ELSEWHERE.items():
        after = keys(*edit)
        assert (after["gait"], after["scene"]) == (before["gait"], before["scene"]), name
        assert (after["figure"] == before["figure"]) == (name == "cli"), name
    solve = keys(*CODE["constant"])
    assert solve["scene"] == before["scene"]
    assert keys(*CODE["sign of a law"])["scene"] != before["scene"]


def test_it_reaches_all_that_python_imports():
    module = "jaxbiped.optimise._design_gaits"
    code = f"import {module}, sys; print(*sys.modules)"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    imported = {name for name in told.stdout.split() if name.startswith("jaxbiped")}
    assert module in imported
    reached = SourceDigests(PACKAGE, loaded=LATER).reached(module)
    assert imported <= reached
    assert "jaxbiped.plot" not in reached


def test_who_reaches_a_table_of_functions_reaches_those_that_are_put_there():
    """A function registered for a class is called without being imported.

    One for a class of its own module is known by that class, which is among the arguments.
    """
    digests, registered = SourceDigests(PACKAGE, loaded=LATER), []
    for path in PACKAGE.rglob("*.py"):
        tree = ast.parse(path.read_text())
        homes = {
            alias.asname or alias.name: node.module
            for node in ast.walk(tree)
            if isinstance(node, ast.ImportFrom)
            for alias in node.names
        }
        defined = {node.name for node in ast.walk(tree) if isinstance(node, ast.ClassDef)}
        for node in ast.walk(tree):
            for each in map(ast.unparse, getattr(node, "decorator_list", [])):
                if ".register" in each and ast.unparse(node.args.args[0].annotation) not in defined:
                    module = ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts)
                    registered.append(module)
                    assert module in digests.reached(homes.get(each.split(".")[0], module))
    assert "jaxbiped.hybrid._walker_systems" in registered


def _package(folder, **modules):
    folder.mkdir()
    for name, text in {"__init__": "", **modules}.items():
        path = folder.joinpath(*name.split("__in__")).with_suffix(".py")
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
    return folder


@pytest.mark.parametrize(
    "imports",
    [
        "from walks import far",
        "from walks.far import near",
        "from . import far",
        "import walks.far",
        "import walks",
        "from walks import anything",
        "def late():\n    if True:\n        from walks.far import near",
        "try:\n    pass\nexcept OSError:\n    import walks.far as f",
    ],
)
def test_imports_of_all_kinds_are_followed(tmp_path, imports, monkeypatch):
    monkeypatch.setenv("JAXBIPED_CACHE", "")
    folder = _package(
        tmp_path / "walks", own=imports, far="near = 1", other="from walks import far"
    )
    reached = SourceDigests(folder, loaded=LATER).reached("walks.own")
    assert {"walks", "walks.own", "walks.far"} <= reached
    assert ("walks.other" in reached) == (imports in ("import walks", "from walks import anything"))


@pytest.mark.parametrize(
    ("imports", "all_of_it"),
    [
        ("import walks.far", True),
        ("from walks import far", True),
        ("from walks.far import n", False),
    ],
)
def test_an_attribute_of_an_imported_package_may_be_any_module_in_it(
    tmp_path, imports, all_of_it, monkeypatch
):
    """A name taken from it is one of its names, which its statements lead to."""
    monkeypatch.setenv("JAXBIPED_CACHE", "")
    modules = {"far__in____init__": "n = 1", "far__in__deep": "", "other": ""}
    folder = _package(tmp_path / "walks", own=imports, **modules)
    reached = SourceDigests(folder, loaded=LATER).reached("walks.own")
    deep = {"walks.far.deep"} if all_of_it else set()
    assert reached == {"walks", "walks.own", "walks.far"} | deep


def test_the_next_process_reads_only_what_changed(tmp_path, monkeypatch):
    monkeypatch.setenv("JAXBIPED_CACHE", str(tmp_path / "cache"))
    folder = _package(tmp_path / "walks", own="from walks import far", far="near = 1")
    time.sleep(1.1)  # until the files are settled
    read, read_module = [], _fingerprint._read_module

    def digest():
        read.clear()
        return SourceDigests(folder, loaded=LATER).digest("walks.own")

    def noted(path, name, package):
        read.append(name)
        return read_module(path, name, package)

    monkeypatch.setattr(_fingerprint, "_read_module", noted)
    first = digest()
    assert sorted(read) == ["walks", "walks.far", "walks.own"]
    assert digest() == first
    assert read == []
    # Another file of the same size and date, as installers make them.
    status = (folder / "far.py").stat()
    (folder / "far.py").write_text("near = 2")
    os.utime(folder / "far.py", ns=(status.st_atime_ns, status.st_mtime_ns))
    assert digest() != first
    assert read == ["walks.far"]


def test_a_file_that_has_just_changed_is_read_again(tmp_path, monkeypatch):
    """Its next change may leave it the same stamp: clocks of file systems are coarse."""
    monkeypatch.setenv("JAXBIPED_CACHE", str(tmp_path / "cache"))
    for attempt in range(20):  # the machine may be busy elsewhere
        began = time.monotonic()
        folder = _package(tmp_path / f"walks{attempt}", own="")
        SourceDigests(folder, loaded=LATER).digest(f"{folder.name}.own")
        known = SourceDigests(folder, loaded=LATER)._known
        if time.monotonic() < began + 0.9:
            break
    assert known == {}


def test_what_changed_after_it_was_imported_has_none(tmp_path, monkeypatch):
    """The process may run the code that was there before."""
    monkeypatch.setenv("JAXBIPED_CACHE", "")
    folder = _package(tmp_path / "walks", own="from walks import far", far="")
    loaded = (folder / "own.py").stat().st_ctime_ns
    while (folder / "far.py").stat().st_ctime_ns <= loaded:
        time.sleep(0.01)
        (folder / "far.py").write_text("near = 1")
    digests = SourceDigests(folder, loaded=loaded)
    with pytest.raises(LookupError, match=r"far\.py changed after it was imported"):
        digests.digest("walks.own")


IMPORTED = """
import pathlib
import sys
import jaxbiped as jb
from jaxbiped.caching._fingerprint import as_leaves, fingerprint
search = jb.find_gait
path = pathlib.Path(jb.__file__).parent / sys.argv[1]
path.write_text(path.read_text() + "\\n")
print(fingerprint(search) is None, fingerprint(as_leaves(jb.seed_scene())) is None)
"""


@pytest.mark.parametrize(
    ("file", "unknown"),
    [
        ("gait/_find_gait.py", (True, False)),
        ("scene/laws/friction/_stribeck.py", (True, True)),
        ("cli/__init__.py", (False, False)),
    ],
)
def test_programs_of_what_changed_after_it_was_imported_have_no_key(
    copied, tmp_path, monkeypatch, file, unknown
):
    """In a process that imported the copy: a gait's program, and a scene's."""
    monkeypatch.setenv("JAXBIPED_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("PYTHONPATH", str(copied.parent))
    whole = (copied / file).read_text()
    command = [sys.executable, "-c", IMPORTED, file]
    told = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert (copied / file).read_text() == whole + "\n"
    (copied / file).write_text(whole)
    assert told.stdout.split() == [str(each) for each in unknown], told.stderr


def test_a_source_that_cannot_be_read_has_none(tmp_path, monkeypatch):
    monkeypatch.setenv("JAXBIPED_CACHE", "")
    folder = _package(tmp_path / "walks", own="def :")
    for module in ("walks.own", "walks.nowhere"):
        with pytest.raises(LookupError):
            SourceDigests(folder, loaded=LATER).digest(module)
