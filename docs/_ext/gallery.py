"""Gallery: every picture in `docs/gallery` with the script that made it, by `{gallery}`.

A picture is called as its experiment, perhaps with a dash and more: `ladder-cost.png`.
"""

import ast
from pathlib import Path

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

ROOT = Path(__file__).parents[2]


def pictures() -> list[tuple[Path, Path]]:
    """Each picture and the script that made it."""
    found = []
    for picture in sorted((ROOT / "docs" / "gallery").glob("*.png")):
        script = ROOT / "experiments" / f"{picture.stem.partition('-')[0]}.py"
        if not script.is_file():
            raise ValueError(f"{picture.name} is no picture of an experiment.")
        found.append((picture, script))
    return found


def words_of(script: Path) -> str:
    """The first sentence of a script's docstring, on one line."""
    words = ast.get_docstring(ast.parse(script.read_text())) or ""
    return " ".join(words.partition("\n\n")[0].split())


class Gallery(SphinxDirective):
    """Figures with their captions."""

    def run(self) -> list[nodes.Node]:
        """The figures."""
        made: list[nodes.Node] = []
        for picture, script in pictures():
            self.env.note_dependency(str(script))
            words = words_of(script)
            place = "/" + str(picture.relative_to(ROOT))
            image = nodes.image(uri=place, alt=words, candidates={"*": place.lstrip("/")})
            target = "/" + str(script.relative_to(ROOT))
            link = addnodes.download_reference(
                "", "", nodes.literal(text=target.lstrip("/")), reftarget=target
            )
            link["refdoc"] = self.env.docname
            caption = nodes.caption("", "", nodes.Text(words + " "), link)
            made.append(nodes.figure("", image, caption))
        return made


def setup(app: Sphinx) -> dict[str, bool]:
    """Adds the directive."""
    app.add_directive("gallery", Gallery)
    return {"parallel_read_safe": True}
