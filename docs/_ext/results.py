"""Table of the experiments' committed results, by `{results}`: when and where each was measured."""

import json
from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "experiments" / "results"


def rows() -> list[tuple[str, ...]]:
    """Of each file of results: experiment, date, machine, and the command that makes it again."""
    found = []
    for path in sorted(RESULTS.glob("*.json")):
        made: dict[str, Any] = json.loads(path.read_text()).get("made", {})
        date, machine = made.get("date", "not recorded"), made.get("machine", "not recorded")
        found.append((path.stem, date, machine, f'make figures ONLY="{path.stem}"'))
    return found


class Results(SphinxDirective):
    """The table, as Markdown."""

    def run(self) -> list[nodes.Node]:
        """The table."""
        lines = ["| experiment | date | machine | command |", "|---|---|---|---|"]
        for name, date, machine, command in rows():
            self.env.note_dependency(str(RESULTS / f"{name}.json"))
            link = f"[{name}](../experiments/results/{name}.json)"
            lines.append(f"| {link} | {date} | {machine} | `{command}` |")
        made = nodes.container()
        self.state.nested_parse(StringList(lines, source="results"), 0, made)
        return made.children


def setup(app: Sphinx) -> dict[str, bool]:
    """Adds the directive."""
    app.add_directive("results", Results)
    return {"parallel_read_safe": True}
