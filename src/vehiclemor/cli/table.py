"""Tables on the terminal: as wide as that is, 80 columns where there is none."""

import math
import shutil
import textwrap
from collections.abc import Mapping, Sequence


def print_table(rows: Sequence[Mapping[str, object]], digits: int = 6) -> None:
    """Print rows with the same keys, which are the headings; empty columns are left out.

    The first column is never wrapped, and columns of numbers are aligned right; a number that is
    none is a dash.
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
        table.add_row(*(_text(row[heading], digits) for heading in headings))
    console = Console(highlight=False, markup=False)
    with console.capture() as captured:
        console.print(table)
    print("\n".join(line.rstrip() for line in captured.get().splitlines()))


def print_wrapped(line: str, indent: str = "") -> None:
    """Print a line, broken where the terminal ends, but no path; what follows is indented."""
    lines = textwrap.wrap(
        line,
        shutil.get_terminal_size().columns,
        initial_indent=indent,
        subsequent_indent=indent + "  ",
        break_long_words=False,
        break_on_hyphens=False,
    )
    print("\n".join(lines))


def _text(value: object, digits: int) -> str:
    if isinstance(value, list):
        return ", ".join(_text(part, digits) for part in value)
    if isinstance(value, float):
        return "-" if math.isnan(value) else f"{value:.{digits}g}"
    return "" if value is None else str(value)
