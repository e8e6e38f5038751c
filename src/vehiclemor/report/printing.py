"""Tables as text: one printer for all tables that are shown in a terminal."""

import shutil
import string
import textwrap
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from io import StringIO
from typing import NamedTuple

# Columns of a line where there is no terminal, and the most that a wide one is given.
WIDTH, WIDEST = 80, 120
# The first column, which may be wrapped, is never narrower.
NARROWEST = 12
# The longest word in a heading of a table without room.
SHORT_WORD = 7
# Indents of a table and of the notes in it.
TABLE, NOTE = 2, 6


class Line(NamedTuple):
    """Cells of one row of a table, a heading above and a remark below, over the whole width."""

    cells: Sequence[str]
    note: str = ""
    heading: str = ""


class Footnotes:
    """Letters for phrases that stand in several rows, explained once below them."""

    def __init__(self) -> None:
        self._letters: dict[str, str] = {}

    def marks(self, *phrases: str) -> str:
        """The letters of phrases, such as `[a][c]`; an empty one has none."""
        for phrase in phrases:
            if phrase:
                self._letters.setdefault(phrase, alphabetic(len(self._letters)))
        return "".join(f"[{self._letters[phrase]}]" for phrase in phrases if phrase)

    def text(self) -> str:
        """All phrases with their letters."""
        return "\n".join(
            wrapped(f"[{letter}] {phrase}", TABLE, NOTE) for phrase, letter in self._letters.items()
        )


def ends_text(statuses: Iterable[str], warned: int = 0) -> str:
    """How runs have ended, such as `2 diverged, 12 ok (9 not to be trusted)`."""
    text = ", ".join(f"{n} {status}" for status, n in sorted(Counter(statuses).items()))
    return text.replace(" ok", f" ok ({warned} not to be trusted)") if warned else text


def alphabetic(index: int) -> str:
    """A letter for each index: a, b ... z, aa, ab ..."""
    alphabet = string.ascii_lowercase
    head = alphabetic(index // len(alphabet) - 1) if index >= len(alphabet) else ""
    return head + alphabet[index % len(alphabet)]


def width() -> int:
    """Columns of a printed line: the terminal's, but neither below 80 nor too wide to read."""
    return min(max(shutil.get_terminal_size((WIDTH, 24)).columns, WIDTH), WIDEST)


def table_text(headings: Sequence[str], rows: Iterable[Line], left: Sequence[int] = (0,)) -> str:
    """A table that fits the terminal, its first column wrapped where needed.

    Parameters
    ----------
    headings
        Of the columns.
    left
        Columns that are aligned left; all others are aligned right.
    """
    from rich.console import Console, Group
    from rich.padding import Padding
    from rich.table import Table
    from rich.text import Text

    rows = list(rows)
    widths = _widths(headings, rows)
    words = [word for row in rows for cell in row.cells[:1] for word in cell.split()]
    if widths[0] < max(map(len, words), default=0):
        headings = [headings[0], *map(_abbreviated, headings[1:])]
        widths = _widths(headings, rows)

    def started(header: bool) -> Table:
        table = Table(box=None, show_header=header, pad_edge=False, padding=(0, 1, 0, 0))
        for index, (heading, columns) in enumerate(zip(headings, widths, strict=True)):
            justify = "left" if index in left else "right"
            table.add_column(Text(heading), justify=justify, width=columns, vertical="top")
        return table

    # Tables of equal widths with text between them look like one.
    parts: list[Table | Padding] = [started(header=True)]
    for row in rows:
        if row.heading:
            parts.append(Padding(Text(row.heading), 0))
        if row.cells:
            table = parts[-1]
            if not isinstance(table, Table):
                table = started(header=False)
                parts.append(table)
            filled = [*row.cells, *[""] * (len(headings) - len(row.cells))]
            table.add_row(*(Text(cell) for cell in filled))
        if row.note:
            parts.append(Padding(Text(row.note), (0, 0, 0, NOTE - TABLE)))
    target = StringIO()
    console = Console(file=target, width=width(), color_system=None, highlight=False)
    console.print(Padding(Group(*parts), (0, 0, 0, TABLE)))
    return "\n".join(line.rstrip() for line in target.getvalue().splitlines())


def _abbreviated(heading: str) -> str:
    """A heading whose long words are cut, such as `displa. max`."""
    return " ".join(f"{w[:6]}." if len(w) > SHORT_WORD else w for w in heading.split())


def _widths(headings: Sequence[str], rows: Sequence[Line]) -> list[int]:
    """Widths of the columns: headings are wrapped by words, cells are not but in the first."""
    widths = [max(map(len, heading.split()), default=0) for heading in headings]
    widths[0] = len(headings[0])
    for row in rows:
        for index, cell in enumerate(row.cells):
            widths[index] = max(widths[index], len(cell))
    # One space follows each column.
    room = width() - TABLE - sum(widths[1:]) - len(widths)
    widths[0] = max(min(widths[0], room), NARROWEST)
    return widths


def fixed(value: float, digits: int = 2) -> str:
    """A number with so many digits after the point; a dash for one that is missing."""
    return "-" if value != value else f"{value:.{digits}f}"


def power(value: float) -> str:
    """A number as 1.2e-5, for columns in which orders of magnitude are compared.

    A dash for one that is missing, or exactly zero.
    """
    return "-" if value != value or value == 0.0 else f"{value:.1e}"


def short(value: float) -> str:
    """A number with two digits, with an exponent where it is long without."""
    if value != value:
        return "-"
    return f"{value:.2g}" if 0.01 <= abs(value) < 1e4 or value == 0.0 else f"{value:.1e}"


def number(value: float) -> str:
    """A number with three digits; a dash for one that is missing."""
    return "-" if value != value else f"{value:.3g}"


def wrapped(text: str, first: int = 0, rest: int = 0) -> str:
    """A paragraph in lines of the width of a table, indented."""
    return "\n".join(
        textwrap.wrap(
            text,
            width(),
            initial_indent=" " * first,
            subsequent_indent=" " * rest,
            # A path stays whole.
            break_long_words=False,
            break_on_hyphens=False,
        )
    )


def terms(meanings: Mapping[str, str]) -> str:
    """A legend: each term with its meaning, later lines indented."""
    return "\n".join(wrapped(f"{term}: {text}.", 0, 4) for term, text in meanings.items())
