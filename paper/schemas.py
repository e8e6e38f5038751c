"""Writes the handbook's page of the keys of study, protocol and parameter files.

Usage: python paper/schemas.py
"""

from pathlib import Path

from vehiclemor.files import write_text
from vehiclemor.report.description import SCHEMAS, schema_description
from vehiclemor.report.printing import table

PAGE = Path(__file__).resolve().parent / "handbook" / "study-schema.md"
HEAD = """# Schema of the files

Written by `python paper/schemas.py` from the classes that read the files;
`vehiclemor show study-schema` prints the same. How to use them: [study files](study-files.md).
"""


def page() -> str:
    """The page, from the classes that parse the files."""
    parts = [HEAD]
    for name in SCHEMAS:
        described = schema_description(name)
        parts.append(f"## {name}\n\n{described.pop('summary')}\n")
        described.pop("schema")
        for title, rows in described.items():
            heading = "" if title == "keys" else f"### {title}\n\n"
            parts.append(heading + table(rows, to="markdown"))
    return "\n".join(parts)


if __name__ == "__main__":
    write_text(PAGE, page())
