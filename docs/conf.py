"""Sphinx: pages in Markdown, executed examples, API reference.  `tox -e docs` builds the site."""

import logging
import re
import sys
from pathlib import Path

from sphinx.application import Sphinx

DOCS = Path(__file__).parent
# Beside this file is `examples`.
sys.path.insert(0, str(DOCS))

import vehiclemor  # noqa: E402

# No page tells how long something took to compile.
logging.getLogger("vehiclemor").setLevel(logging.WARNING)
project, release = "vehiclemor", vehiclemor.__version__
author = "The vehiclemor developers"
extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx_copybutton",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = ["_build", "gallery/*.ipynb"]
nitpicky = True
# Types in signatures are as written in the source; most have no entry here.
nitpick_ignore_regex = [("py:.*", ".*")]
# In docstrings a name between single backticks is code.
default_role = "code"

myst_enable_extensions = ["attrs_block", "attrs_inline", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3

autodoc_member_order = "bysource"
numpydoc_show_class_members = False

sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "gallery",
    "filename_pattern": r"\.py$",
    "within_subsection_order": "examples.in_order",
    "image_scrapers": ("examples.picture", "matplotlib"),
    "notebook_extensions": (),
    "reset_modules": ("matplotlib", "examples.fresh"),
    "capture_repr": (),
    "image_srcset": ["2x"],
    "download_all_examples": False,
    "show_signature": False,
    "write_computation_times": False,
    "min_reported_time": 1e6,
}

html_theme = "pydata_sphinx_theme"
html_title = f"vehiclemor {release}"
html_theme_options = {
    "navbar_center": [],
    "secondary_sidebar_items": ["page-toc"],
    "show_prev_next": False,
    "footer_start": ["copyright"],
    "footer_end": [],
}
html_sidebars = {"**": ["pages.html"]}
copybutton_prompt_text = "$ "
templates_path = ["_templates"]
html_show_sourcelink = False
html_css_files = ["site.css"]
html_static_path = ["_static"]


def adapted(_: Sphinx, _name: str, source: list[str]) -> None:
    """Links to examples lead to their pages; in tables no line breaks within 4.9e-7."""
    source[0] = source[0].replace("(../examples/README.rst)", "(gallery/index.rst)")
    source[0] = re.sub(r"\(\.\./examples/(\w+)\.py\)", r"(gallery/\1.rst)", source[0])
    rows = re.compile(r"^\|.*", re.MULTILINE)
    source[0] = rows.sub(lambda row: re.sub(r"(?<=\de)-(?=\d+ )", "\u2011", row[0]), source[0])


def write_file_reference(app: Sphinx) -> None:
    """Write the page of the keys of study and parameter files, from the classes that read them."""
    from vehiclemor.report.description import SCHEMAS, schema_description

    parts = ["# Keys of study and parameter files\n"]
    for name in SCHEMAS:
        described = schema_description(name)
        parts.append(f"## {name}\n\n{described.pop('summary')}\n")
        described.pop("schema")
        for title, rows in described.items():
            heading = "" if title == "keys" else f"### {title}\n\n"
            parts.append(heading + markdown(rows))
    path = Path(app.srcdir) / "study-file-reference.md"
    path.write_text("\n".join(parts), encoding="utf-8")


def markdown(rows: list[dict[str, object]]) -> str:
    """Rows as a table; a missing value is empty."""
    lines = [[*rows[0]], ["---"] * len(rows[0])]
    for row in rows:
        values = ("" if value is None else value for value in row.values())
        lines.append([f"{v:.4g}" if isinstance(v, float) else str(v) for v in values])
    escaped = ([text.replace("|", "\\|") for text in line] for line in lines)
    return "".join(f"| {' | '.join(line)} |\n" for line in escaped)


def setup(app: Sphinx) -> None:
    """Tell Sphinx of the functions above."""
    app.connect("source-read", adapted)
    app.connect("builder-inited", write_file_reference)
