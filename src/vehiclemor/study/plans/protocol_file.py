"""Schema of protocol files, `data/protocols/*.toml`, validated on loading."""

from typing import Literal

from pydantic import Field, model_validator

from vehiclemor.toml_files import FileSchema


class Bound(FileSchema):
    """Largest allowed error of an output: its RMS, or its largest absolute value."""

    measure: Literal["rms", "max"]
    bound: float = Field(gt=0.0, allow_inf_nan=False)


class Group(FileSchema):
    """Scenarios of one maneuver: every point, from every start.

    Points are rows (frequency, amplitude) or (frequency, amplitude, speed); without them they are
    all combinations of the three lists.
    """

    maneuver: str
    start: list[str] = Field(default_factory=list)
    points: list[list[float]] = Field(default_factory=list)
    frequency: list[float] = Field(default_factory=list)
    amplitude: list[float] = Field(default_factory=list)
    speed: list[float] = Field(default_factory=list)

    @model_validator(mode="after")
    def _either(self) -> "Group":
        if self.points and (self.frequency or self.amplitude or self.speed):
            raise ValueError("give points or lists of factors, not both")
        if any(len(point) not in (2, 3) for point in self.points):
            raise ValueError("a point is [frequency, amplitude] or [frequency, amplitude, speed]")
        return self


class ContestantEntry(FileSchema):
    """One method with candidates for its settings; `preset` stands beside the settings."""

    label: str = Field(min_length=1)
    method: str
    role: Literal["full order", "baseline", "contender"] = "contender"
    candidates: list[dict[str, int | float | str]] = Field(default=[{}], min_length=1)
    # Names of the maneuvers that it is trained on; all by default.
    train_on: list[str] = Field(default_factory=list)


class SpeedTarget(FileSchema):
    """How many times faster than a full-order integrator the winner must be."""

    # `equal accuracy`, `within bounds`, or the label of a full-order row.
    against: str
    ratio: float = Field(gt=0.0)
    aim: float = 0.0


class Straight(FileSchema):
    """Scenarios without steering, in which the car must stay on its line."""

    maneuver: str
    output: str
    bound: float = Field(gt=0.0)


class ProtocolFile(FileSchema):
    """Schema of `data/protocols/*.toml`."""

    title: str
    model: str
    bounds: dict[str, Bound] = Field(min_length=1)
    # Outputs whose RMS errors are printed beside the bounded ones.
    reported: list[str] = Field(default_factory=list)
    training: list[Group] = Field(min_length=1)
    validation: list[Group] = Field(min_length=1)
    test: list[Group] = Field(min_length=1)
    outside: list[Group] = Field(default_factory=list)
    contestants: list[ContestantEntry] = Field(min_length=1)
    targets: list[SpeedTarget] = Field(default_factory=list)
    straight: Straight | None = None
