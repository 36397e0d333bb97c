"""Declarations of public names: signatures, parameters and registries, read and not imported.

Help and refusals come before JAX is imported. So what options begin at, what they choose from and
what is said of them is read in the source of what declares it, as syntax.
"""

import ast
import contextlib
import inspect
import math
import re
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import jaxbiped
from jaxbiped._quantity import ParameterInfo, Quantity

_ROOT = Path(jaxbiped.__file__).parent
_EXPORT = re.compile(r"^from (\S+) import \(?\s*(\w+) as", re.MULTILINE)
_STATEMENT = re.compile(r"^[^\s)\]}#]", re.MULTILINE)
_NAMED = re.compile(r'^class (\w+)|^    name: ClassVar.* = "(.+)"$', re.MULTILINE)
_FIELD = re.compile(r'^(?:class (\w+)|(\S)|    (\w+): |    """(.*?)""")', re.MULTILINE | re.DOTALL)
_NO_FIELD = re.compile(r"ClassVar|AbstractVar")
_ENTRY = re.compile(r"^ {4}((?:\w+, )*\w+): (.+(?:\n {8}.+)*)", re.MULTILINE)
_SENTENCE_END = re.compile(r"\. (?=[A-Z])")
_SYMBOL = re.compile(r" [^\x00-\x7f]+\b")
_UNIT = re.compile(r" \[[^]]*\]")
_OPENINGS = (("def ", "("), ("class ", "("), ("class ", ":"), ("", ": "), ("", " = "))
"""What stands before and after a name where a statement binds it."""
_SOURCES: dict[str, str] = {}
"""Texts of the modules that were read."""


class Argument(NamedTuple):
    """A keyword of a function, or a parameter: its default, and the first sentence about it."""

    default: Any
    help: str
    info: ParameterInfo | None = None


def signature(name: str) -> dict[str, Argument]:
    """The keywords of a public function whose defaults are plain values."""
    home, function = _definition(name)
    assert isinstance(function, ast.FunctionDef)
    said, found = _entries(function), {}
    for keyword, default in zip(function.args.kwonlyargs, function.args.kw_defaults, strict=True):
        with contextlib.suppress(ValueError):
            if isinstance(default, ast.Name):
                default = getattr(_statement(home, default.id), "value", None)
            if default is not None:
                value = ast.literal_eval(default)
                found[keyword.arg] = Argument(value, said.get(keyword.arg, ""))
    return found


def fields(name: str) -> dict[str, Argument]:
    """The fields of a public class; those that `parameter` declares with their units."""
    found = {}
    for part in _with_bases(*_definition(name)):
        said = _entries(part)
        for node in part.body:
            if not isinstance(node, ast.AnnAssign):
                continue
            if not _NO_FIELD.match(ast.unparse(node.annotation)):
                own, default, info = ast.unparse(node.target), None, None
                if isinstance(node.value, ast.Call):
                    expression = compile(ast.Expression(node.value), name, "eval")
                    default, info = eval(expression, _DECLARING)
                words = _UNIT.sub("", said.get(own, "")).removesuffix(".")
                unit = f" [{info.quantity.unit}]" if info and info.quantity.unit else ""
                found[own] = Argument(default, f"{words}{unit}.", info)
    return found


def _with_bases(module: str, part: ast.stmt) -> list[ast.ClassDef]:
    """A class behind those of its bases that its module defines."""
    assert isinstance(part, ast.ClassDef)
    found = []
    for base in part.bases:
        with contextlib.suppress(ValueError):
            found += _with_bases(module, _statement(module, ast.unparse(base)))
    return [*found, part]


def names(registry: str) -> tuple[str, ...]:
    """The names that a public tuple or table holds."""
    value = getattr(_definition(registry)[1], "value", None)
    if isinstance(value, ast.Dict):
        return tuple(ast.literal_eval(key) for key in value.keys if key is not None)
    return tuple(ast.literal_eval(value))  # type: ignore[arg-type]


def registered(namespace: str, *packages: str) -> dict[str, str]:
    """Public classes of a namespace by the `name` that each declares, in the order of its lines.

    With `packages`, those that lie in one of these.
    """
    found, kind = {}, ""
    for home, own in _EXPORT.findall(_source(".".join(_home(namespace)))):
        if not packages or any(f".{package}." in home for package in packages):
            for each, name in _NAMED.findall(_source(home)):
                kind = each or kind
                if name and kind == own:
                    found[name] = f"{namespace}.{own}"
    return found


def documentation(module: str, kind: str) -> dict[str, str]:
    """What stands below each field of a class, on one line."""
    found, inside, field = {}, False, ""
    for opened, other, named, said in _FIELD.findall(_source(module)):
        if opened or other:
            inside, field = opened == kind, ""
        elif named:
            field = named
        elif inside and field:
            found[field] = " ".join(said.split())
    return found


def _definition(name: str) -> tuple[str, ast.stmt]:
    """Module and statement that define a public name, such as "optimise.certify"."""
    home, own = _home(name)
    return home, _statement(home, own)


def _home(name: str) -> tuple[str, str]:
    """Module that defines a public name, and its name there: by the lines that export it."""
    module = home = "jaxbiped"
    for own in name.split("."):
        exports = {each: home for home, each in _EXPORT.findall(_source(module))}
        home, module = exports[own], f"{exports[own]}.{own}"
    return home, own


def _statement(module: str, own: str) -> ast.stmt:
    """The statement of a module that binds a name; of a function up to its docstring's end."""
    source = _source(module)
    openings = (f"\n{before}{own}{after}" for before, after in _OPENINGS)
    begin = 1 + max(map(source.find, openings))
    if not begin:
        raise ValueError(f"{module} does not define {own}")
    follows = _STATEMENT.search(source, source.index("\n", begin))
    text = source[begin : follows.start() if follows else len(source)]
    if text.startswith("def "):
        text = '"""'.join(text.split('"""')[:2]) + '"""'
    return ast.parse(text).body[0]


def _source(module: str) -> str:
    if module not in _SOURCES:
        package, *parts = module.split(".")
        if package != _ROOT.name:  # an option of a user's own command
            return inspect.getsource(sys.modules[module])
        path = _ROOT.joinpath(*parts)
        if path == _ROOT:
            path = path / "__init__.pyi"
        else:
            path = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
        _SOURCES[module] = path.read_text(encoding="utf-8")
    return _SOURCES[module]


def _entries(node: ast.FunctionDef | ast.ClassDef) -> dict[str, str]:
    """The first sentence of what a docstring says of each argument or attribute.

    Without Greek symbols: help is printed where there are only ASCII characters, too.
    """
    found = {}
    for owners, text in _ENTRY.findall(ast.get_docstring(node) or ""):
        words = _SYMBOL.sub("", " ".join(text.replace("`", "").split()))
        first = _SENTENCE_END.split(words)[0].removesuffix(".")
        for own in owners.split(", "):
            found[own] = first[:1].upper() + first[1:] + "."
    return found


def _parameter(
    words: str,
    symbol: str = "",
    unit: str = "",
    *,
    default: float | None = None,
    several: bool = False,
    **limits: Any,
) -> tuple[Any, ParameterInfo]:
    """What `jaxbiped.laws.parameter` keeps of its arguments."""
    del several
    return default, ParameterInfo(Quantity(words, symbol, unit), **limits)


_DECLARING = {
    "parameter": _parameter,
    "eqx": SimpleNamespace(field=lambda default=None, **_: (default, None)),
    "math": math,
}
"""What stands in the right-hand sides of fields."""
