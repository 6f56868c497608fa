"""The package's site: README, notebooks with their results, every name with its docstring."""

import re

from sphinx.application import Sphinx

import trepan

project, author, release = "trepan", "The Trepan developers", trepan.__version__
extensions = ["sphinx.ext.autodoc", "sphinx.ext.intersphinx", "myst_nb"]
root_doc, html_theme, html_title = "docs/index", "furo", f"trepan {release}"
include_patterns = ["README.md", "docs/*.md", "notebooks/*.py"]
nb_custom_formats = {".py": ["jupytext.reads", {"fmt": "py:percent"}]}
nb_execution_mode, nb_execution_raise_on_error, nb_execution_timeout = "auto", True, 120
myst_heading_anchors = 3
autodoc_member_order, autodoc_typehints = "bysource", "description"
autodoc_default_options = {"members": True, "undoc-members": True}


def _outside(app: Sphinx, name: str, source: list[str]) -> None:
    """Links to other folders of the repository, which the site does not have, become names."""
    source[0] = re.sub(r"\[([^\]]+)\]\(\.\./[^)]*\)", r"`\1`", source[0])
    source[0] = re.sub(r"\]\(notebooks/(\w+)\.py\)", r"](notebooks/\1)", source[0])


def setup(app: Sphinx) -> None:
    """Registers what changes before Sphinx reads it."""
    app.connect("source-read", _outside)
