"""Tables as text: one printer for all tables that are shown in a terminal."""

from collections.abc import Iterable, Sequence
from io import StringIO
from typing import NamedTuple

WIDTH = 100
# The first column, which may be wrapped, is never narrower.
NARROWEST = 24
# Indents of a table and of the notes in it.
TABLE, NOTE = 2, 6


class Row(NamedTuple):
    """Cells of one row, and a remark over the whole width below them."""

    cells: Sequence[str]
    note: str = ""


def table_text(headings: Sequence[str], rows: Iterable[Row], last_left: bool = False) -> str:
    """A table of at most `WIDTH` columns, its first column wrapped where needed.

    Parameters
    ----------
    headings
        Of the columns, the first of which is aligned left and all others right.
    last_left
        Align the last column left, as text.
    """
    from rich.console import Console, Group
    from rich.padding import Padding
    from rich.table import Table
    from rich.text import Text

    rows = list(rows)
    widths = _widths(headings, rows)

    def started(header: bool) -> Table:
        table = Table(box=None, show_header=header, pad_edge=False, padding=(0, 1, 0, 0))
        last = len(headings) - 1
        for index, (heading, width) in enumerate(zip(headings, widths, strict=True)):
            left = index == 0 or (last_left and index == last)
            justify = "left" if left else "right"
            table.add_column(Text(heading), justify=justify, width=width, vertical="top")
        return table

    # Tables of equal widths with notes between them look like one.
    parts: list[Table | Padding] = [started(header=True)]
    for row in rows:
        table = parts[-1]
        if not isinstance(table, Table):
            table = started(header=False)
            parts.append(table)
        filled = [*row.cells, *[""] * (len(headings) - len(row.cells))]
        table.add_row(*(Text(cell) for cell in filled))
        if row.note:
            parts.append(Padding(Text(row.note), (0, 0, 0, NOTE - TABLE)))
    target = StringIO()
    console = Console(file=target, width=WIDTH, color_system=None, highlight=False)
    console.print(Padding(Group(*parts), (0, 0, 0, TABLE)))
    return "\n".join(line.rstrip() for line in target.getvalue().splitlines())


def _widths(headings: Sequence[str], rows: Sequence[Row]) -> list[int]:
    """Widths of the columns: headings are wrapped by words, cells are not but in the first."""
    widths = [max(map(len, heading.split()), default=0) for heading in headings]
    widths[0] = len(headings[0])
    for row in rows:
        for index, cell in enumerate(row.cells):
            widths[index] = max(widths[index], len(cell))
    # One space follows each column.
    room = WIDTH - TABLE - sum(widths[1:]) - len(widths)
    widths[0] = max(min(widths[0], room), NARROWEST)
    return widths


def fixed(value: float, digits: int = 2) -> str:
    """A number with so many digits after the point; a dash for one that is missing."""
    return "-" if value != value else f"{value:.{digits}f}"


def power(value: float) -> str:
    """A number as 1.2e-5, for columns in which orders of magnitude are compared."""
    return "-" if value != value else f"{value:.1e}".replace(".0e", "e")


def short(value: float) -> str:
    """A number with two digits, with an exponent where it is long without."""
    if value != value:
        return "-"
    return f"{value:.2g}" if 0.01 <= abs(value) < 1e4 or value == 0.0 else f"{value:.1e}"


def wrapped(text: str) -> str:
    """A paragraph in lines of the width of a table."""
    import textwrap

    return "\n".join(textwrap.wrap(text, WIDTH))
