"""Words, symbols and units of outputs; headings, number formats and meanings of columns."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

from vehiclemor.resources import data_folder
from vehiclemor.toml_files import FileSchema, read_toml

if TYPE_CHECKING:
    import xarray as xr


class Label(NamedTuple):
    """How one output is called.

    Attributes
    ----------
    words
        In full.
    symbol
        As a formula for figures.
    short
        Heading of a narrow column.
    """

    words: str
    symbol: str
    short: str


# What is said of a run that was in its own training, and the mark of it in a legend.
TRAINED, MARK = "trained on this run", "*"
# Words of an axis that leave no room for more beside them.
LONG = 16
# Of a label beside a low panel in one line.
LONGEST = 26
PREFIXES = ((1e3, "m"), (1e6, "µ"), (1e9, "n"))


class Column(NamedTuple):
    """How a column is printed.

    Attributes
    ----------
    heading
        Above it.
    form
        Format of its numbers.
    meaning
        What stands below the table.
    scale
        Factor from the SI unit to the one that is shown.
    """

    heading: str
    form: str = ".6g"
    meaning: str = ""
    scale: float = 1.0


# Format of errors: an exact zero is a dash, since orders of magnitude are compared.
ERROR = ".1e"


class LabelFile(FileSchema):
    """Schema of `data/figures/labels.toml`."""

    outputs: dict[str, list[str]]
    columns: dict[str, list[str | float]]


@cache
def declared() -> tuple[dict[str, Label], dict[str, Column]]:
    """Labels of outputs, and how columns are printed."""
    file = read_toml(data_folder() / "figures" / "labels.toml", LabelFile)
    columns: Any = file.columns
    return (
        {name: Label(*entry) for name, entry in file.outputs.items()},
        {name: Column(*entry) for name, entry in columns.items()},
    )


def column(name: str) -> Column:
    """How a column is printed; one without an entry has its name as heading."""
    if found := declared()[1].get(name):
        return found
    if name.startswith("rms_"):
        return Column(f"{label_of(name.removeprefix('rms_')).short} error", ERROR)
    return Column(name.replace("_", " "))


def label_of(output: str) -> Label:
    """The label of an output; of one that has no symbol its name in words."""
    words = output.replace("_", " ")
    return declared()[0].get(output, Label(words, words, words))


def full_label(output: str, between: str = " ") -> str:
    """Words and symbol of an output; words alone may be those of two."""
    label = label_of(output)
    return label.words if label.symbol == label.words else f"{label.words}{between}{label.symbol}"


def unit_of(dataset: xr.Dataset, output: str) -> str:
    """SI unit of an output."""
    return str(dataset["output_unit"].sel(output=output).values)


def method_text(label: str) -> str:
    """A method's label in a study, as a legend says it."""
    return label.replace("pod", "POD").replace("_", " ")


def trained_runs(dataset: xr.Dataset) -> xr.DataArray:
    """Which runs were in their own training; of a result that does not tell, none."""
    return dataset.get("in_training", dataset["status"].isnull() & False)


def marked(text: str, run: xr.Dataset) -> str:
    """The text of a run in a legend, with a mark if its method was trained on it."""
    return text + MARK * bool(trained_runs(run).all())


def readable_unit(largest: float, unit: str) -> tuple[float, str]:
    """Factor and prefixed unit in which values up to `largest` have few digits."""
    if not unit.startswith(("m", "rad")) or not 0.0 < largest < 0.1:
        return 1.0, unit
    factor, prefix = next((f, p) for f, p in PREFIXES if f * largest >= 0.1 or p == "n")
    return factor, prefix + unit


def axis_label(dataset: xr.Dataset, output: str, unit: str = "") -> str:
    """Words, symbol and unit (the output's own by default) of an output."""
    text = full_label(output, "\n" if len(label_of(output).words) > LONG else " ")
    return f"{text} ({unit or unit_of(dataset, output)})"


def error_label(dataset: xr.Dataset, kind: str, output: str, unit: str = "") -> str:
    """An error of an output, its symbol and unit, such as `RMS error`; long ones in two lines."""
    label = f"{kind} of {label_of(output).symbol} ({unit or unit_of(dataset, output)})"
    return label if len(label.replace("$", "")) <= LONGEST else label.replace(" of ", " of\n", 1)
