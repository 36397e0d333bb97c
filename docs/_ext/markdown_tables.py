"""Tables that are made with the site, as Markdown.

`{options} gait` has the options of a command, as it declares them. Options that several commands
share are those of a group: `{options} SceneOptions`. `{results}` has the experiments' committed
results: when and where each was measured.
"""

import dataclasses
import json
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, get_args

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "experiments" / "results"


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


class Table(SphinxDirective):
    """A table below some heads; who fills it says what is in its rows."""

    heads: tuple[str, ...]

    def cells(self) -> Iterable[tuple[str, ...]]:
        """Its rows."""
        raise NotImplementedError

    def run(self) -> list[nodes.Node]:
        """The table."""
        lines = [self.heads, ["---"] * len(self.heads), *self.cells()]
        text = StringList([f"| {' | '.join(line)} |" for line in lines], source=self.name)
        made = nodes.container()
        self.state.nested_parse(text, 0, made)
        return made.children


class Options(Table):
    """The options of a command or a group."""

    required_arguments = 1
    heads = ("option", "meaning", "default")

    def cells(self) -> Iterable[tuple[str, ...]]:
        """Of each option."""
        from jaxbiped.cli import COMMANDS

        asked = self.arguments[0]
        for flag, words, default in rows(COMMANDS.get(asked) or groups()[asked]):
            shown = f"`{default}`" if default not in ("", "required") else default
            meaning = re.sub(r"(--[\w-]+)", r"`\1`", words).replace("|", r"\|")
            yield f"`{flag}`", meaning, shown


class Results(Table):
    """Of each file of results: experiment, date, machine, and the command that makes it again."""

    heads = ("experiment", "date", "machine", "command")

    def cells(self) -> Iterable[tuple[str, ...]]:
        """Of each file."""
        for path in sorted(RESULTS.glob("*.json")):
            self.env.note_dependency(str(path))
            made: dict[str, Any] = json.loads(path.read_text()).get("made", {})
            told = (made.get(name, "not recorded") for name in ("date", "machine"))
            link = f"[{path.stem}](../experiments/results/{path.name})"
            yield link, *told, f'`make figures ONLY="{path.stem}"`'


def setup(app: Sphinx) -> dict[str, bool]:
    """Adds the directives."""
    app.add_directive("options", Options)
    app.add_directive("results", Results)
    return {"parallel_read_safe": True}
