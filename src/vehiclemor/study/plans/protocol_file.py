"""Schema of protocol files, `data/protocols/*.toml`, validated on loading."""

import math
from typing import Literal

from pydantic import Field, model_validator

from vehiclemor.toml_files import FileSchema


class Bound(FileSchema):
    """Largest allowed error of an output: its RMS, or its largest absolute value."""

    measure: Literal["rms", "max"]
    bound: float = Field(gt=0.0, allow_inf_nan=False, description="in the output's unit")
    reason: str = Field("ours", min_length=1, description="where the number comes from")


class Group(FileSchema):
    """Scenarios of one maneuver: every point, from every start.

    Points are rows (frequency, amplitude) or (frequency, amplitude, speed); without them they are
    all combinations of the three lists.
    """

    maneuver: str = Field(description="registered name")
    start: list[str] = Field(
        default_factory=list, description="initial conditions; the model's first by default"
    )
    points: list[list[float]] = Field(
        default_factory=list, description="[frequency, amplitude] or [frequency, amplitude, speed]"
    )
    frequency: list[float] = Field(default_factory=list, description="factors, 1 by default")
    amplitude: list[float] = Field(default_factory=list, description="factors, 1 by default")
    speed: list[float] = Field(default_factory=list, description="m/s, the model's own by default")

    @property
    def scenarios(self) -> int:
        """How many scenarios it is."""
        lists = (self.frequency, self.amplitude, self.speed)
        points = len(self.points) or math.prod(len(entry) or 1 for entry in lists)
        return points * (len(self.start) or 1)

    @model_validator(mode="after")
    def _either(self) -> "Group":
        if self.points and (self.frequency or self.amplitude or self.speed):
            raise ValueError("give points or lists of factors, not both")
        if any(len(point) not in (2, 3) for point in self.points):
            raise ValueError("a point is [frequency, amplitude] or [frequency, amplitude, speed]")
        return self


class ContestantEntry(FileSchema):
    """One method with candidates for its settings."""

    label: str = Field(min_length=1, description="name of its row")
    method: str = Field(description="registered name")
    role: Literal["full order", "baseline", "contender"] = Field(
        "contender", description="of full order every candidate has a row; a contender chooses one"
    )
    candidates: list[dict[str, int | float | str]] = Field(
        default=[{}],
        min_length=1,
        description="settings, and `preset` beside them; validation chooses among them",
    )
    train_on: list[str] = Field(
        default_factory=list, description="maneuvers that it is trained on; all by default"
    )


class SpeedTarget(FileSchema):
    """How many times faster than a full-order integrator the winner must be."""

    against: str = Field(
        description="equal accuracy, within bounds, or the label of a full-order row"
    )
    ratio: float = Field(gt=0.0, description="least ratio of the times")
    aim: float = Field(0.0, description="ratio that is aimed at")


class Straight(FileSchema):
    """Scenarios without steering, in which the car must stay on its line."""

    maneuver: str = Field(description="registered name")
    output: str = Field(description="its lateral position")
    bound: float = Field(gt=0.0, description="largest value in the first 10 s, in its unit")


class ProtocolFile(FileSchema):
    """Schema of `data/protocols/*.toml`."""

    title: str = Field(description="one line")
    model: str = Field(description="registered name")
    bounds: dict[str, Bound] = Field(min_length=1, description="output -> largest allowed error")
    reported: list[str] = Field(
        default_factory=list, description="outputs whose RMS errors are printed beside the bounded"
    )
    training: list[Group] = Field(min_length=1, description="what methods learn from")
    validation: list[Group] = Field(min_length=1, description="what candidates are chosen by")
    test: list[Group] = Field(min_length=1, description="what is judged; no run stands twice")
    outside: list[Group] = Field(
        default_factory=list, description="beyond what was trained: reported, not judged"
    )
    contestants: list[ContestantEntry] = Field(min_length=1, description="who competes")
    targets: list[SpeedTarget] = Field(default_factory=list, description="speed that is aimed at")
    straight: Straight | None = Field(None, description="whether a car drives straight on")
