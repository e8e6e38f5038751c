"""Sphinx extension: equations as MathML, which browsers show without a script or a network."""

from typing import Any

from docutils import nodes
from math_core import LatexError, LatexToMathML
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.util.math import get_node_equation_number

LOG = logging.getLogger(__name__)
CONVERTER = LatexToMathML()


def mathml(translator: Any, node: nodes.Element) -> None:
    """Write an equation, inline or displayed."""
    display, text = isinstance(node, nodes.math_block), node.astext().strip()
    if r"\\" in text and r"\begin" not in text:
        text = rf"\begin{{aligned}}{text}\end{{aligned}}"
    number = get_node_equation_number(translator, node) if display and node["number"] else ""
    tag = "div" if display else "span"
    translator.body.append(translator.starttag(node, tag, "", CLASS="math"))
    try:
        equation = CONVERTER.convert_with_local_state(text, displaystyle=display)
    except LatexError as error:
        equation = ""
        LOG.warning("%s: %s", text, str(error), location=node)
    translator.body.append(f'<span class="equation">{equation}</span>')
    if number:
        translator.body.append(f'<span class="eqno">({number})</span>')
    translator.body.append(f"</{tag}>")
    raise nodes.SkipNode


def setup(app: Sphinx) -> None:
    """Register the renderer, `html_math_renderer = "mathml"`."""
    app.add_html_math_renderer("mathml", (mathml, None), (mathml, None))
