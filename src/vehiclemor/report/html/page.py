"""Sections as the text of one HTML file, from the template beside this file."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from vehiclemor.report.html import interactive
from vehiclemor.report.html.cells import shared_anchor, shared_values
from vehiclemor.report.html.parts import Section

FOLDER = Path(__file__).parent


def page(sections: Sequence[Section], left_out: Mapping[str, str]) -> str:
    """The file's text; `left_out` are results that could not be shown, and why."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(FOLDER),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.policies["json.dumps_kwargs"] = {"separators": (",", ":")}
    cells = {anchor: cell for section in sections for anchor, cell in section.cells.items()}
    plots = [plot for section in sections for plot in section.plots]
    return environment.get_template("report.html.jinja").render(
        title=sections[0].title if len(sections) == 1 else "Results of vehiclemor",
        sections=sections,
        left_out=left_out,
        cells=cells,
        shared=shared_values(cells.values()),
        shared_anchor=shared_anchor,
        plots=plots,
        library=interactive.library() if plots else "",
        interactive=interactive.available(),
        style=(FOLDER / "report.css").read_text(encoding="utf-8"),
        script=(FOLDER / "report.js").read_text(encoding="utf-8"),
    )
