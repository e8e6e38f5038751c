"""What a study file runs: axes of a grid, groups and boxes of a test."""

import math
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, Discriminator, Field, Tag, model_validator

from vehiclemor.reduction.training import SPEED
from vehiclemor.toml_files import FileSchema, Value

FACTORS = ("frequency_factor", "amplitude_factor")
# Axes that say what is run and what is trained on; and how the name of a parameter's begins.
TEXTS = ("maneuver", "start", "training")
PARAMETER = "parameters."
# A grid of more points than this is a mistake in a file, not a study.
MOST_POINTS = 1_000_000
# Decimals of sampled factors, speeds and parameters: what a table prints is what was run.
DECIMALS = 3


def _ordered(limits: list[Any]) -> list[Any]:
    if not (math.isfinite(limits[0]) and limits[0] <= limits[1] < math.inf):
        raise ValueError("a range is [from, to] with finite numbers in order")
    return limits


def _printable(limits: list[float]) -> list[float]:
    if any(round(limit, DECIMALS) != limit for limit in limits):
        raise ValueError(f"values are drawn with {DECIMALS} decimals: from and to have no more")
    return limits


def without_speed(parameters: dict[str, Any]) -> dict[str, Any]:
    """Parameters of scenarios; `ValueError` if the speed is among them, which has another key."""
    if SPEED in parameters:
        raise ValueError(f"{SPEED} is not given as a parameter, but by speed = [...]")
    return parameters


Pair = Annotated[list[float], Field(min_length=2, max_length=2)]
Range = Annotated[Pair, AfterValidator(_ordered)]
# Frequency and amplitude, perhaps the speed.
Point = Annotated[list[float], Field(min_length=2, max_length=3)]
# Of members of a family.
Number = Annotated[int, Field(ge=0, le=10**15)]
Numbers = Annotated[list[Number], Field(min_length=2, max_length=2), AfterValidator(_ordered)]
# Of parameters by name.
Printable = Annotated[Range, AfterValidator(_printable)]
Drawn = Annotated[dict[str, Printable], AfterValidator(without_speed)]
Limit = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
Positive = Annotated[list[Limit], Field(min_length=2, max_length=2), AfterValidator(_ordered)]
Samples = Annotated[list[Annotated[float, Field(allow_inf_nan=False)]], Field(min_length=1)]


def list_of(description: str, least: int = 0) -> Any:
    """Field with a list, empty by default; one that is given has so many entries at least."""
    return Field(default_factory=list, description=description, min_length=least)


def table_of(description: str, least: int = 0) -> Any:
    """Field with a table, empty by default; one that is given has so many entries at least."""
    return Field(default_factory=dict, description=description, min_length=least)


class Span(FileSchema):
    """Equidistant values, both ends included."""

    first: float = Field(allow_inf_nan=False)
    last: float = Field(allow_inf_nan=False)
    count: int = Field(ge=1, le=10_000)


# By its form, so that what is wrong with one is not read as the other.
Axis = Annotated[
    Annotated[list[Value], Field(min_length=1), Tag("values")] | Annotated[Span, Tag("span")],
    Discriminator(lambda value: "span" if isinstance(value, Span | dict) else "values"),
]


def values(entry: Axis) -> list[int | float | str]:
    """Values of one grid entry."""
    if isinstance(entry, Span):
        # Rounded, so that 1.1 is 1.1 and a grid holds the nominal point exactly.
        return [round(float(v), 12) for v in np.linspace(entry.first, entry.last, entry.count)]
    return list(entry)


def dotted(table: Any) -> Any:
    """Axes by names with dots, which make nested tables in TOML where they stand without quotes."""
    if not isinstance(table, dict) or not table or table.keys() & Span.model_fields.keys():
        return table
    axes: dict[str, Any] = {}
    for name, axis in table.items():
        inner = dotted(axis)
        axes |= {name: axis} if inner is axis else {f"{name}.{key}": inner[key] for key in inner}
    return axes


class Group(FileSchema):
    """Scenarios of one maneuver: every point, from every start.

    Points are rows (frequency, amplitude) or (frequency, amplitude, speed); without them they are
    all combinations of the three lists.
    """

    maneuver: str = Field(description="registered name")
    start: list[str] = list_of("initial conditions; the model's first by default", 1)
    points: list[Point] = list_of("[frequency, amplitude] or [frequency, amplitude, speed]", 1)
    frequency: list[float] = list_of("factors, 1 by default", 1)
    amplitude: list[float] = list_of("factors, 1 by default", 1)
    speed: list[float] = list_of("m/s, that of the model by default", 1)
    parameters: Annotated[dict[str, Samples], AfterValidator(without_speed)] = table_of(
        "parameter -> values in SI units, to combine with all else; that of the model by default",
        1,
    )

    @property
    def scenarios(self) -> int:
        """How many scenarios it is."""
        lists = (self.frequency, self.amplitude, self.speed)
        points = len(self.points) or math.prod(len(entry) or 1 for entry in lists)
        samples = math.prod(len(entry) for entry in self.parameters.values())
        return points * samples * (len(self.start) or 1)

    @model_validator(mode="after")
    def _either(self) -> "Group":
        if self.points and (self.frequency or self.amplitude or self.speed):
            raise ValueError("give points or lists of factors, not both")
        return self


class Box(FileSchema):
    """Runs of one maneuver, its numbers uniformly distributed in ranges [from, to]."""

    maneuver: str = Field(description="registered name")
    share: Limit = Field(1.0, description="of the runs, against the other boxes' shares")
    frequency: Positive = Field([1.0, 1.0], description="factors, from and to")
    amplitude: Range = Field([1.0, 1.0], description="factors, from and to")
    both_signs: bool = Field(True, description="whether a coin gives the amplitude its sign")
    speed: Range | None = Field(None, description="m/s, that of the model by default")
    start: list[str] = list_of("initial conditions, equally likely; the model's first")
    members: Numbers | None = Field(
        None, description="of a family: numbers of its members, from and to; MANEUVER:NUMBER is run"
    )
    parameters: Drawn = table_of(
        "parameter -> [from, to] in SI units; that of the model by default"
    )


class Draw(FileSchema):
    """Runs sampled from boxes."""

    runs: int = Field(ge=1, le=100_000, description="how many")
    common: dict[str, Any] = table_of("keys of every box that does not say otherwise")
    boxes: list[Box] = Field(min_length=1, description="what they are sampled from")

    @model_validator(mode="before")
    @classmethod
    def _with_common(cls, value: Any) -> Any:
        """The keys in common stand in each box."""
        if not isinstance(value, dict) or not isinstance(value.get("common"), dict):
            return value
        common, boxes = value["common"], value.get("boxes")
        if not isinstance(boxes, list) or not all(isinstance(box, dict) for box in boxes):
            return value
        return value | {"common": {}, "boxes": [common | box for box in boxes]}
