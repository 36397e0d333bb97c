"""The house rules that a program can check."""

import ast
from pathlib import Path

import jax.numpy as jnp
import pytest

import jaxbiped as jb

PACKAGE = Path(jb.__file__).parent
LAYERS = ["scene", "dynamics", "solve", "lanes", "simulate", "gait", "sweep", "plot", "cli"]
MODULES = sorted(PACKAGE.rglob("*.py"))


def _imports(path):
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_modules_are_short_and_arrows_point_one_way(path):
    assert len(path.read_text().splitlines()) < 300
    layer = path.relative_to(PACKAGE).parts[0]
    if layer not in LAYERS:
        return
    above = LAYERS[LAYERS.index(layer) + 1 :]
    for module in _imports(path):
        parts = module.split(".")
        assert not (parts[0] == "jaxbiped" and len(parts) > 1 and parts[1] in above), module


def test_importing_switches_to_64_bits():
    assert jnp.asarray(1.0).dtype == jnp.float64
    assert all(leaf.dtype == jnp.float64 for leaf in jb.seed_state())


def test_public_names_have_docstrings():
    for name in dir(jb):
        thing = getattr(jb, name)
        if not name.startswith("_") and callable(thing):
            assert thing.__doc__, name
