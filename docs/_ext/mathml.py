"""Mathematics as MathML, which browsers draw themselves: pages load no script for it."""

import re

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

_UNDER_AN_ACCENT = re.compile(
    r"<munderover>(\s*<mi>\w</mi>)(\s*<(mi|mn|mrow|msub)>(?:(?!<munder|<mover).)*?</\3>)"
    r"(\s*<mo[^>]*>[˙¨]</mo>\s*)</munderover>",
    re.DOTALL,
)
"""An index that the converter puts below a letter with dots, where it belongs beside the letter."""


def mathml(formula: str, *, as_block: bool) -> str:
    """A formula of LaTeX as MathML."""
    beside = r'<msub><mover accent="true">\1\4</mover>\2</msub>'
    return _UNDER_AN_ACCENT.sub(beside, tex2mathml(formula, as_block=as_block))


def inline(translator: HTML5Translator, node: nodes.math) -> None:
    """Writes a formula in a line of text."""
    translator.body.append(mathml(node.astext(), as_block=False))
    raise nodes.SkipNode


def block(translator: HTML5Translator, node: nodes.math_block) -> None:
    """Writes a formula on lines of its own, which scroll if the page is too narrow for them."""
    formula = mathml(node.astext(), as_block=True)
    translator.body.append(f'<div class="math" style="overflow-x: auto">{formula}</div>\n')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Adds the renderer `html_math_renderer = "mathml"`."""
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    return {"parallel_read_safe": True}
