"""Configurations of cells: read from their files; long values that many share stand once."""

import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from vehiclemor.errors import FileError
from vehiclemor.report.html.parts import Cell
from vehiclemor.study.store import read_cell

# A value whose JSON is longer stands apart, once for all cells that have it.
LONG = 240
UNNAMED = "Stored by an older version, which did not name the cells of a study."
MISSING = "The cell's own file is not among the results: this is what the study's file says of it."


def stored_cell(folder: Path, key: str, known: Mapping[str, Any]) -> Cell:
    """A cell by its key; where its file is gone what is `known` of it."""
    try:
        found = json.loads(read_cell(folder, key).configuration)
    except FileError:
        return Cell(f"cell {key}", known, MISSING)
    tests = found["test"]
    run = tests[0]
    words = ", ".join(f"{n} {run[n]:g}" for n in ("frequency", "amplitude") if run[n] != 1.0)
    told = (
        [run["maneuver"], words, str(run["start"])] if len(tests) == 1 else [f"{len(tests)} runs"]
    )
    return Cell(f"cell {key}: {found['method']}, {', '.join(filter(None, told))}", found)


def shared_values(cells: Iterable[Cell]) -> dict[str, Any]:
    """Anchor -> long value of configurations."""
    return {
        anchor: value
        for cell in cells
        for value in cell.configuration.values()
        if (anchor := shared_anchor(value))
    }


def shared_anchor(value: Any) -> str:
    """Anchor of a value that stands apart; empty for a short one."""
    text = json.dumps(value, sort_keys=True)
    return f"value-{hashlib.sha256(text.encode()).hexdigest()[:12]}" if len(text) > LONG else ""
