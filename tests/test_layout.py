"""The code, against the house rules that a program can check."""

import ast
import re

import jax.numpy as jnp
import pytest

import jaxbiped as jb
from tests.import_graph import LAYERS, PACKAGE, drawn, import_graph, imports_of, layer_of

MODULES = sorted(PACKAGE.rglob("*.py"))
TESTS = sorted((PACKAGE.parent / "tests").rglob("*.py"))
EXPERIMENTS = sorted((PACKAGE.parent / "experiments").rglob("*.py"))


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_modules_are_short_and_arrows_point_one_way(path):
    assert len(path.read_text().splitlines()) <= 500
    own = layer_of("jaxbiped." + path.relative_to(PACKAGE).parts[0])
    if own is None:
        return
    for module in imports_of(path):
        layer = layer_of(module)
        assert layer is None or LAYERS.index(layer) <= LAYERS.index(own), module
        if own == "compiler":
            assert layer in (None, "caching", "compiler"), f"the compiler knows no walker: {module}"
        elif layer == "compiler":
            assert module == "jaxbiped.compiler", f"past the compiler's front door: {module}"


QUESTIONS = {"is_compliant", "is_rigid", "is_walker", "compliant", "redundant"}
KINDS = {
    "Scene", "RigidScene", "RedundantScene", "HybridSystem", "LinkageScene",  # scenes
    "AbstractWalkerScene", "AbstractMinimalScene", "WalkerScene", "CompliantScene",
    "Walking", "RedundantWalking", "Rolling", "GuardedMotion",  # and their systems
    "AbstractWalking", "AbstractWalkerSystem",
}  # fmt: skip
SAME_FOR_ALL = ("gait", "continuation", "sweep", "optimise", "identify")


SOLVES = [
    path for package in ("solve", "variational") for path in (PACKAGE / package).rglob("*.py")
]


@pytest.mark.parametrize("path", SOLVES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_solves_know_systems_and_no_walker(path):
    """They import no mechanism and no motion of one, nor the names by which kinds are known."""
    for module in imports_of(path):
        assert layer_of(module) not in ("scene", "dynamics"), module
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom):
            assert not KINDS & {each.name for each in node.names}


def _annotations_of(tree):
    """What is written behind colons and arrows: signatures, and what a registered answer is for."""
    for node in ast.walk(tree):
        for part in (getattr(node, "annotation", None), getattr(node, "returns", None)):
            yield from () if part is None else ast.walk(part)


@pytest.mark.parametrize(
    "path",
    [path for package in SAME_FOR_ALL for path in sorted((PACKAGE / package).rglob("*.py"))],
    ids=lambda path: str(path.relative_to(PACKAGE)),
)
def test_no_file_asks_a_scene_which_kind_of_motion_it_has(path):
    """Scenes and systems answer, or a function that is registered for a kind by its annotation."""
    tree = ast.parse(path.read_text())
    annotations = {id(node) for node in _annotations_of(tree)}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            assert not QUESTIONS & {each.name for each in node.names}
            assert not KINDS & {each.name for each in node.names if each.asname is not None}
        elif isinstance(node, ast.Attribute):
            assert node.attr not in QUESTIONS | KINDS
        elif isinstance(node, ast.Name) and id(node) not in annotations:
            assert node.id not in KINDS | QUESTIONS
        elif isinstance(node, ast.Call) and ast.unparse(node.func) in ("isinstance", "issubclass"):
            assert "SCENES" not in ast.unparse(node)  # doors alone name what they accept


def test_every_package_has_a_layer():
    assert {path.parent.name for path in PACKAGE.glob("*/__init__.py")} == set(LAYERS)


def test_the_import_graph_of_the_architecture_is_up_to_date():
    page = (PACKAGE.parent / "ARCHITECTURE.md").read_text()
    assert drawn(import_graph()) in page, "paste what `python -m tests.import_graph` prints"


def test_the_top_level_is_small():
    assert len(jb.__all__) <= 71


def test_importing_switches_to_64_bits():
    assert jnp.asarray(1.0).dtype == jnp.float64
    assert all(leaf.dtype == jnp.float64 for leaf in jb.seed_state())


def test_public_names_have_docstrings():
    for name in jb.__all__:
        thing = getattr(jb, name)
        if callable(thing):
            assert thing.__doc__, name


def test_every_test_file_says_against_what_it_holds_things():
    without = []
    for path in sorted((PACKAGE.parent / "tests").rglob("test_*.py")):
        said = ast.get_docstring(ast.parse(path.read_text())) or ""
        if " against " not in said.partition("\n")[0]:
            without.append(path.name)
    assert without == []


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_what_outlives_a_call_is_kept_by_the_caches(path):
    if path.name in ("_caches.py", "_cached_jit.py"):
        return
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Attribute):
            assert node.attr not in ("lru_cache", "cache", "filter_jit"), (
                "see jaxbiped/caching/_caches.py"
            )
        decorators = getattr(node, "decorator_list", [])
        assert "jax.jit" not in map(ast.unparse, decorators), (
            "cached_jit, see jaxbiped/caching/_caches.py"
        )


MOST_PRIVATE, MOST_PATCHED = 110, 36
"""Numbers that may fall, and are then lowered here: a change behind a public function breaks none
of the tests that ask the function."""


def test_few_tests_know_private_modules():
    private = [
        path for path in TESTS if any("jaxbiped." in x and "._" in x for x in imports_of(path))
    ]
    assert sum(path.name.startswith("test_") for path in private) <= MOST_PRIVATE


def _patches_of(path):
    """Places where attributes of the package are replaced."""
    tree, ours = ast.parse(path.read_text()), {"jaxbiped"}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            named = [
                (getattr(node, "module", None) or x.name, x.asname or x.name) for x in node.names
            ]
            ours |= {name for module, name in named if module.partition(".")[0] == "jaxbiped"}
        elif isinstance(node, ast.Assign) and "import_module('jaxbiped" in ast.unparse(node.value):
            ours |= {ast.unparse(target) for target in node.targets}
    for node in ast.walk(tree):
        is_patch = getattr(getattr(node, "func", None), "attr", "") in ("setattr", "setitem")
        if is_patch and ours & set(re.findall(r"\w+", ast.unparse(node.args[0]))):
            yield node


def test_few_attributes_are_patched():
    assert sum(len(list(_patches_of(path))) for path in TESTS) <= MOST_PATCHED


@pytest.mark.parametrize("path", EXPERIMENTS, ids=lambda path: path.name)
def test_experiments_use_the_public_interface(path):
    for name in imports_of(path):
        assert not (name.startswith("jaxbiped.") and "._" in name), name


def test_the_reference_is_independent():
    """What results are held against shares no code with the package, nor with JAX."""
    for path in (PACKAGE.parent / "experiments" / "reference").glob("*.py"):
        for name in imports_of(path):
            assert name.partition(".")[0] not in ("jaxbiped", "jax", "diffrax"), (path, name)


TWO_LEGS = re.compile(r"walker\.(l|r|d|m|J|hip_mass|hip_to_foot)\b|\b(theta|omega|bristle)_[12]\b")
KNOW_OF_TWO_LEGS = {
    "cli/_start_options.py",  # the seed's start, and the header of a table as an example
    "cli/_walkers.py",  # starts of named walkers
    "dynamics/_state.py",  # the seed's start
    "gait/_search_starts.py",  # the seed's start
    "models/_published_walkers.py",  # which angles of papers they are, and starts
    "identify/_measured_gait.py",  # two names of angles
    "plot/_parameter_charts.py",  # an example
    "scene/_state_types.py",
    "sweep/starts/_coordinates.py",  # symbols of angles that have names by role
}


def test_few_files_know_that_there_are_two_legs():
    found = {
        str(path.relative_to(PACKAGE))
        for path in PACKAGE.rglob("*.py")
        if TWO_LEGS.search(path.read_text(encoding="utf-8"))
    }
    assert found == KNOW_OF_TWO_LEGS
