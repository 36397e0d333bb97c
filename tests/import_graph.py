"""Import graph of the packages, as ARCHITECTURE.md shows it; as a script, prints that block."""

import ast
from pathlib import Path

import jaxbiped as jb

PACKAGE = Path(jb.__file__).parent
LAYERS = [
    "caching", "linalg", "compiler", "constraints", "scene", "dynamics", "hybrid", "solve",
    "variational", "simulate", "models", "measure", "gait", "continuation", "identify", "basins",
    "sweep", "optimise", "trade", "plot", "cli",
]  # fmt: skip
"""Packages from the bottom up: each may import those before it."""
BEGIN, END = "<!-- import graph: begin -->", "<!-- import graph: end -->"


def imports_of(path):
    """Dotted names of the modules that a file imports, also inside its functions."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                yield inner if _is_module(inner) else node.module
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def _is_module(name):
    own, *parts = name.split(".")
    path = PACKAGE.joinpath(*parts)
    return own == PACKAGE.name and (path.is_dir() or path.with_suffix(".py").is_file())


def layer_of(module):
    """The package of a module's dotted name, None outside of the packages."""
    own, *parts = module.split(".")
    return parts[0] if own == PACKAGE.name and parts and parts[0] in LAYERS else None


def import_graph():
    """Package by package from the bottom up, the packages that its files import."""
    graph = {}
    for package in LAYERS:
        files = (PACKAGE / package).rglob("*.py")
        layers = {layer_of(module) for path in files for module in imports_of(path)}
        graph[package] = [layer for layer in LAYERS if layer in layers - {package}]
    return graph


def drawn(graph):
    """The graph as a block of ARCHITECTURE.md, markers and all."""
    width = max(map(len, graph))
    lines = [f"{name:<{width}}  → {', '.join(of) or '(none)'}" for name, of in graph.items()]
    return "\n".join([BEGIN, "```text", *lines, "```", END])


if __name__ == "__main__":
    print(drawn(import_graph()))
