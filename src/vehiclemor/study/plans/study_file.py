"""Study files, `data/studies/*.toml`: methods and scenarios, found by name and validated.

The scenarios of a study are a grid, a product of axes; or, where it has bounds, a training set, a
validation set and a test set, which are lists or sampled from boxes.
"""

import math
from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag, field_validator, model_validator

from vehiclemor.study.plans.study_runs import (
    MOST_POINTS,
    PARAMETER,
    Axis,
    Draw,
    Group,
    Limit,
    Sampling,
    Size,
    list_of,
    table_of,
    values,
)
from vehiclemor.toml_files import FileSchema, Line

# Of the test sets of every study that gives none.
SEED, MOST_SEED = 20261122, 2**63 - 1
# Sets of scenarios that a study with bounds lists, and those that it samples.
SETS = ("training", "validation", "test", "outside")
DRAWN = ("drawn", "drawn_outside")
# Keys that go without bounds alone, and with bounds alone; and of a method.
OF_GRIDS = ("grid", "sampling", "maneuver", "start", "training_set", "keep")
OF_TESTS = (
    *(*SETS[1:], *DRAWN, "version", "seed", "timed", "reported"),
    *("sensitive", "targets", "failure_rate", "flagged_misses", "straight"),
)
OF_SIZES = {"title", "model", "maneuver", "training", "size", "methods"}
OF_ENTRIES = ("candidates", "role")

Training = str | Annotated[list[str], Field(min_length=1)]
Settings = dict[str, int | float | str]


class Bound(FileSchema):
    """Largest allowed error of an output.

    It is the error's RMS, its largest absolute value, or its RMS as part of the output's range.
    """

    measure: Literal["rms", "max", "relative"]
    bound: float = Field(
        gt=0.0, allow_inf_nan=False, description="in the output's unit, or 1 where it is relative"
    )
    reason: str = Field("ours", min_length=1, description="where the number comes from")


Groups = Annotated[list[Group], Field(min_length=1)]
Learned = Annotated[
    Annotated[Training, Tag("names")] | Annotated[Groups, Tag("runs")],
    Discriminator(lambda value: "runs" if _is_listed(value) else "names"),
]


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
    """One method of a study: settings that differ from a preset, under a label of its own."""

    method: str = Field(description="registered name")
    label: Line = Field("", description="name of its results; the method's by default")
    preset: str = Field("recommended", description="preset that its settings differ from")
    settings: Settings = table_of("setting -> value; see vehiclemor show METHOD")
    training: Training = Field(
        "",
        description="as of the study, whose it is by default; of a training set the maneuvers that "
        "are learned from",
    )
    candidates: list[Settings] = Field(
        default=[{}],
        min_length=1,
        description="with bounds: further settings, and `preset` beside them; validation chooses",
    )
    role: Literal["full order", "baseline", "contender"] = Field(
        "contender",
        description="with bounds: of full order every candidate has a result; of the contenders "
        "one is chosen",
    )


class StudyFile(FileSchema):
    """Schema of `data/studies/*.toml`.

    A grid of one model, or a test: with `bounds`, sets of scenarios; or a collection that names
    other studies.
    """

    title: Line = Field(description="one line")
    extends: str = Field("", description="study or file that gives all but methods, where not here")
    rows: list[str] = list_of("labels of methods of the extended study that are rows here too")
    studies: list[str] = list_of("of a collection: names of studies, or TOML files")
    model: str = Field("", description="registered name; needed for a grid")
    parameters: dict[str, float | list[float]] = table_of(
        "parameter -> value in SI units where the study's are not the model's"
    )
    maneuver: str = Field("", description="registered name; the model's own by default")
    start: list[str] = list_of("initial conditions; the model's first by default")
    training: Learned = Field(
        "matched",
        description="input that is trained on: matched (the tested one), nominal (the model's own "
        "maneuver), the name of a maneuver, protocol (the training of the model's protocol), set, "
        "or a list of these; with bounds: the runs that methods learn from",
    )
    training_set: list[list[float]] = list_of(
        "of training = set: pairs [frequency factor, amplitude factor]"
    )
    keep: Literal["trajectories", "metrics"] = Field(
        "trajectories", description="histories and errors, or errors alone"
    )
    grid: dict[str, Axis] = table_of(
        "dimension -> values; frequency_factor, amplitude_factor, parameters.NAME, "
        "maneuver, start, training, or any setting"
    )
    sampling: Sampling | None = Field(
        None, description="points of a dimension `sample` beside those of the grid"
    )
    methods: list[MethodEntry] = list_of("each is run in every scenario")
    bounds: dict[str, Bound] = table_of("of a test: output -> largest allowed error")
    timed: int | None = Field(
        None, ge=1, description="so many runs of the test set, evenly spread, are timed; else all"
    )
    reported: list[str] = list_of("outputs whose RMS errors are printed beside the bounded")
    validation: list[Group] = list_of("what candidates are chosen by")
    test: list[Group] = list_of("listed test runs; judged if none are drawn")
    outside: list[Group] = list_of("beyond what was trained: reported, not judged")
    version: int = Field(1, ge=1, description="of the drawn test set, part of its name")
    seed: int = Field(SEED, ge=0, le=MOST_SEED, description="of the drawn runs")
    drawn: Draw | None = Field(None, description="test set: drawn from boxes")
    drawn_outside: Draw | None = Field(
        None, description="the same beyond the boxes: whether models warn"
    )
    sensitive: dict[str, Limit] = table_of(
        "output -> largest value of the full order's run in the first 10 s; beyond it "
        "(spin, rollover) a drawn run is not judged"
    )
    targets: list[SpeedTarget] = list_of("speed that is aimed at")
    failure_rate: float | None = Field(
        None, gt=0.0, le=1.0, description="rate of misses that the runs must exclude at 95 %"
    )
    flagged_misses: int = Field(
        3, ge=0, description="runs outside of the bounds that the chosen model may have flagged"
    )
    straight: Straight | None = Field(None, description="whether a vehicle drives straight on")

    size: Size | None = Field(None, description="meshes: what full and reduced runs cost on each")

    @property
    def labelled(self) -> dict[str, MethodEntry]:
        """Label -> method of the study."""
        return {entry.label or entry.method: entry for entry in self.methods}

    @property
    def trained_on(self) -> str:
        """What is trained on, in one line."""
        given = [self.training] if isinstance(self.training, str) else self.training
        return ", ".join(one if isinstance(one, str) else one.maneuver for one in given)

    @property
    def points(self) -> int:
        """Number of points of the grid, or of tests; one run may stand at several of them."""
        if self.bounds:
            listed = sum(group.scenarios for group in (*self.test, *self.outside))
            draws = sum(draw.runs for draw in (self.drawn, self.drawn_outside) if draw)
            return (listed + draws) * len(self.methods)
        sizes = [len(values(entry)) for entry in self.grid.values()]
        sizes += [len(self.start) or 1, self.sampling.count if self.sampling else 1]
        return math.prod(sizes) * len(self.methods)

    @field_validator("training_set")
    @classmethod
    def _pairs(cls, value: list[list[float]]) -> list[list[float]]:
        if any(len(pair) != 2 for pair in value):
            raise ValueError("each entry is a pair [frequency factor, amplitude factor]")
        return value

    @field_validator("grid")
    @classmethod
    def _not_empty(cls, value: dict[str, Axis]) -> dict[str, Axis]:
        for name, entry in value.items():
            points = values(entry)
            if not points:
                raise ValueError(f"{name} has no values")
            if len(set(points)) != len(points):
                raise ValueError(f"{name} has the same value twice")
        return value

    @model_validator(mode="after")
    def _complete(self) -> "StudyFile":
        for name in ("studies", "bounds"):
            if name in self.model_fields_set and not getattr(self, name):
                raise ValueError(f"{name} is empty")
        if self.studies:
            if self.model or self.grid or self.methods:
                raise ValueError("a collection names studies and nothing else")
            return self
        for name in ("model", "methods"):
            if not getattr(self, name):
                raise ValueError(f"{name} is missing")
        labels = [entry.label or entry.method for entry in self.methods]
        if doubles := [label for label in labels if labels.count(label) > 1]:
            raise ValueError(f"label {doubles[0]!r} is used twice")
        foreign = [name for name in OF_GRIDS if name in self.model_fields_set]
        if self.size:
            foreign = sorted(self.model_fields_set - OF_SIZES)
            if foreign:
                raise ValueError(f"a size study has no {foreign[0]}")
            if not self.model_fields_set >= OF_SIZES or not isinstance(self.training, str):
                raise ValueError("a size study names a model, a maneuver, a training and methods")
            return self
        if self.bounds:
            for name in SETS[:2]:
                if not _is_listed(getattr(self, name)):
                    raise ValueError(f"a study with bounds needs [[{name}]]")
            if not (self.test or self.drawn):
                raise ValueError("there is nothing to test: neither test nor drawn is given")
            if foreign:
                raise ValueError(f"a study with bounds has no {foreign[0]}")
            return self
        given = self.model_fields_set.union(*(entry.model_fields_set for entry in self.methods))
        foreign = [name for name in (*OF_TESTS, *OF_ENTRIES) if name in given]
        if foreign or _is_listed(self.training):
            raise ValueError(f"{[*foreign, '[[training]]'][0]} is of a study with bounds")
        self._check_set_once()
        if self.points > MOST_POINTS:
            raise ValueError(f"the grid has {self.points} points, more than {MOST_POINTS}")
        return self

    def _check_set_once(self) -> None:
        own = {f"{PARAMETER}{name}" for name in self.parameters}
        own |= {name for name in ("maneuver", "start") if getattr(self, name)}
        axes = {
            "grid": {*self.grid},
            "sampling": {*(self.sampling.ranges if self.sampling else ())},
        }
        settings = {
            f"settings of {label}": {*entry.settings, *["training"] * bool(entry.training)}
            for label, entry in self.labelled.items()
        }
        others = axes | {"study": own} | settings
        for one, names in axes.items():
            for other, more in others.items():
                for name in sorted(names & more) if other != one else ():
                    raise ValueError(f"{name} is set twice: in the {one} and in the {other}")


def _is_listed(value: object) -> bool:
    """Whether what is given are scenarios, not names of them."""
    return isinstance(value, list) and bool(value) and isinstance(value[0], dict | Group)
