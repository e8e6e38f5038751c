"""Study files: the grid of a study declared in TOML, validated on loading."""

import hashlib
import math
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Discriminator, Field, Tag, field_validator, model_validator

from vehiclemor.errors import FileError
from vehiclemor.registry import choice
from vehiclemor.resources import data_folder, data_names
from vehiclemor.study.plans.protocol_file import ProtocolFile
from vehiclemor.toml_files import FileSchema, Line, has_table, read_toml

FACTORS = ("frequency_factor", "amplitude_factor")
# Axes that say what is run and what is trained on; and how the name of a parameter's begins.
TEXTS = ("maneuver", "start", "training")
PARAMETER = "parameters."
# A grid of more points than this is a mistake in a file, not a study.
MOST_POINTS = 1_000_000


class Span(FileSchema):
    """Equidistant values, both ends included."""

    first: float = Field(allow_inf_nan=False)
    last: float = Field(allow_inf_nan=False)
    count: int = Field(ge=1, le=10_000)


# Told apart by their form, so that what is wrong with one is not read as the other.
Axis = Annotated[
    Annotated[list[int | float | str], Tag("values")] | Annotated[Span, Tag("span")],
    Discriminator(lambda value: "span" if isinstance(value, Span | dict) else "values"),
]


class Sampling(FileSchema):
    """Points spread over ranges, in place of every combination of some values."""

    plan: Literal["latin_hypercube", "sobol"] = Field(description="how points are spread")
    count: int = Field(ge=1, le=MOST_POINTS, description="how many; of sobol a power of two")
    seed: int = Field(ge=0, description="the same seed gives the same points")
    ranges: dict[str, list[float]] = Field(
        description="[from, to] of parameters.NAME, frequency_factor or amplitude_factor"
    )

    @model_validator(mode="after")
    def _sound(self) -> "Sampling":
        if not self.ranges:
            raise ValueError("ranges is empty")
        for name, limits in self.ranges.items():
            # Of a range that overflows no point could be taken.
            if len(limits) != 2 or not 0.0 < limits[1] - limits[0] < math.inf:
                raise ValueError(f"ranges: {name} is not [from, to]")
            if name not in FACTORS and not name.startswith(PARAMETER):
                raise ValueError(f"ranges: {name} is neither parameters.NAME nor a factor")
        if self.plan == "sobol" and self.count & (self.count - 1):
            raise ValueError(f"count: {self.count} is no power of two, as a sobol plan needs it")
        return self


Car = dict[str, float | list[float]]
Training = str | Annotated[list[str], Field(min_length=1)]


class MethodEntry(FileSchema):
    """One method of a study: settings that differ from a preset, under a label of its own."""

    method: str = Field(description="registered name")
    label: Line = Field("", description="name of its results; the method's by default")
    preset: str = Field("recommended", description="preset that its settings differ from")
    settings: dict[str, int | float | str] = Field(
        default_factory=dict, description="setting -> value; see vehiclemor show METHOD"
    )
    training: Training = Field("", description="as of the study, whose it is by default")


class StudyFile(FileSchema):
    """Schema of `data/studies/*.toml`.

    Either a grid of one model, or a collection that names other studies, or protocols (see
    `study/plans/protocol.py`).
    """

    title: Line = Field(description="one line")
    studies: list[str] = Field(
        default_factory=list, description="of a collection: names of studies, or TOML files"
    )
    protocols: list[str] = Field(
        default_factory=list, description="names of protocols, or TOML files: see protocol-schema"
    )
    model: str = Field("", description="registered name; needed for a grid")
    parameters: Car = Field(
        default_factory=dict,
        description="parameter -> value in SI units where the study's car is not the model's",
    )
    maneuver: str = Field("", description="registered name; the model's own by default")
    start: list[str] = Field(
        default_factory=list, description="initial conditions; the model's first by default"
    )
    training: Training = Field(
        "matched",
        description="input that is trained on: matched (the tested one), nominal (the model's own "
        "maneuver), the name of a maneuver, protocol (the training of the model's protocol), set, "
        "or a list of these",
    )
    training_set: list[list[float]] = Field(
        default_factory=list,
        description="of training = set: pairs [frequency factor, amplitude factor]",
    )
    keep: Literal["trajectories", "metrics"] = Field(
        "trajectories", description="histories and errors, or errors alone"
    )
    grid: dict[str, Axis] = Field(
        default_factory=dict,
        description="dimension -> values; frequency_factor, amplitude_factor, parameters.NAME, "
        "maneuver, start, training, or any setting",
    )
    sampling: Sampling | None = Field(
        None, description="points of a dimension `sample` beside those of the grid"
    )
    methods: list[MethodEntry] = Field(
        default_factory=list, description="each is run at every point of the grid"
    )

    @property
    def labelled(self) -> dict[str, MethodEntry]:
        """Label -> method of the study."""
        return {entry.label or entry.method: entry for entry in self.methods}

    @property
    def training_words(self) -> str:
        """What is trained on, in one line."""
        return self.training if isinstance(self.training, str) else ", ".join(self.training)

    @property
    def points(self) -> int:
        """Number of points of the grid; one cell may stand at several of them."""
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
        if self.protocols and (self.studies or self.model or self.grid or self.methods):
            raise ValueError("a study of protocols names them and nothing else")
        if self.studies and (self.model or self.grid or self.methods):
            raise ValueError("a collection names studies and nothing else")
        if self.studies or self.protocols:
            return self
        for name in ("model", "methods"):
            if not getattr(self, name):
                raise ValueError(f"{name} is missing")
        labels = [entry.label or entry.method for entry in self.methods]
        doubles = {label for label in labels if labels.count(label) > 1}
        if doubles:
            raise ValueError(f"label {sorted(doubles)[0]!r} is used twice")
        self._set_once()
        if self.points > MOST_POINTS:
            raise ValueError(f"the grid has {self.points} points, more than {MOST_POINTS}")
        return self

    def _set_once(self) -> None:
        own = {f"{PARAMETER}{name}" for name in self.parameters}
        own |= {name for name in ("maneuver", "start") if getattr(self, name)}
        for where, names in (("sampling", self.sampling and self.sampling.ranges), ("study", own)):
            for name in self.grid.keys() & set(names or ()):
                raise ValueError(f"{name} is set twice: in the grid and in the {where}")
        for name in own & set(self.sampling.ranges if self.sampling else ()):
            raise ValueError(f"{name} is set twice: in the sampling and in the study")
        for entry in self.methods:
            given = {*entry.settings, *(["training"] if entry.training else [])}
            for name in self.grid.keys() & given:
                method = entry.label or entry.method
                raise ValueError(
                    f"{name} is set twice: in the grid and in the settings of {method}"
                )


def values(entry: Axis) -> list[int | float | str]:
    """Values of one grid entry."""
    if isinstance(entry, Span):
        # Rounded, so that 1.1 is 1.1 and a grid holds the nominal point exactly.
        return [round(float(v), 12) for v in np.linspace(entry.first, entry.last, entry.count)]
    return list(entry)


def named_file(kind: str, folder: str, name: str) -> Path:
    """Path of a TOML file, given by itself or by the name of one in a folder of the data.

    Raises
    ------
    InputError
        If it is neither.
    """
    if name.endswith(".toml"):
        return Path(name)
    return data_folder() / folder / f"{choice(kind, name, data_names(folder))}.toml"


def study_path(study: str) -> Path:
    """Path of a study: a name from the package's data, or a TOML file."""
    return named_file("study", "studies", study)


def read_study(path: Path) -> StudyFile:
    """A study file; of a protocol's file the study of it alone."""
    if not has_table(path, "contestants"):
        return read_toml(path, StudyFile)
    title = read_toml(path, ProtocolFile).title
    return StudyFile.model_validate({"title": title, "protocols": [str(path)]})


def load_studies(study: str) -> dict[str, StudyFile]:
    """Study name -> definition; a collection gives all of its members."""
    return {name: definition for name, (_, definition) in studies_and_files(study).items()}


def studies_and_files(study: str) -> dict[str, tuple[Path, StudyFile]]:
    """As `load_studies`, with the files."""
    path = study_path(study)
    definition = read_study(path)
    if not definition.studies:
        return {path.stem: (path, definition)}
    members: dict[str, tuple[Path, StudyFile]] = {}
    for member in definition.studies:
        file = study_path(member)
        content = read_study(file)
        if content.studies:
            raise FileError(f"{path}: studies.{member} is a collection itself")
        if content in (other for _, other in members.values()):
            raise FileError(f"{path}: studies.{member}: the same study is in it already")
        # As its combined dataset is named, see `combined_path`.
        double = file.stem in members
        members[f"{file.stem}-{content_hash(content)}" if double else file.stem] = file, content
    return members


def content_hash(definition: FileSchema) -> str:
    """Short hash of what a file says."""
    text = definition.model_dump_json(exclude_defaults=True)
    return hashlib.sha256(text.encode()).hexdigest()[:8]
