"""What the paper prints: its numbers and claims, each with the place where it stands."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, TypeVar

from pydantic import Field, model_validator

from vehiclemor.errors import FileError
from vehiclemor.resources import data_folder
from vehiclemor.toml_files import FileSchema, read_toml

# The paper's own models: the registry may hold others, about which it says nothing.
Model = Literal["independent_suspension_vehicle", "double_wishbone", "high_fidelity_vehicle"]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Count = Annotated[int, Field(ge=1)]
# Text goes into one-line messages and table cells.
Line = Annotated[str, Field(pattern=r"^\S(.*\S)?$")]


class Paper(FileSchema):
    """Bibliographic record of the paper, and how far its numbers can be compared."""

    authors: list[Line]
    title: Line
    journal: Line
    volume: Count
    number: Count
    article: Line
    year: Count
    doi: Line
    note: Line


class Printed(FileSchema):
    """One thing that the paper prints, and where.

    Attributes
    ----------
    page, section, figure
        As printed: "031007-4", "3.1", and the number of the figure, if there is one.
    """

    id: str = Field(pattern=r"^[a-z0-9]+(_[a-z0-9]+)*$")
    page: str = Field(pattern=r"^031007-[1-8]$")
    section: str = Field(pattern=r"^[1-5](\.[1-3])?$")
    figure: int | None = Field(default=None, ge=1, le=14)


class Number(Printed):
    """A printed number.

    Attributes
    ----------
    kind
        What the number says. A time reduction is 1 - reduced time / full time, a perturbation the
        relative increase of the input's frequency or amplitude.
    quantity
        Name of the model's output that the number is about, if it is about one.
    states, control_period, snapshots
        Settings of the reduction behind the number, as far as the paper prints them.
    note
        How the printed words were read, where they leave a choice.
    """

    model: Model
    kind: Literal["rms_error", "time_reduction", "setting", "perturbation"]
    item: Line
    quantity: str = Field(default="", pattern=r"^[a-z0-9_]*$")
    value: Finite
    unit: Line
    states: Count | None = None
    control_period: float | None = Field(default=None, gt=0.0, allow_inf_nan=False)
    snapshots: Count | None = None
    note: Line | None = None

    @model_validator(mode="after")
    def _in_range(self) -> "Number":
        if self.kind == "rms_error" and not (self.value > 0.0 and self.quantity):
            raise ValueError(f"{self.id}: an rms_error is positive and names its quantity")
        # A percentage left as it is printed (65 instead of 0.65) ends here.
        if self.kind == "time_reduction" and not (0.0 < self.value < 1.0 and self.unit == "1"):
            raise ValueError(f"{self.id}: a time_reduction is between 0 and 1, in unit '1'")
        return self


class Claim(Printed):
    """A printed statement in our words.

    Attributes
    ----------
    model
        None if the statement is about all three models.
    kind
        `setup`: how something was made; `result`: what the paper says it saw; `expectation`: what
        it expects or explains without showing it.
    """

    model: Model | None = None
    kind: Literal["setup", "result", "expectation"]
    statement: Line


class PublishedFile(FileSchema):
    """Schema of `data/published/*.toml`."""

    paper: Paper
    number: list[Number]
    claim: list[Claim]


@dataclass(frozen=True)
class Published:
    """The paper's numbers and claims by id, in the order of the file."""

    paper: Paper
    numbers: dict[str, Number]
    claims: dict[str, Claim]


Entry = TypeVar("Entry", bound=Printed)


def load_published(path: Path | None = None) -> Published:
    """Load and validate what the paper prints, by default from the package's own file.

    Raises
    ------
    FileError
        If the file is unreadable, does not fit the schema, or has an id twice.
    """
    path = path or data_folder() / "published" / "masoudi2015.toml"
    content = read_toml(path, PublishedFile)
    numbers = _by_id(content.number, "number", path)
    return Published(content.paper, numbers, _by_id(content.claim, "claim", path))


def rms_numbers(model: str) -> dict[str, Number]:
    """Published RMS errors of a model by the output that they are about; none for a plug-in's."""
    numbers = load_published().numbers.values()
    return {n.quantity: n for n in numbers if n.model == model and n.kind == "rms_error"}


def _by_id(entries: list[Entry], kind: str, path: Path) -> dict[str, Entry]:
    found: dict[str, Entry] = {}
    for entry in entries:
        if entry.id in found:
            raise FileError(f"{path}: {kind}: id {entry.id!r} occurs twice")
        found[entry.id] = entry
    return found
