"""Tables on the terminal: as text, every column but the first wrapped where needed; as JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from vehiclemor.report.printing import width

if TYPE_CHECKING:
    import pandas as pd


def print_json(table: pd.DataFrame) -> None:
    """Print rows as JSON with all digits; what is missing or infinite is null.

    (`DataFrame.to_json` rounds to ten places behind the point: errors would lose their digits.)
    """
    plain = [
        {key: _finite(value) for key, value in row.items()} for row in table.to_dict("records")
    ]
    print(json.dumps(plain, indent=2))


def _finite(value: object) -> object:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def print_table(rows: Sequence[Mapping[str, object]]) -> None:
    """Print rows with the same keys, which are the headings; empty columns are left out.

    The first column is never wrapped, and columns of numbers are aligned right.
    """
    from rich.console import Console
    from rich.table import Table

    table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
    headings = [h for h in rows[0] if any(row[h] not in ("", None, [], {}) for row in rows)]
    for heading in headings:
        numbers = all(isinstance(row[heading], int | float) for row in rows)
        table.add_column(
            heading,
            justify="right" if numbers else "left",
            overflow="fold",
            no_wrap=heading == headings[0],
        )
    for row in rows:
        table.add_row(*(_text(row[heading]) for heading in headings))
    console = Console(width=width(), highlight=False, markup=False)
    with console.capture() as captured:
        console.print(table)
    print("\n".join(line.rstrip() for line in captured.get().splitlines()))


def _text(value: object) -> str:
    if isinstance(value, list):
        return ", ".join(_text(part) for part in value)
    if isinstance(value, float):
        return f"{value:.6g}"
    return "" if value is None else str(value)
