"""Fields of modules, against what their annotations say: numbers are leaves, all else is static."""

import ast
import dataclasses
import importlib

import equinox as eqx

from tests.import_graph import PACKAGE

PLAIN = {"str", "bool", "int", "type", "None", "tuple", "..."}
"""Words of annotations of what JAX cannot trace."""
NUMBERS = {"Scalar", "Array", "PyTree", "RealScalarLike", "Parameter", "Numbers", "Time", "Integer"}
"""Of what it traces."""
FUNCTIONS = {"Callable", "VectorField", "Arrival", "MotionFunction"}
MODULES_TOO = {"AbstractLinearisation.run", "Motor.law", "VariationalField.field"}
"""Functions that may be modules with numbers of their own."""
WORDS_OR_SHAPES = {
    "Angle",
    "LaneRun",
    "Quantity",
    "Modes",
    "Structure",
    "Effort",
    "Extreme",
    "Integral",
    "StepIntegrals",
    "ExplicitMethod",
    "PyTreeDef",
}
"""Types of what is the same whatever the numbers are."""
STATIC_PARTS = {
    "AbstractSimulation.section",
    "Branch.section",
    "ErrorEstimate.relative",  # floats of Python, which are known before anything runs
    "ErrorEstimate.rtol",
    "ErrorEstimate.wanted",
    "Flow.system",  # of a program that takes its numbers apart from it
    "GuardedMotion.kind",
    "GuardedMotion.time_unit",  # a property of a system's class
    "LinkAngle.weights",
    "Method.optimiser",  # of Optax: functions
    "OneFoot.leg",  # a name
    "Watch.time_unit",
}
NOT_TRACED = "sweep/starts"
"""Whose modules only list starts, outside of any program."""


def words_of(annotation):
    """Names in an annotation, without what makes them up."""
    names = [node.id for node in ast.walk(annotation) if isinstance(node, ast.Name)]
    constants = [str(node.value) for node in ast.walk(annotation) if isinstance(node, ast.Constant)]
    return {*names, *("..." if c == "Ellipsis" else c for c in constants)}


def declared():
    """Of every field of the package's modules: its name, its annotation's words, if static."""
    for path in sorted(PACKAGE.rglob("*.py")):
        classes = [c for c in ast.parse(path.read_text()).body if isinstance(c, ast.ClassDef)]
        place = path.relative_to(PACKAGE).with_suffix("")
        if not any(isinstance(n, ast.AnnAssign) for c in classes for n in c.body):
            continue
        if str(place).startswith(NOT_TRACED):
            continue
        module = importlib.import_module(".".join(["jaxbiped", *place.parts]))
        for written in classes:
            kind = getattr(module, written.name)
            if not issubclass(kind, eqx.Module):
                continue
            annotations = {
                n.target.id: n.annotation for n in written.body if isinstance(n, ast.AnnAssign)
            }
            for field in dataclasses.fields(kind):
                if field.name in annotations:
                    words = words_of(annotations[field.name])
                    name = f"{written.name}.{field.name}"
                    yield name, words, bool(field.metadata.get("static", False))


FIELDS = list(declared())


def test_what_jax_cannot_trace_is_static():
    plain = {name: static for name, words, static in FIELDS if words <= PLAIN}
    assert len(plain) > 50
    assert [name for name, static in plain.items() if not static] == []


def test_functions_are_static_unless_they_are_modules():
    functions = {n: static for n, words, static in FIELDS if words & FUNCTIONS}
    assert len(functions) > 10
    assert {name for name, static in functions.items() if not static} == MODULES_TOO


def test_numbers_are_leaves():
    numbers = {
        name: static for name, words, static in FIELDS if words & NUMBERS and not words & FUNCTIONS
    }
    assert len(numbers) > 100
    assert [name for name, static in numbers.items() if static] == []


def test_parts_are_nodes_unless_nothing_in_them_is_a_number_to_trace():
    rest = {
        name: static
        for name, words, static in FIELDS
        if not (words <= PLAIN or words & (NUMBERS | FUNCTIONS | WORDS_OR_SHAPES))
    }
    assert len(rest) > 40
    assert {name for name, static in rest.items() if static} == STATIC_PARTS
    shapes = {name: static for name, words, static in FIELDS if words & WORDS_OR_SHAPES}
    assert {name for name, static in shapes.items() if not static} == {
        "AbstractLinearisation.structure"  # of a solver, a tree of its own
    }
