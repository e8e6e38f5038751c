"""Matplotlib figures as SVG elements that can stand beside one another in a page."""

from __future__ import annotations

import re
from html import escape
from io import StringIO
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

METADATA = dict.fromkeys(("Date", "Creator", "Format", "Type"))
# What a page has no use for: comments, metadata, namespaces, a size that does not bend.
NEEDLESS = re.compile(
    r'<!--.*?-->|<metadata>.*?</metadata>| (?:xmlns(?::xlink)?|version)="[^"]*"', re.DOTALL
)


def svg_element(figure: Figure, name: str, words: str) -> str:
    """The figure as an element whose ids begin with `name`; `words` stand for what it shows."""
    target = StringIO()
    figure.savefig(target, format="svg", metadata=METADATA, transparent=True)
    text = NEEDLESS.sub("", target.getvalue().partition("<svg")[2]).replace("xlink:href", "href")
    text = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{name}-", text)
    head, end, rest = text.partition(">")
    width = re.search(r'\bwidth="([\d.]+)pt"', head)
    head = re.sub(r' (?:width|height)="[\d.]+pt"', "", head)
    size = f' style="--natural:{float(width[1]) / 72:.2f}in"' if width else ""
    return f'<svg role="img" aria-label="{escape(words)}"{size}{head}{end}{rest}'
