"""What tables and figures show and how they call it: outputs, columns, cases of the cost table.

The three models of the paper have rows of their own in `data/figures/labels.toml`; every other one
gets rows by its kind of equations.
"""

from __future__ import annotations

import re
from functools import cache
from typing import TYPE_CHECKING, Literal, NamedTuple

from pydantic import Field

from vehiclemor.files import data_folder
from vehiclemor.multibody.definition import ModelDefinition
from vehiclemor.study.plans.study_file import MethodEntry, Settings
from vehiclemor.toml_files import FileSchema, Line, read_toml

if TYPE_CHECKING:
    import xarray as xr

# What is drawn of a run, or of a point of a grid.
Kind = Literal["histories", "paths", "errors"]
# What results are converted to.
Format = Literal["zarr", "parquet", "csv"]
# What is said of a run that was in its own training, and the mark of it in a legend.
TRAINED, MARK = "trained on this run", "*"
EXPONENT = re.compile(r"\^(-?\d+(?:\.\d+)?)")
PREFIXES = ((1e3, "m"), (1e6, "µ"), (1e9, "n"))
# Format of errors: an exact zero is 0, since orders of magnitude are compared.
ERROR = ".1e"
# Method and preset of the reduced models that are timed where none are listed.
REDUCED = (("pod", "recommended"), ("pod", "literal"), ("fixed_basis", "recommended"))


class Label(NamedTuple):
    """How one output is called: in full, as a formula for figures, as a narrow heading."""

    name: str
    symbol: str
    short: str


class MethodLook(NamedTuple):
    """How a method is called and drawn; dashes are lengths of lines and gaps in line widths."""

    words: str
    color: str
    mark: str
    dashes: list[float]


class Column(NamedTuple):
    """How a column is printed: heading, format, meaning below the table, factor on the SI unit."""

    heading: str
    form: str = ".6g"
    meaning: str = ""
    scale: float = 1.0


class Case(MethodEntry):
    """A row of a cost table; identifier and label of a reduced model follow from its settings."""

    id: str = ""

    def named(self) -> Case:
        """With identifier and label: what differs from the recommended settings."""
        label = self.label
        if not label:
            parts = [self.method.replace("_", " ")]
            parts += [self.preset] if self.preset != "recommended" else []
            rest = dict(self.settings)
            rank, tolerance = rest.pop("rank"), rest.pop("tolerance", None)
            label = " ".join([*parts, *map(str, rest.values()), f"r={rank}"])
            label += "" if tolerance is None else f", {tolerance:.0e}".replace("e-0", "e-")
        name = self.id or label.replace(",", "").replace("=", "").replace(" ", "_")
        return self.model_copy(update={"id": name, "label": label})


class OfKind(FileSchema):
    """What tables show of all models of a kind."""

    against: list[Line] = Field(min_length=2, max_length=2)
    cases: list[Case]
    counts: dict[str, Line]


class LabelFile(FileSchema):
    """Schema of `data/figures/labels.toml`."""

    outputs: dict[str, Label]
    methods: dict[str, MethodLook]
    columns: dict[str, Column]
    algebraic: OfKind
    dynamic: OfKind
    structural: OfKind
    reduced: dict[str, list[Case]]


@cache
def declared() -> LabelFile:
    """The package's own file."""
    return read_toml(data_folder() / "figures" / "labels.toml", LabelFile)


def column(name: str) -> Column:
    """How a column is printed; one without an entry has its name as heading."""
    known = declared().columns
    if name.startswith("rms_") and name not in known:
        return Column(f"{label_of(name.removeprefix('rms_')).short} error", ERROR)
    return known.get(name, Column(name.replace("_", " ")))


def label_of(output: str) -> Label:
    """The label of an output; one that has no symbol has its name."""
    name = output.replace("_", " ")
    return declared().outputs.get(output, Label(name, name, name))


def full_label(output: str, between: str = " ") -> str:
    """Name and symbol of an output; the name alone may be that of two."""
    label = label_of(output)
    return label.name if label.symbol == label.name else f"{label.name}{between}{label.symbol}"


def unit_of(dataset: xr.Dataset, output: str) -> str:
    """SI unit of an output."""
    return str(dataset["output_unit"].sel(output=output).values)


def method_text(label: str) -> str:
    """A method's label in a study, as a legend has it."""
    if look := declared().methods.get(label):
        return look.words
    words = ["POD" if word == "pod" else word for word in label.split("_")]
    return " ".join(words)


def raised(unit: str) -> str:
    """A unit or formula whose exponents are superscripts in a figure."""
    return EXPONENT.sub(r"$^{\1}$", unit)


def trained_runs(dataset: xr.Dataset) -> xr.DataArray:
    """Which runs were in their own training; none of a result that does not tell."""
    return dataset.get("in_training", dataset["status"].isnull() & False)


def readable_unit(largest: float, unit: str) -> tuple[float, str]:
    """Factor and prefixed unit in which values up to `largest` have few digits."""
    # A prefix of m^2 would be squared too.
    if unit.split("/", maxsplit=1)[0] not in ("m", "rad") or not 0.0 < largest < 0.1:
        return 1.0, unit
    factor, prefix = next((f, p) for f, p in PREFIXES if f * largest >= 0.1 or p == "n")
    return factor, prefix + unit


def axis_label(dataset: xr.Dataset, output: str, unit: str = "") -> str:
    """Name, symbol and unit (the output's own by default) of an output."""
    text = full_label(output, "\n" if len(label_of(output).name) > 16 else " ")
    return f"{text} ({raised(unit or unit_of(dataset, output))})"


def error_label(dataset: xr.Dataset, kind: str, output: str, unit: str = "") -> str:
    """An error of an output, its symbol and unit, such as `RMS error`; long ones in two lines."""
    unit = unit or unit_of(dataset, output)
    symbol = label_of(output).symbol
    letters = len(f"{kind} of {symbol} ({unit})".replace("$", ""))
    between = " " if letters <= 26 else "\n"
    return f"{kind} of{between}{symbol} ({raised(unit)})"


# What is shown of a model.


def of_kind(kind: str) -> OfKind:
    """What tables show of all models of a kind, one of `KINDS`."""
    file = declared()
    return {"ae": file.algebraic, "structural": file.structural}.get(kind, file.dynamic)


def default_rank(coordinates: int) -> int:
    """Rank of the reduced models in the default rows: 3, but less than the coordinates."""
    return max(1, min(3, coordinates - 1))


def timing_cases(definition: ModelDefinition) -> list[Case]:
    """Rows of a model's cost table: full-order solvers, replay, reduced models."""
    settings: Settings = {"rank": default_rank(len(definition.coordinates))}
    reduced = declared().reduced.get(definition.name) or [
        Case.model_validate({"method": method, "preset": preset, "settings": settings})
        for method, preset in REDUCED
        # Those of structures stand among their cases.
        if definition.kind != "structural"
    ]
    return [case.named() for case in (*of_kind(definition.kind).cases, *reduced)]


def tabled_outputs(definition: ModelDefinition) -> tuple[str, ...]:
    """Outputs whose errors are tabled: those that the model declares, or all."""
    return definition.tabled_outputs or tuple(output.name for output in definition.outputs)


def main_outputs(definition: ModelDefinition) -> tuple[str, ...]:
    """Outputs that are printed and drawn: those that the model declares, or the first three."""
    return definition.main_outputs or tabled_outputs(definition)[:3]
