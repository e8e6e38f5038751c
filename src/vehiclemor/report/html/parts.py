"""What a report is made of, as the template reads it."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from vehiclemor.report.verdicts import MET, MISSED, VERDICTS


class Entry(NamedTuple):
    """A table cell; one that is a number has it in full in `value`.

    Attributes
    ----------
    anchor
        Id of what it links to in the same file.
    kind
        Class of style: a verdict or a status.
    """

    text: str
    value: float | None = None
    anchor: str = ""
    kind: str = ""


class Table(NamedTuple):
    """A table; `columns` are its headings, `note` stands below, and `id` is what links to it."""

    caption: str
    columns: tuple[str, ...]
    rows: list[list[Entry]]
    note: str = ""
    id: str = ""


class Picture(NamedTuple):
    """A vector figure: the text of an `svg` element, ready to stand in the page."""

    caption: str
    svg: str


class Plot(NamedTuple):
    """Interactive figures beside one another, as the script of the page draws them."""

    id: str
    caption: str
    figures: list[Mapping[str, Any]]


class Cell(NamedTuple):
    """What determines a result: a number's link leads to it."""

    title: str
    configuration: Mapping[str, Any]
    note: str = ""


class Section(NamedTuple):
    """A study, or a comparison.

    Attributes
    ----------
    facts
        Word -> text: where its results come from.
    cells
        Anchor -> cell of every number of its tables.
    source
        Text of the study file.
    """

    id: str
    title: str
    intro: list[str]
    tables: list[Table]
    pictures: list[Picture]
    plots: list[Plot]
    facts: dict[str, str]
    cells: dict[str, Cell]
    source: str = ""


MISSING = Entry("–", kind="none")


def quantity(value: float, anchor: str = "") -> Entry:
    """A number with three digits, linked; a dash for one that is missing."""
    if value != value:
        return MISSING._replace(anchor=anchor)
    large = value != 0.0 and not 0.01 <= abs(value) < 1e3
    text = f"{value:.2e}".replace("e-0", "e-").replace("e+0", "e") if large else f"{value:.3g}"
    return Entry(text, value, anchor)


def count(value: int, anchor: str = "") -> Entry:
    """A whole number."""
    return Entry(str(value), value, anchor)


def judged_entry(verdict: str) -> Entry:
    """A verdict as a badge."""
    kind = verdict if verdict in (MET, MISSED) else "other"
    return Entry(VERDICTS.get(verdict, verdict), kind=kind)
