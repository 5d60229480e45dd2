"""Sphinx configuration."""

from importlib.metadata import version as installed_version

project = "varcalc"
copyright = "2026, the varcalc authors"
author = "the varcalc authors"
version = release = installed_version("varcalc")

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.mathjax", "sphinx.ext.napoleon"]
source_suffix = {".md": "markdown"}
exclude_patterns = ["_build"]
html_theme = "furo"
html_title = "varcalc"

autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
napoleon_google_docstring = False
myst_enable_extensions = ["dollarmath"]
