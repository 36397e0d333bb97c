"""Reference of a module's public names: `.. public-names:: jaxbiped.optimise`.

Each name gets the page's own entry, in the order of the module's lines: functions, classes with the
methods that they document, and constants with the string below their assignment.
"""

import ast
import functools
import importlib
import inspect
import itertools
import operator
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective


def find(path: str) -> Any:
    """What a dotted path names: `jaxbiped.laws` is an attribute, and no module to import."""
    package, _, attributes = path.partition(".")
    found = importlib.import_module(package)
    return operator.attrgetter(attributes)(found) if attributes else found


def public_names(module: str) -> dict[str, str]:
    """Of a module: its public names that are no modules, and where each is defined."""
    package = find(module)
    source = Path(package.__file__ or "")
    stub = source.with_suffix(".pyi")
    tree = ast.parse((stub if stub.exists() else source).read_text())
    found = {}
    for line in tree.body:
        if isinstance(line, ast.ImportFrom) and line.module:
            for alias in line.names:
                name = alias.asname or alias.name
                is_module = inspect.ismodule(getattr(package, name))
                if not name.startswith("_") and not is_module:
                    found[name] = line.module
    return found


def constant_words(module: str, name: str) -> str:
    """The string below an assignment in a module's source, empty without one."""
    body = ast.parse(inspect.getsource(importlib.import_module(module))).body
    for line, below in itertools.pairwise(body):
        targets = line.targets if isinstance(line, ast.Assign) else [getattr(line, "target", None)]
        is_it = any(isinstance(each, ast.Name) and each.id == name for each in targets)
        if is_it and isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant):
            return inspect.cleandoc(str(below.value.value))
    return ""


def documented_members(kind: type) -> list[str]:
    """Its own public methods and properties with a docstring; fields stand in the class's own."""
    fields = {*getattr(kind, "_fields", ()), *getattr(kind, "__dataclass_fields__", ())}
    return [
        name
        for name, member in vars(kind).items()
        if not name.startswith("_") and name not in fields and getattr(member, "__doc__", None)
        and (callable(member) or isinstance(member, (property, classmethod, staticmethod)))
    ]  # fmt: skip


def entry(module: str, name: str, defined_in: str) -> list[str]:
    """The lines of reStructuredText of one name."""
    path = f"{module}.{name}"
    thing = find(path)
    if inspect.isclass(thing):
        members = documented_members(thing)
        listed = [f"   :members: {', '.join(members)}"] if members else []
        return [f".. autoclass:: {path}", *listed, ""]
    if callable(thing):
        return [f".. autofunction:: {path}", ""]
    words = constant_words(defined_in, name).splitlines()
    return [f".. py:data:: {path}", "", *(f"   {line}" for line in words), ""]


class PublicNames(SphinxDirective):
    """Entries of all public names of a module."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """The entries."""
        module = self.arguments[0]
        lines = []
        for name, defined_in in public_names(module).items():
            lines += entry(module, name, defined_in)
        made = nodes.container()
        self.state.nested_parse(StringList(lines, source=module), 0, made)
        return made.children


def as_markup(
    app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]
) -> None:
    """Docstrings are plain text: what reStructuredText would take for markup is escaped."""
    text = "\n".join(lines)
    # What is said of all attributes at once stands before them.
    text = re.sub(
        r"^( *)(Attributes) \((.+)\):$", r"\1Of its attributes: \3.\n\n\1\2:", text, flags=re.M
    )
    text = text.replace("|", r"\|")
    text = re.sub(r"(`[^`\n]+`)(?=\w)", r"\1\\ ", text)
    lines[:] = text.split("\n")


def as_listed(objects: Mapping[str, Any], link: re.Match[str]) -> str:
    """A link back from a page of source, to its name as the page that it leads to lists it.

    Sphinx keeps one package for each module, but names of a module may be public in two.
    """
    page, parts = link["page"], link["name"].split(".")
    listed = [name for name, each in objects.items() if page.endswith(f"/{each.docname}.html")]
    for count in range(len(parts), 0, -1):
        tail = ".".join(["", *parts[-count:]])
        for name in listed:
            if f".{name}".endswith(tail):
                return f'href="{page}#{name}"'
    return link[0]


def mend_links(app: Sphinx, page: str, _: str, context: dict[str, Any], *__: Any) -> None:
    """Links back from pages of source, as the reference lists the names."""
    if page.startswith("_modules/jaxbiped"):
        domain: Any = app.env.get_domain("py")
        mend = functools.partial(as_listed, domain.objects)
        pattern = r'href="(?P<page>[^"#]+)#(?P<name>jaxbiped[^"]+)"'
        context["body"] = re.sub(pattern, mend, context["body"])


def setup(app: Sphinx) -> dict[str, bool]:
    """Adds the directive, the reading of docstrings, and the links back from source."""
    app.add_directive("public-names", PublicNames)
    app.connect("autodoc-process-docstring", as_markup, priority=100)
    app.connect("html-page-context", mend_links)
    return {"parallel_read_safe": True}
