"""Docstrings of the public names, against signatures and what their examples print."""

import ast
import dataclasses
import doctest
import inspect
import re
import textwrap
from pathlib import Path

import pytest

import jaxbiped as jb
from tests.public_names import namespaces


def _source(module):
    """The text of a namespace; of the top level, the stub that is its map."""
    stub = Path(module.__file__).with_suffix(".pyi")
    return stub.read_text() if stub.exists() else inspect.getsource(module)


def _public():
    """Functions and classes that a namespace defines, or imports as themselves."""
    for space, module in {"jb": jb, **namespaces()}.items():
        for node in ast.parse(_source(module)).body:
            names = []
            if isinstance(node, ast.ImportFrom):
                names = [alias.name for alias in node.names if alias.asname == alias.name]
            elif isinstance(node, ast.FunctionDef | ast.ClassDef):
                names = [node.name]
            for name in names:
                thing = getattr(module, name)
                if callable(thing) and not name.startswith("_"):
                    yield pytest.param(thing, id=f"{space}.{name}")


PUBLIC = list(_public())
FUNCTIONS = [each for each in PUBLIC if not inspect.isclass(each.values[0])]
CLASSES = [each for each in PUBLIC if inspect.isclass(each.values[0])]


def _section(thing, title):
    """The indented block under a title of a docstring; None without one."""
    found = re.search(
        rf"^{title}(?: \(.*\))?:\n((?:    .*\n|\n)+)", inspect.getdoc(thing) + "\n", re.M
    )
    return found and found[1]


def _entries(text):
    """Names that the entries of a section are about: `a, b: …` gives a and b."""
    blocks = re.findall(r"^    (?! )(.*(?:\n     .*)*)", text or "", re.M)
    return {name.strip() for block in blocks for name in block.split(":")[0].split(",")}


def _raises(function):
    """Whether a function's own body checks an argument or raises what callers are to see."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(inspect.unwrap(function))))
    called = (node.func for node in ast.walk(tree) if isinstance(node, ast.Call))
    names = {func.id for func in called if isinstance(func, ast.Name)}
    return "ArgumentError" in names or any(name.startswith("check_") for name in names)


@pytest.mark.parametrize("function", FUNCTIONS)
def test_functions_say_what_they_take_return_and_raise(function):
    parameters = set(inspect.signature(function).parameters)
    assert _entries(_section(function, "Args")) == parameters
    if function.__annotations__.get("return") is not None:
        assert _section(function, "Returns")
    if _raises(function):
        assert _section(function, "Raises")


@pytest.mark.parametrize("kind", CLASSES)
def test_classes_say_what_their_fields_are(kind):
    if dataclasses.is_dataclass(kind):
        fields = {field.name for field in dataclasses.fields(kind)}
    else:
        fields = set(getattr(kind, "_fields", ()))
    bases = [base for base in kind.__mro__ if base.__module__.startswith("jaxbiped")]
    titles = ("Attributes", "Args")
    said = {name for base in bases for title in titles for name in _entries(_section(base, title))}
    assert fields <= said


def _examples():
    finder = doctest.DocTestFinder(recurse=False)
    for each in FUNCTIONS:
        (example,) = finder.find(each.values[0], name=each.id, globs={})
        if example.examples:
            slow = [pytest.mark.slow] if each.id in COMPILING else []
            yield pytest.param(example, id=each.id, marks=slow)


COMPILING = {
    "jb.continue_gait", "jb.simulate", "jb.footsteps", "jb.measure.energy_ledger", "jb.find_gait",
    "jb.rigid_walk", "jb.fit_gait", "jb.optimise_gait",
}  # fmt: skip
"""Functions whose examples compile a walk or a gait."""
EXAMPLES = list(_examples())


def test_the_most_used_functions_have_examples():
    used = {
        "simulate",
        "footsteps",
        "measure.energy_ledger",
        "find_gait",
        "rigid_walk",
        "with_parameters",
    }
    assert {f"jb.{name}" for name in used} <= {each.id for each in EXAMPLES}


@pytest.mark.parametrize("example", EXAMPLES)
def test_examples_print_what_they_say(example):
    said = []
    doctest.DocTestRunner().run(example, out=said.append)
    assert not said, "".join(said)
