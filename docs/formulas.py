"""Formulas of the pages as MathML: browsers typeset it by themselves, so that the pages are read without a network."""

from __future__ import annotations

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

from varcalc.report.formulas import mathml


def setup(app: Sphinx) -> None:
    """Take the place of the script that Sphinx would fetch."""
    app.add_html_math_renderer("mathml", (within_a_line, None), (on_a_line, None))


def within_a_line(page: HTML5Translator, node: nodes.math) -> None:
    """Write a formula among words."""
    page.body.append(f'<span class="math">{mathml(node.astext(), display=False)}</span>')
    raise nodes.SkipNode


def on_a_line(page: HTML5Translator, node: nodes.math_block) -> None:
    """Write a formula on a line of its own."""
    page.body.append(f'<div class="math">{mathml(node.astext())}</div>\n')
    raise nodes.SkipNode
