"""Options of the command line, as the commands declare them: `{options} gait`.

The table has a command's own options. Options that several commands share are those of a group:
`{options} SceneOptions`.
"""

import dataclasses
import re
from collections.abc import Iterator
from typing import Any, get_args

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective


def said_by(kind: Any) -> Iterator[Any]:
    """What a type, or what it is made of, is annotated with."""
    for inner in get_args(kind):
        yield from said_by(inner)
    yield from getattr(kind, "__metadata__", ())


def group_of(kind: Any) -> Any:
    """The group that a field holds, None for a field that is an option."""
    held = (get_args(kind) or (kind,))[0]
    return held if dataclasses.is_dataclass(held) else None


def groups() -> dict[str, Any]:
    """Groups of options of all commands, by the names of their classes."""
    from jaxbiped.cli import COMMANDS

    found: dict[str, Any] = {}
    waiting = [kind for kind in COMMANDS.values() if kind is not None]
    while waiting:
        for field in dataclasses.fields(waiting.pop(0)):  # type: ignore[arg-type]
            group = group_of(field.type)
            if group is not None and group.__name__ not in found:
                found[group.__name__] = group
                waiting.append(group)
    return found


def rows(kind: Any) -> Iterator[tuple[str, str, str]]:
    """Each option of a command or a group that is its own: its name, its help, its default."""
    for field in dataclasses.fields(kind):
        if group_of(field.type) is not None:
            continue
        said = list(said_by(field.type))
        name = next(filter(None, (getattr(each, "name", None) for each in said)), field.name)
        words = next(filter(None, (getattr(each, "help", None) for each in said)), "")
        positional = any("Positional" in repr(each) for each in said)
        flag = name.upper() if positional else "--" + name.replace("_", "-")
        required = field.default is dataclasses.MISSING
        none = field.default is None or field.default == ()
        default = "required" if required else "" if none else str(field.default)
        yield flag, words, default


class Options(SphinxDirective):
    """The table of a command's or a group's options."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """The table."""
        from jaxbiped.cli import COMMANDS

        asked = self.arguments[0]
        kind = COMMANDS.get(asked) or groups()[asked]
        lines = ["| option | meaning | default |", "|---|---|---|"]
        for flag, words, default in rows(kind):
            shown = f"`{default}`" if default not in ("", "required") else default
            meaning = re.sub(r"(--[\w-]+)", r"`\1`", words).replace("|", r"\|")
            lines.append(f"| `{flag}` | {meaning} | {shown} |")
        made = nodes.container()
        self.state.nested_parse(StringList(lines, source="options"), 0, made)
        return made.children


def setup(app: Sphinx) -> dict[str, bool]:
    """Adds the directive."""
    app.add_directive("options", Options)
    return {"parallel_read_safe": True}
