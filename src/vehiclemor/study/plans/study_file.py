"""Schemas of study files, `data/studies/*.toml`: grids, protocols and collections.

A key that only one of them has decides which schema reads a file, see `schema_of`.
"""

import itertools
import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, Discriminator, Field, Tag, field_validator, model_validator

from vehiclemor.exceptions import InputError, did_you_mean
from vehiclemor.study.plans.logs import Log
from vehiclemor.study.plans.study_runs import (
    MOST_POINTS,
    PARAMETER,
    Axis,
    Draw,
    Group,
    Limit,
    Pair,
    dotted,
    list_of,
    table_of,
    values,
)
from vehiclemor.toml_files import FileSchema, Line, Value

# Of the test sets of every study without a seed.
SEED, MOST_SEED = 20261122, 2**63 - 1
# Sets of scenarios that a protocol lists, and those that it samples.
SETS = ("training", "validation", "test", "outside")
DRAWN = ("drawn", "drawn_outside")
# What goes with the test of a protocol: a study with a test of its own does not inherit it.
OF_TEST = ("outside", *DRAWN, "straight", "targets", "failure_rate")

Training = str | Annotated[list[str], Field(min_length=1)]
Settings = dict[str, Value]
# By its form, so that what is wrong with one is not read as the other.
Part = Annotated[
    Annotated[Group, Tag("maneuver")] | Annotated[Log, Tag("log")],
    Discriminator(lambda value: "log" if "log" in dict(value) else "maneuver"),
]
Parts = Annotated[list[Part], Field(min_length=1)]
PARAMETERS = table_of("parameter -> value in SI units where the study's are not the model's")


class Bound(FileSchema):
    """Largest allowed error of an output.

    It is the error's RMS, its largest absolute value, or its RMS as part of the output's range.
    """

    measure: Literal["rms", "max", "relative"]
    bound: float = Field(
        gt=0.0, allow_inf_nan=False, description="in the output's unit, or 1 where it is relative"
    )
    reason: str = Field("ours", min_length=1, description="where the number comes from")


def _bound_by_output(value: Any) -> Any:
    """Bounds by output; each table of a list is the bound of all its `outputs`."""
    if not isinstance(value, list):
        return value
    bounds: dict[str, Any] = {}
    for table in value:
        if not isinstance(table, dict) or not isinstance(table.get("outputs"), list):
            raise ValueError("each table of [[bounds]] has a list of outputs")
        bound = {key: entry for key, entry in table.items() if key != "outputs"}
        for output in table["outputs"]:
            if output in bounds:
                raise ValueError(f"{output} is in two tables")
            bounds[output] = bound
    return bounds


def _every_combination(value: Any) -> Any:
    """Candidates; a table of lists stands for every combination of their values."""
    if not isinstance(value, dict):
        return value
    if not all(isinstance(choices, list) for choices in value.values()):
        raise ValueError("a table of candidates has a list of values for each setting")
    return [dict(zip(value, choice, strict=True)) for choice in itertools.product(*value.values())]


class SpeedTarget(FileSchema):
    """How many times faster than a full-order integrator the winner must be."""

    against: str = Field(
        description="equal accuracy, within bounds, or the label of a full-order row"
    )
    ratio: Limit = Field(description="least ratio of the times")
    aim: float = Field(
        0.0, ge=0.0, allow_inf_nan=False, description="larger ratio that is aimed at"
    )


class Straight(FileSchema):
    """Scenarios without steering, in which the vehicle must stay on its line."""

    maneuver: str = Field(description="registered name")
    output: str = Field(description="its lateral position")
    bound: float = Field(gt=0.0, description="largest value in the first 10 s, in its unit")


class MethodEntry(FileSchema):
    """A method of a study: settings that differ from a preset, under a label."""

    method: str = Field(description="registered name")
    label: Line = Field("", description="name of its results; the method's by default")
    preset: str = Field("recommended", description="preset that its settings differ from")
    settings: Settings = table_of("setting -> value; see vehiclemor show METHOD")
    training: Training = Field(
        "",
        description="as of the study, whose it is by default; in a protocol the maneuvers of its "
        "training set that are learned from",
    )

    @property
    def name(self) -> str:
        """Label of its results."""
        return self.label or self.method


class ProtocolEntry(MethodEntry):
    """A method of a protocol: validation chooses one of its candidates."""

    candidates: Annotated[list[Settings], BeforeValidator(_every_combination)] = Field(
        default=[{}],
        min_length=1,
        description="further settings, and `preset` beside them: a list of tables, or a table "
        "setting -> list of values, of which every combination is a candidate",
    )
    role: Literal["full order", "baseline", "contender"] = Field(
        "contender",
        description="of full order every candidate has a result; of the contenders one is chosen",
    )


class StudyOfModel(FileSchema):
    """What all studies of one model say."""

    kind: ClassVar[str]

    title: Line = Field(description="one line")
    extends: str = Field("", description="study or file that gives all but methods, where not here")
    rows: list[str] | dict[str, list[str]] = list_of(
        "labels of methods of the extended study that are rows here too; or a table study -> labels"
    )
    model: str = Field(min_length=1, description="registered name")
    methods: list[MethodEntry] = Field(min_length=1, description="each is run in every scenario")

    @property
    def labelled(self) -> dict[str, MethodEntry]:
        """Label -> method of the study."""
        return {entry.name: entry for entry in self.methods}

    @model_validator(mode="after")
    def _different_labels(self) -> "StudyOfModel":
        labels = [entry.name for entry in self.methods]
        for label in labels:
            if labels.count(label) > 1:
                raise ValueError(f"label {label!r} is used twice")
        return self


class GridFile(StudyOfModel):
    """A grid: every method at every combination of the values of some axes."""

    kind = "a grid"

    parameters: dict[str, float | list[float]] = PARAMETERS
    maneuver: str = Field("", description="registered name; by default that of the model")
    logs: list[Log] = list_of("whose windows are run instead: the values of the axis maneuver")
    start: list[str] = list_of("initial conditions; the model's first by default")
    training: Training = Field(
        "matched",
        description="input that is trained on: matched (the tested one), nominal (the maneuver of "
        "the model), the name of a maneuver, protocol (the training of the model's protocol), set, "
        "or a list of these",
    )
    training_set: list[Pair] = list_of(
        "of training = set: pairs [frequency factor, amplitude factor]"
    )
    keep: Literal["trajectories", "metrics"] = Field(
        "trajectories", description="histories and errors, or errors alone"
    )
    grid: Annotated[dict[str, Axis], BeforeValidator(dotted)] = table_of(
        "dimension -> values; frequency_factor, amplitude_factor, parameters.NAME, "
        "maneuver, start, training, or any setting"
    )

    @property
    def points(self) -> int:
        """Number of points; one run may stand at several of them."""
        sizes = [len(values(axis)) for axis in self.grid.values()]
        return math.prod(sizes) * (len(self.start) or 1) * len(self.methods)

    @field_validator("grid")
    @classmethod
    def _different_values(cls, value: dict[str, Axis]) -> dict[str, Axis]:
        for name, axis in value.items():
            points = values(axis)
            if len(set(points)) != len(points):
                raise ValueError(f"{name} has the same value twice")
        return value

    @model_validator(mode="after")
    def _few_points(self) -> "GridFile":
        if self.points > MOST_POINTS:
            raise ValueError(f"the grid has {self.points} points, more than {MOST_POINTS}")
        return self

    @model_validator(mode="after")
    def _each_set_once(self) -> "GridFile":
        of_study = {f"{PARAMETER}{name}" for name in self.parameters}
        of_study |= {name for name in ("maneuver", "start") if getattr(self, name)}
        if self.logs and "maneuver" in of_study | set(self.grid):
            raise ValueError("give a maneuver or logs, not both")
        names_by_part = {"study": of_study}
        for label, entry in self.labelled.items():
            names = set(entry.settings)
            if entry.training:
                names.add("training")
            names_by_part[f"settings of {label}"] = names
        for part, names in names_by_part.items():
            if double := names & self.grid.keys():
                raise ValueError(f"{min(double)} is set twice: in the grid and in the {part}")
        return self


class ProtocolFile(StudyOfModel):
    """A protocol: methods learn from a training set, are chosen by a validation set and tested."""

    kind = "a study with bounds"

    parameters: dict[str, float | list[float]] = PARAMETERS
    training: Parts = Field(description="runs that methods learn from")
    # A schema is frozen: no entry of another class can be put in.
    methods: list[ProtocolEntry] = Field(  # type: ignore[assignment]
        min_length=1, description="each is tested with the settings that validation chooses"
    )
    bounds: Annotated[dict[str, Bound], BeforeValidator(_bound_by_output)] = Field(
        min_length=1,
        description="output -> largest allowed error; or a list of tables, each with `outputs`",
    )
    timed: int | None = Field(
        None, ge=1, description="so many runs of the test set, evenly spread, are timed; else all"
    )
    reported: list[str] = list_of("outputs whose RMS errors are printed beside the bounded")
    validation: Parts = Field(description="runs that candidates are chosen by")
    test: list[Part] = list_of("listed test runs; judged if none are drawn")
    outside: list[Part] = list_of("beyond what was trained: reported, not judged")
    version: int = Field(1, ge=1, description="of the drawn test set, part of its name")
    seed: int = Field(SEED, ge=0, le=MOST_SEED, description="of the drawn runs")
    drawn_training: Draw | None = Field(
        None, description="further runs that methods learn from, drawn from boxes"
    )
    drawn: Draw | None = Field(None, description="test set: drawn from boxes")
    drawn_outside: Draw | None = Field(
        None, description="the same beyond the boxes: whether models warn"
    )
    sensitive: dict[str, Limit] = table_of(
        "output -> largest value of the full order's run in the first 10 s; beyond it "
        "(spin, rollover) a drawn or measured run is not judged"
    )
    targets: list[SpeedTarget] = list_of("speed that is aimed at")
    failure_rate: float | None = Field(
        None, gt=0.0, le=1.0, description="rate of misses that the runs must exclude at 95 %"
    )
    flagged_misses: int = Field(
        3, ge=0, description="runs outside of the bounds that the chosen model may have flagged"
    )
    straight: Straight | None = Field(None, description="whether a vehicle drives straight on")

    @property
    def draws(self) -> dict[str, Draw]:
        """Sets that are sampled, by name."""
        drawn = {name: getattr(self, name) for name in DRAWN}
        return {name: draw for name, draw in drawn.items() if draw}

    @property
    def points(self) -> int:
        """Number of test runs of all methods."""
        listed = sum(group.scenarios for group in (*self.test, *self.outside))
        sampled = sum(draw.runs for draw in self.draws.values())
        return (listed + sampled) * len(self.methods)

    @model_validator(mode="after")
    def _tested(self) -> "ProtocolFile":
        if not (self.test or self.drawn):
            raise ValueError("there is nothing to test: give [[test]] or [drawn]")
        return self


class CollectionFile(FileSchema):
    """A collection of studies."""

    kind: ClassVar[str] = "a collection"

    title: Line = Field(description="one line")
    studies: list[str] = Field(min_length=1, description="names of studies, or TOML files")


StudyFile = GridFile | ProtocolFile
# The key that makes a file a study of a kind; without any of these it is a grid.
SCHEMAS = {"studies": CollectionFile, "bounds": ProtocolFile}


def schema_of(content: Mapping[str, Any]) -> type[StudyFile | CollectionFile]:
    """Schema of the content of a study file; `InputError` if a key is of none or of another."""
    schema = next((SCHEMAS[key] for key in SCHEMAS if key in content), GridFile)
    for key in content:
        if key not in schema.model_fields:
            raise InputError(f"{key} is not a key of {schema.kind}: {_hint(key, schema)}")
    return schema


def _hint(key: str, schema: type[StudyFile | CollectionFile]) -> str:
    """Where a key belongs, or what it may be meant to be."""
    others = [other.kind for other in (GridFile, *SCHEMAS.values()) if key in other.model_fields]
    if others:
        return f"it belongs to {' or '.join(others)}"
    return did_you_mean(key, schema.model_fields)
