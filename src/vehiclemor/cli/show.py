"""`vehiclemor show`: everything that a name declares."""

import json
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from vehiclemor import api
from vehiclemor.cli.key_values import key_values
from vehiclemor.report.printing import table, wrapped

# Rows of a table that are printed without --all, where it has some more.
FEW, SOME = 4, 6


def show(
    name: str,
    *,
    parameter: Annotated[tuple[str, ...], Parameter(negative="", show_default=False)] = (),
    parameters: Path | None = None,
    every: Annotated[bool, Parameter(name="--all", negative="")] = False,
    json_output: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> int:
    """Show what a name declares: parameters, settings, inputs, outputs, grid.

    Parameters
    ----------
    name
        A model, method, maneuver or study, a study's TOML file, or study-schema,
        parameter-schema: the keys of such a file.
    parameter
        name=value: a parameter of a model, SI units; may be given several times.
    parameters
        Parameter file of a model; its own public data by default.
    every
        Print long tables of a model as a whole, not only their first rows.
    json_output
        Print JSON.
    """
    described = api.describe(name, key_values("--parameter", parameter), parameters)
    if json_output:
        print(json.dumps(described, indent=2))
        return 0
    few = name in api.models() and not every
    cut = sum([_print(key, content, few) for key, content in described.items()])
    if cut:
        print(f"\n{cut} more rows: vehiclemor show {name} --all")
    return 0


def _print(key: str, content: Any, few: bool, indent: str = "") -> int:
    """Print a table of rows, lines below a heading, or a line; how many rows are left out."""
    if isinstance(content, dict):
        print(f"\n{key}:")
        return sum([_print(name, part, few, "  ") for name, part in content.items()])
    if not (isinstance(content, list) and content and isinstance(content[0], dict)):
        if content:
            text = ", ".join(map(str, content)) if isinstance(content, list) else content
            print(wrapped(f"{key}: {text}", len(indent), len(indent) + 2))
        return 0
    shown = content[:FEW] if few and len(content) > SOME else content
    cut = len(content) - len(shown)
    for heading, rows in _by_source(key, shown).items():
        columns = [name for name in rows[0] if any(r[name] not in ("", None, [], {}) for r in rows)]
        more = f" ({len(shown)} of {len(content)})" if cut else ""
        print(f"\n{wrapped(f'{heading}{more}:', 0, 2)}\n{table(rows, columns, explain=False)}")
    return cut


def _by_source(key: str, rows: list[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    """Heading -> rows: those that have a source stand together, since columns would not fit."""
    found: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        rest = {name: value for name, value in row.items() if name not in ("status", "source")}
        heading = f"{key}, {row['status']} ({row['source']})" if "status" in row else key
        found.setdefault(heading, []).append(rest if "status" in row else row)
    return found
