"""Tables and texts: rows in the terminal and in HTML."""

from __future__ import annotations

import json
import math
import shutil
import textwrap
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

from vehiclemor.report.labels import ERROR, TRAINED, Column, column, trained_runs

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

Rows = Sequence[Mapping[str, Any]]
# Variable of a simulation -> column that is printed for each output.
ERRORS = {"rms_error": "rms_error", "floor_rms_error": "floor", "max_error": "max_error"}
ERRORS |= {"signal_range": "signal_range", "output_unit": "unit"}


@dataclass(frozen=True)
class Table:
    """Rows as a table: text within the width of the terminal by `str`, HTML for a template.

    `columns` are names of those that are shown, by default all, or how each of them is printed, by
    default as `labels.column` has it.  Values of `group` stand above their rows, those of `note`
    below each row; meanings of the columns below the table, if it is to `explain`.
    """

    rows: pd.DataFrame | Rows
    columns: Sequence[str] | Mapping[str, Column] = ()
    title: str = ""
    group: str = ""
    note: str = ""
    explain: bool = True
    below: str = ""

    def _records(self) -> Rows:
        return self.rows if isinstance(self.rows, Sequence) else self.rows.to_dict("records")  # type: ignore[return-value]

    def _groups(self, records: Rows) -> Mapping[str, Rows]:
        return grouped(records, self.group) if self.group else {"": records}

    def _kinds(self, records: Rows) -> tuple[Mapping[str, Column], str]:
        """How each column is printed, and what the columns mean."""
        kinds = self.columns
        if not isinstance(kinds, Mapping):
            kinds = {name: column(name) for name in kinds or (records[0] if records else ())}
        meanings = [f"{kind.heading}: {kind.meaning}" for kind in kinds.values() if kind.meaning]
        return kinds, f"({'; '.join(meanings)}.)" if meanings and self.explain else ""

    def __html__(self) -> str:
        records = self._records()
        kinds, meanings = self._kinds(records)
        wide = f'<tr><td colspan="{len(kinds)}"><div>%s</div></td></tr>'
        heads = "".join(f"<th>{escape(kind.heading)}</th>" for kind in kinds.values())
        lines = [f"<tr>{heads}</tr>"]
        for group, rows in self._groups(records).items():
            if group:
                lines.append(wide % f"<b>{escape(group)}</b>")
            for row in rows:
                cells = (f"<td>{_cell(row.get(name), kind)}</td>" for name, kind in kinds.items())
                lines.append(f"<tr>{''.join(cells)}</tr>")
                if self.note and row[self.note]:
                    lines.append(wide % escape(row[self.note]))
        caption = f"<h3>{escape(self.title)}</h3>" if self.title else ""
        texts = (f"<p>{escape(text)}</p>" for text in (meanings, self.below) if text)
        return "".join([caption, "<table>", *lines, "</table>", *texts])

    def __str__(self) -> str:
        records = self._records()
        kinds, meanings = self._kinds(records)
        cells = [_texts(row, kinds) for row in records]
        numbers = [_are_numbers(row.get(name) for row in records) for name in kinds]
        heads = [kind.heading for kind in kinds.values()]
        widths = _widths(heads, cells, numbers)
        # Headings stand at the bottom of their lines.
        lines = [wrapped(self.title), *_in_columns(heads, widths, numbers, -1)]
        for group, rows in self._groups(records).items():
            lines.append(wrapped(group, 0, 2))
            for row in rows:
                lines += _in_columns(_texts(row, kinds), widths, numbers)
                if self.note:
                    lines.append(wrapped(row[self.note], 4, 4))
        lines += [wrapped(text, 0, 1) for text in (meanings, self.below)]
        return "\n".join(filter(None, lines))


def grouped(rows: Rows, key: str) -> dict[Any, list[Any]]:
    """Rows by the value of a column, in the order of the first of each."""
    groups: dict[Any, list[Any]] = {}
    for row in rows:
        groups.setdefault(row[key], []).append(row)
    return groups


def _texts(row: Mapping[str, Any], kinds: Mapping[str, Column]) -> list[str]:
    return [format_value(row.get(name), kind.form, kind.scale) for name, kind in kinds.items()]


def _are_numbers(values: Iterable[object]) -> bool:
    return all(isinstance(value, int | float) for value in values)


def format_value(value: object, form: str = ".6g", scale: float = 1.0) -> str:
    """A value as text: a dash for a missing number, `0` for exactly zero, nothing for none."""
    if isinstance(value, list):
        return ", ".join(format_value(part, form) for part in value)
    if isinstance(value, float):
        if value != value:
            return "-"
        return "0" if value == 0.0 and form == ERROR else format(scale * value, form)
    return "" if value is None else str(value)


def _cell(value: object, kind: Column) -> str:
    """A value in HTML; a number with all its digits."""
    text = escape(format_value(value, kind.form, kind.scale))
    if isinstance(value, float) and value == value:
        return f'<data value="{value}">{text}</data>'
    verdict = f' class="{text}"' if text in ("met", "missed") else ""
    return f"<div{verdict}>{text}</div>"


def _in_columns(
    cells: Sequence[str], widths: list[int], numbers: list[bool], order: int = 1
) -> list[str]:
    """Lines of a row whose texts are wrapped within their columns."""
    texts: list[list[str]] = []
    for text, width in zip(cells, widths, strict=True):
        # Further lines of a point in a list stand below its text.
        indent = "  " if text.startswith("- ") else ""
        parts = textwrap.wrap(text, width, break_on_hyphens=False, subsequent_indent=indent)
        texts.append(parts[::order])
    aligned = [str.rjust if number else str.ljust for number in numbers]
    lines: list[str] = []
    for line in zip_longest(*texts, fillvalue=""):
        padded = [
            align(part, width) for align, part, width in zip(aligned, line, widths, strict=True)
        ]
        lines.append(" ".join(padded).rstrip())
    return lines[::order]


def _widths(heads: list[str], cells: list[list[str]], numbers: list[bool]) -> list[int]:
    """Widths of columns: headings are wrapped by words, then the widest texts."""
    widths: list[int] = []
    for index, head in enumerate(heads):
        longest = max((len(word) for word in head.split()), default=1)
        widths.append(max(longest, *(len(row[index]) for row in cells), 1))
    texts = [index for index, number in enumerate(numbers) if not number]
    while sum(widths) + len(widths) > width() and texts:
        widest = max(texts, key=lambda index: widths[index])
        if widths[widest] <= 12:
            break
        widths[widest] -= 1
    # A heading in one line where there is room for all.
    wider = [max(w, len(head)) for w, head in zip(widths, heads, strict=True)]
    return wider if sum(wider) + len(wider) <= width() else widths


def simulation_text(dataset: xr.Dataset, shown: Sequence[str], counts: Iterable[str]) -> str:
    """Status, a table of the errors of some outputs, solver counts and seconds of a simulation."""
    note = f" ({TRAINED})" if trained_runs(dataset) else ""
    ended = f"{dataset['status'].item()} {dataset['message'].item()}"
    errors = dataset.sel(output=[*shown]).reset_coords()[[*ERRORS]].rename(ERRORS)
    further = dataset.sizes["output"] - len(shown)
    seconds, clock = float(dataset["seconds"]), dataset["seconds"].attrs["clock"]
    parts = [
        wrapped(f"{dataset.attrs['title']}{note}: {ended}"),
        wrapped(str(dataset["remark"].item())),
        str(Table(errors.to_dataframe().reset_index())),
        f"{further} more outputs: --all-outputs" if further else "",
        wrapped(", ".join(f"{n.replace('_', ' ')} {dataset[n].item()}" for n in counts)),
        f"seconds in the compiled loop {seconds:.3e} ({clock})",
    ]
    return "\n".join(filter(None, parts))


def json_text(rows: pd.DataFrame) -> str:
    """Rows as JSON with all digits; what is missing or infinite is null.

    (`DataFrame.to_json` rounds to ten places behind the point: errors would lose their digits.)
    """
    unknown = rows.isna() | rows.isin([math.inf, -math.inf])
    return json.dumps(rows.astype(object).mask(unknown, None).to_dict("records"), indent=2)


def ends_text(statuses: Iterable[str], warned: int = 0) -> str:
    """How runs have ended, such as `2 diverged, 12 ok (9 untrusted)`."""
    text = ", ".join(f"{n} {status}" for status, n in sorted(Counter(statuses).items()))
    return text.replace(" ok", f" ok ({warned} untrusted)") if warned else text


def width() -> int:
    """Columns of a printed line: the terminal's, but neither below 80 nor too wide to read."""
    return min(max(shutil.get_terminal_size((80, 24)).columns, 80), 120)


def wrapped(text: str, first: int = 0, rest: int = 0) -> str:
    """A paragraph in lines of the width of a table, indented; a path is not broken."""
    indents: dict[str, Any] = {"initial_indent": " " * first, "subsequent_indent": " " * rest}
    return textwrap.fill(text, width(), **indents, break_long_words=False, break_on_hyphens=False)
