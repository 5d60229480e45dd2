"""Sphinx configuration: `python -m sphinx -W --keep-going -b html docs docs/_build/html`."""

import re
import sys
from importlib.metadata import version as installed_version
from pathlib import Path

sys.path.insert(
    0, str(Path(__file__).parent)
)  # for formulas.py, and gallery.py, which writes a page for each of problems/

project = "varcalc"
copyright = "2026, the varcalc authors"
author = "the varcalc authors"
version = release = installed_version("varcalc")

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "formulas", "gallery"]
exclude_patterns = ["_build"]
html_static_path = ["_static", "gallery/static"]
html_css_files = ["pages.css", "report.css"]
html_math_renderer = "mathml"
html_js_files = [("report.js", {"defer": "defer"})]
html_theme = "furo"
html_title = "varcalc"

autodoc_member_order = "bysource"
# furo copies the contents of all pages for each page: with a thousand names among them, that is half of a build
toc_object_entries = False
autodoc_typehints_format = "short"
napoleon_google_docstring = False
napoleon_use_ivar = True
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3

# A page is executed once, and again only where its code has changed; what it raises, or warns of, fails the build.
nb_execution_mode = "cache"
nb_execution_cache_path = str(Path(__file__).parent / "_build" / "executed")
nb_execution_raise_on_error = True
nb_execution_timeout = 120
nb_execution_in_temp = True
nb_merge_streams = True


def _readable(_app, _what, _name, _object, _options, signature, returned):
    """A signature that Sphinx can parse: a default that is a factory's, or a function, is shown by dots."""
    return (signature and re.sub(r"<factory>|<function <?[\w.]+>?>", "...", signature)), returned


def setup(app):
    """Connect what this page adds to autodoc."""
    app.connect("autodoc-process-signature", _readable)
