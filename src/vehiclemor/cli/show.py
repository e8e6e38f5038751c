"""`vehiclemor show`: everything that a name declares."""

import json
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from vehiclemor import api
from vehiclemor.cli.key_values import key_values
from vehiclemor.report.printing import table, wrapped


def show(
    name: str,
    *,
    parameter: Annotated[tuple[str, ...], Parameter(negative="", show_default=False)] = (),
    parameters: Path | None = None,
    json_output: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> int:
    """Show what a name declares: parameters, settings, inputs, outputs, grid.

    Parameters
    ----------
    name
        A model, method, maneuver or study, a study's TOML file, or study-schema, protocol-schema,
        parameter-schema: the keys of such a file.
    parameter
        name=value: a parameter of a model, SI units; may be given several times.
    parameters
        Parameter file of a model; its own public data by default.
    json_output
        Print JSON.
    """
    described = api.describe(name, key_values("--parameter", parameter), parameters)
    if json_output:
        print(json.dumps(described, indent=2))
        return 0
    for key, content in described.items():
        _print(key, content)
    return 0


def _print(key: str, content: object, indent: str = "") -> None:
    """A table of rows, lines below a heading, or one line; nothing where there is nothing."""
    if isinstance(content, dict):
        print(f"\n{key}:")
        for name, part in content.items():
            _print(name, part, "  ")
    elif isinstance(content, list) and content and isinstance(content[0], dict):
        for heading, rows in _by_source(key, content).items():
            print(f"\n{heading}:")
            print(table(rows))
    elif content:
        text = ", ".join(map(str, content)) if isinstance(content, list) else content
        print(wrapped(f"{key}: {text}", len(indent), len(indent) + 2))


def _by_source(key: str, rows: list[dict[str, object]]) -> dict[str, list[dict[str, object]]]:
    """Heading -> rows: those that have a source stand together, since columns would not fit."""
    found: dict[str, list[dict[str, object]]] = {}
    for row in rows:
        rest = {name: value for name, value in row.items() if name not in ("status", "source")}
        heading = f"{key}, {row['status']} ({row['source']})" if "status" in row else key
        found.setdefault(heading, []).append(rest if "status" in row else row)
    return found
