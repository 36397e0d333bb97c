"""Page and scripts of the viewer: one file of HTML that needs no network."""

import abc
import base64
import html
import json
import re
from importlib.resources import files
from pathlib import Path

import numpy as np
import numpy.typing as npt

from jaxbiped._files import check_writable_file
from jaxbiped._types import JsonObject

_MODULES = (
    "dom",
    "channels",
    "pose",
    "stage",
    "chart",
    "linked_charts",
    "player",
    "step_table",
    "view",
    "basin",
    "simulator",
    "playground",
)
"""In the order of their imports."""
_IMPORT = re.compile(r'^import \{[^}]*\} from "\./\w+\.js";\n', re.MULTILINE)
_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'{more}; style-src 'unsafe-inline'; img-src data:"
)
_PAGE = """\
<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<link rel="icon" href="data:,">
<title>{title}</title>
<style>
body {{ margin: 0; }}
@media (prefers-color-scheme: dark) {{ body {{ background: #16181d; color: #f0f0f0; }} }}
{style}</style>
</head>
<body>
<main><noscript>This page plays a walk, which takes JavaScript.</noscript></main>
<script type="application/json" id="walks">{walks}</script>
<script type="module">
{script}showPage();
</script>
</body>
</html>
"""


class AbstractPage(abc.ABC):
    """What is shown as one page of HTML."""

    @abc.abstractmethod
    def html(self) -> str:
        """One page of HTML that holds everything and needs no network."""

    def save(self, path: str | Path) -> Path:
        """Writes that page, and returns its path."""
        where = check_writable_file("path", path)
        where.write_text(self.html(), encoding="utf-8")
        return where


def page_of(sent: JsonObject, title: str, *, computes: bool = False) -> str:
    """A page of HTML that holds everything: what `showWalks` is sent, its script and its look.

    A page that `computes` may run WebAssembly.
    """
    return _PAGE.format(
        policy=_POLICY.format(more=" 'wasm-unsafe-eval'" if computes else ""),
        title=html.escape(title),
        style=style(),
        # No text within ends the script.
        walks=json.dumps(sent, allow_nan=False).replace("<", "\\u003c"),
        script=script(*_MODULES, "page"),
    )


def frame_of(page: str, title: str, height: int) -> str:
    """A page in a frame of this height [px], for a notebook."""
    return (
        f'<iframe srcdoc="{html.escape(page)}" sandbox="allow-scripts" '
        f'title="{html.escape(title)}" style="width: 100%; height: {height}px; border: 0"></iframe>'
    )


def base64_of(values: npt.ArrayLike, kind: str) -> str:
    """Numbers as they are sent, of a kind such as "<f8"."""
    return base64.b64encode(np.asarray(values, dtype=kind).tobytes()).decode("ascii")


def widget_script() -> str:
    """The viewer as a module for `anywidget`."""
    return script(*_MODULES, "widget") + "\nexport default { render };\n"


def style() -> str:
    """The viewer's style sheet."""
    return _asset("view.css")


def script(*modules: str) -> str:
    """Modules of the viewer as one, behind each other: their names are known to all."""
    parts = [_IMPORT.sub("", _asset(f"{name}.js")) for name in modules]
    return re.sub(r"^export ", "", "".join(parts), flags=re.MULTILINE)


def _asset(name: str) -> str:
    return files("jaxbiped.plot.viewer").joinpath("assets", name).read_text(encoding="utf-8")
