"""Tables and texts: one printer, with the headings, formats and meanings of all columns."""

from __future__ import annotations

import json
import math
import shutil
import string
import textwrap
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from vehiclemor.report.labels import label_of

if TYPE_CHECKING:
    import pandas as pd

Format = Literal["terminal", "csv", "markdown", "latex", "html"]
Rows = Sequence[Mapping[str, Any]]
# Columns of a line where there is no terminal, and the most that a wide one is given.
WIDTH, WIDEST = 80, 120
# A column of texts is never narrower, where its texts are longer.
NARROWEST = 12
# Indent of a note.
NOTE = 4


class Column(NamedTuple):
    """How a column is printed.

    Attributes
    ----------
    heading
        Above it.
    form
        Format of its numbers.  An exact zero is a dash where orders of magnitude are compared.
    meaning
        What stands below the table.
    scale
        Factor from the SI unit to the one that is shown.
    """

    heading: str
    form: str = ".6g"
    meaning: str = ""
    scale: float = 1.0


COUNT, ERROR, NUMBER, MICRO = ".0f", ".1e", ".3g", 1e6
COLUMNS = {
    "label": Column("method"),
    # Errors.
    "median": Column("median", ERROR, "median RMS error of the completed runs, SI units"),
    "largest": Column("largest", ERROR, "largest RMS error of the completed runs"),
    "largest_at": Column("largest at"),
    "rms_error": Column("RMS error", ERROR, "against the full-order solution; -: exactly zero"),
    "max_error": Column("largest error", ERROR),
    "signal_range": Column("signal range", ERROR, "largest minus smallest full-order value"),
    "floor": Column(
        "projection error",
        ERROR,
        "RMS error of the best approximation of the coordinates in the method's subspaces, a lower "
        "bound for the coordinates, not for every output",
    ),
    "failed": Column("failed", COUNT),
    "failures": Column("failed", COUNT, "of the different runs of the grid"),
    "warned": Column("untrusted", COUNT, "runs that the method reports as unreliable"),
    "trained": Column("training", COUNT, "tested runs that the method was trained on"),
    "evaluations": Column("evaluations", COUNT, "of the equations of motion, or iterations"),
    "seconds_in_loop": Column(
        "time, us",
        ".1f",
        "median CPU time of the compiled loop, measured once beside other work; compare times with "
        "vehiclemor compare MODEL",
        MICRO,
    ),
    "offline_seconds": Column("offline, s", ".2g", "CPU time of training and fit"),
    # Unseen inputs.
    "misses": Column("missed", COUNT, "runs that violate an error bound"),
    "silent": Column("undetected", COUNT, "missed runs although the method reports ok"),
    "flagged": Column("warned", COUNT, "runs that the method reports as unreliable"),
    "validation_score": Column("validation", NUMBER, "worst error in validation runs, which chose"),
    "score": Column("worst error", NUMBER, "largest error as a multiple of its bound"),
    "seconds": Column("call, us", COUNT, "CPU time of a whole call with all outputs", MICRO),
    "loop_seconds": Column("loop, us", COUNT, "CPU time of its compiled loop", MICRO),
    "ratio_equal": Column("times faster", ".1f", "than the full model at equal worst error"),
    "ratio_equal_loop": Column("loop faster", ".1f", "the same for compiled loops alone"),
    "most": Column("99 % of runs", NUMBER),
    # Costs.
    "us_per_run": Column("time, us", ".1f", "CPU time of a run, median of interleaved rounds"),
    "spread": Column("+- %", COUNT, "half the interquartile range of the rounds, over the median"),
    "speed_up": Column("faster, same", ".2f"),
    "speed_up_strongest": Column("faster, best", ".2f"),
    "offline_us": Column("offline, us", COUNT, "training and fit"),
    "break_even": Column("pays, same", ".1f"),
    "break_even_strongest": Column(
        "pays, best", ".1f", "runs after which a reduced model has earned its training"
    ),
    "tolerance": Column("tolerance", ".0e"),
    "effective_rank": Column("rank", COUNT),
    "nominal": Column("trained run", ERROR, "RMS error in the nominal run, the training"),
    "perturbed": Column(
        "perturbed",
        ERROR,
        "largest RMS error over frequency and amplitude factors of 0.8 to 1.2, training unchanged",
    ),
    # Singular values.
    "median_singular_value": Column(
        "median", ERROR, "singular value over the first, of all control periods"
    ),
    "largest_singular_value": Column("largest", ERROR),
    "largest_left_out": Column(
        "energy left out", ERROR, "largest share of the later modes (equation 8)"
    ),
    # The paper.
    "published": Column("paper", NUMBER),
    "bound": Column("bound", NUMBER),
    "measured": Column("measured", NUMBER),
    "reproduced": Column("reproduced", NUMBER),
    "signal_rms": Column("signal", ERROR, "RMS of the signal itself"),
    "not_comparable": Column("not comparable", COUNT),
    "reason": Column("why"),
}


def column(name: str) -> Column:
    """How a column is printed; one without an entry has its name as heading."""
    kind, _, output = name.partition("_")
    if kind == "rms" and name not in COLUMNS:
        return Column(f"{label_of(output).short} error", ERROR)
    return COLUMNS.get(name) or Column(name.replace("_", " "))


def shown(value: object, form: str = ".6g", scale: float = 1.0) -> str:
    """A value as text: a dash for a missing number, nothing for none."""
    if isinstance(value, list):
        return ", ".join(shown(part, form) for part in value)
    if isinstance(value, float):
        missing = value != value or (value == 0.0 and form == ERROR)
        return "-" if missing else format(scale * value, form)
    return "" if value is None else str(value)


def table(
    rows: pd.DataFrame | Rows,
    columns: Sequence[str] | Mapping[str, Column] = (),
    to: Format = "terminal",
    *,
    group: str = "",
    note: str = "",
    explain: bool = True,
) -> str:
    """Rows as a table.

    Parameters
    ----------
    rows
        A frame, or dictionaries.
    columns
        Names of those that are shown, or how each of them is printed; all by default.
    to
        `terminal`: headings and formats of `COLUMNS`, within the width of the terminal, meanings
        below.  `csv`: names and all digits.  `markdown`, `latex` (needs booktabs): names and four
        digits.  `html`: names, three digits, all digits in the attribute `value`, meanings below.
    group
        Column whose values stand in lines of their own above their rows.
    note
        Column whose texts stand below their rows, over the whole width.
    explain
        Whether meanings stand below.
    """
    if to == "terminal":
        records = rows if isinstance(rows, Sequence) else rows.to_dict("records")
        names = columns or (records[0] if records else ())
        kinds = columns if isinstance(columns, Mapping) else {name: column(name) for name in names}
        return _terminal(records, kinds, group, note) + (legend(kinds.values()) if explain else "")
    import pandas as pd

    frame: Any = pd.DataFrame(rows)
    frame = frame[list(columns)] if columns else frame
    if to == "csv":
        return frame.to_csv(index=False, lineterminator="\n")
    if to == "html":
        cells = frame.rename(columns=lambda name: str(name).replace("_", " ")).map(_html_cell)
        cells.columns = [escape(name) for name in cells.columns]
        own = {name.replace("_", " "): column(name).meaning for name in map(str, frame.columns)}
        meanings = "; ".join(f"{name}: {text}" for name, text in own.items() if text and explain)
        return cells.to_html(index=False, escape=False, border=0) + f"<p>{escape(meanings)}</p>"
    cells = frame.map(_four_digits)
    if to == "latex":
        return cells.to_latex(index=False, escape=True)
    # pandas needs tabulate, which is no dependency.
    escaped = cells.map(lambda text: text.replace("|", "\\|")).values.tolist()
    head, *lines = (f"| {' | '.join(line)} |\n" for line in [map(str, cells.columns), *escaped])
    return f"{head}|{'---|' * len(cells.columns)}\n{''.join(lines)}"


def _four_digits(value: object) -> str:
    if isinstance(value, float):
        return "" if value != value else f"{value:.4g}"
    return "" if value is None else str(value)


def _html_cell(value: object) -> str:
    if isinstance(value, float) and value == value:
        return f'<data value="{value}">{value:.3g}</data>'
    text = escape(shown(value))
    return (
        f'<div class="{text}">{text}</div>' if text in ("met", "missed") else f"<div>{text}</div>"
    )


def _terminal(records: Rows, columns: Mapping[str, Column], group: str, note: str) -> str:
    from rich.console import Console, Group
    from rich.table import Table
    from rich.text import Text

    if group:
        place = {value: i for i, value in enumerate(dict.fromkeys(row[group] for row in records))}
        records = sorted(records, key=lambda row: place[row[group]])
    cells = [
        [shown(row.get(name), kind.form, kind.scale) for name, kind in columns.items()]
        for row in records
    ]
    numbers = [all(isinstance(r.get(name), int | float) for r in records) for name in columns]
    widths = _widths([kind.heading for kind in columns.values()], cells, numbers)
    parts: list[Table | Text] = []

    def start(header: bool) -> None:
        # Tables of equal widths with lines between them look like one.
        part = Table(box=None, show_header=header, pad_edge=False, padding=(0, 1, 0, 0))
        for kind, wide, number in zip(columns.values(), widths, numbers, strict=True):
            justify = "right" if number else "left"
            part.add_column(Text(kind.heading), justify=justify, width=wide, overflow="fold")
        parts.append(part)

    start(header=True)
    last = None
    for row, line in zip(records, cells, strict=True):
        if group and row[group] != last:
            last = row[group]
            parts.append(Text(str(last)))
        if not isinstance(parts[-1], Table):
            start(header=False)
        assert isinstance(parts[-1], Table)
        parts[-1].add_row(*map(Text, line))
        if note and row[note]:
            parts.append(Text(wrapped(str(row[note]), NOTE, NOTE)))
    console = Console(width=width(), color_system=None, highlight=False)
    with console.capture() as captured:
        console.print(Group(*parts))
    return "\n".join(line.rstrip() for line in captured.get().splitlines())


def _widths(heads: list[str], cells: list[list[str]], numbers: list[bool]) -> list[int]:
    """Widths of columns: headings are wrapped by words, then the widest texts."""
    widths = []
    for index, head in enumerate(heads):
        longest = max((len(word) for word in head.split()), default=1)
        widths.append(max(longest, *(len(row[index]) for row in cells), 1))
    texts = [index for index, number in enumerate(numbers) if not number]
    while sum(widths) + len(widths) > width() and texts:
        widest = max(texts, key=lambda index: widths[index])
        if widths[widest] <= NARROWEST:
            break
        widths[widest] -= 1
    # A heading in one line where there is room for all.
    whole = [max(w, len(head)) for w, head in zip(widths, heads, strict=True)]
    return whole if sum(whole) + len(whole) <= width() else widths


def legend(kinds: Iterable[Column]) -> str:
    """Meanings of columns, on new lines; nothing if none needs one."""
    meanings = [f"{kind.heading}: {kind.meaning}" for kind in kinds if kind.meaning]
    return "\n" + wrapped(f"({'; '.join(meanings)}.)", 0, 1) if meanings else ""


def json_text(rows: pd.DataFrame) -> str:
    """Rows as JSON with all digits; what is missing or infinite is null.

    (`DataFrame.to_json` rounds to ten places behind the point: errors would lose their digits.)
    """

    def finite(value: object) -> object:
        return None if isinstance(value, float) and not math.isfinite(value) else value

    plain = [{key: finite(value) for key, value in row.items()} for row in rows.to_dict("records")]
    return json.dumps(plain, indent=2)


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
