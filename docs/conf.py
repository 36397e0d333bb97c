"""Settings of the documentation site: `make docs`.

The repository itself is the source folder, so that pages link to notebooks, experiments and each
other on the site as they do in the checkout.
"""

import os
import sys
from importlib import metadata
from pathlib import Path

from pygments.lexers.special import TextLexer
from sphinx.highlighting import lexers

ROOT = Path(__file__).parents[1]
# Walks are simulated for a page; else JAX tells of accelerators that it does not find.
os.environ.setdefault("JAX_PLATFORMS", "cpu")
sys.path[:0] = [str(ROOT / "docs" / "_ext")]

project = "jaxbiped"
author = "the jaxbiped developers"
project_copyright = "the jaxbiped developers"
release = version = metadata.version("jaxbiped")

root_doc = "docs/index"
include_patterns = ["docs/**", "notebooks/*.ipynb", "*.md"]
exclude_patterns = ["docs/_*/**"]
extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.intersphinx",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
    "gallery",
    "markdown_tables",
    "mathml",
    "public_names",
    "watched_walks",
]

# Lessons are kept with the outputs of a run at full size; EXECUTE=force runs them again.
nb_execution_mode = os.environ.get("EXECUTE", "off")
nb_execution_timeout = 1800
nb_execution_raise_on_error = True
nb_merge_streams = True
myst_enable_extensions = ["dollarmath", "deflist", "colon_fence"]
myst_heading_anchors = 4
# Pages load nothing from a network.
html_math_renderer = "mathml"
myst_update_mathjax = False

default_role = "py:obj"
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
autodoc_member_order = "bysource"
autodoc_class_signature = "mixed"
autodoc_typehints_format = "short"
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False
# Without a network, names of other libraries are left without links.
intersphinx_mapping: dict[str, tuple[str, None]] = {}

html_theme = "furo"
html_title = f"jaxbiped {release}"
html_additional_pages = {"index": "forward.html"}
templates_path = ["_templates"]
html_copy_source = False
html_show_sphinx = False

# A drawing in words, which hosts of repositories draw.
lexers["mermaid"] = TextLexer()
