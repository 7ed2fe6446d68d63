"""The documentation site: scripts/docs.sh builds it from the Markdown of this folder."""

from __future__ import annotations

import re
from pathlib import Path

from sphinx.application import Sphinx

import surfabet

DOCS = Path(__file__).parent.resolve()
SOURCE = "https://github.com/surfabet/surfabet/blob/main"
LINK = re.compile(r"(?<!!)\[([^\]]*)\]\(((?:\.\./)+[^)\s#]+)(#[^)\s]*)?\)")

project = "surfabet"
author = "surfabet developers"
version = release = surfabet.__version__
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
root_doc = "index"
exclude_patterns = ["pictures"]

html_theme = "furo"
html_title = f"surfabet {version}"
html_copy_source = False
html_theme_options = {"source_repository": "https://github.com/surfabet/surfabet"}

# `bytes` is a type, and a field of several records.
suppress_warnings = ["ref.python"]

myst_heading_anchors = 4
myst_enable_extensions = ["colon_fence"]

# Notebooks are kept without outputs; the build runs them, each in an empty folder.
nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_merge_streams = True

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_default_options = {"members": True, "show-inheritance": True}
napoleon_use_ivar = True
napoleon_use_rtype = False
# Names of shapes and units in single backticks are code.
default_role = "code"
add_module_names = False
python_use_unqualified_type_names = True


def outside(app: Sphinx, name: str, content: list[str]) -> None:
    """Links from a page to files outside of this folder lead to where the source is."""
    folder = (DOCS / name).parent

    def link(match: re.Match[str]) -> str:
        text, path, anchor = match.groups()
        target = (folder / path).resolve()
        if target.is_relative_to(DOCS):
            return match.group(0)
        return f"[{text}]({SOURCE}/{target.relative_to(DOCS.parent)}{anchor or ''})"

    content[0] = LINK.sub(link, content[0])


def setup(app: Sphinx) -> None:
    app.connect("source-read", outside)
