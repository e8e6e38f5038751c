"""Schema of protocol files, `data/protocols/*.toml`, validated on loading."""

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator

from vehiclemor.toml_files import FileSchema, Line

# Of the test sets of every protocol that gives none.
SEED = 20261122


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


Range = Annotated[list[float], Field(min_length=2, max_length=2)]
Limit = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]


class Box(FileSchema):
    """Runs of one maneuver, its numbers uniformly distributed in ranges [from, to]."""

    maneuver: str = Field(description="registered name")
    share: Limit = Field(1.0, description="of the runs, against the other boxes' shares")
    frequency: Range = Field([1.0, 1.0], description="factors, from and to")
    amplitude: Range = Field([1.0, 1.0], description="factors, from and to")
    both_signs: bool = Field(True, description="whether a coin gives the amplitude its sign")
    speed: Range | None = Field(None, description="m/s, the model's own by default")
    start: list[str] = Field(
        default_factory=list, description="initial conditions, equally likely; the model's first"
    )

    @model_validator(mode="after")
    def _ordered(self) -> "Box":
        ranges = (self.frequency, self.amplitude, self.speed)
        for low, high in filter(None, ranges):
            if not (math.isfinite(low) and low <= high < math.inf):
                raise ValueError("a range is [from, to] with finite numbers in order")
        if self.frequency[0] <= 0.0:
            raise ValueError("frequency factors are positive")
        return self


class Draw(FileSchema):
    """Runs drawn from boxes."""

    runs: int = Field(ge=1, le=100_000, description="how many")
    boxes: list[Box] = Field(min_length=1, description="what they are drawn from")


class ContestantEntry(FileSchema):
    """One method with candidates for its settings."""

    label: Line = Field(description="name of its row")
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

    title: Line = Field(description="one line")
    model: str = Field(description="registered name")
    bounds: dict[str, Bound] = Field(min_length=1, description="output -> largest allowed error")
    reported: list[str] = Field(
        default_factory=list, description="outputs whose RMS errors are printed beside the bounded"
    )
    training: list[Group] = Field(min_length=1, description="what methods learn from")
    validation: list[Group] = Field(min_length=1, description="what candidates are chosen by")
    test: list[Group] = Field(
        default_factory=list, description="listed test runs; judged if none are drawn"
    )
    outside: list[Group] = Field(
        default_factory=list, description="beyond what was trained: reported, not judged"
    )
    version: int = Field(1, ge=1, description="of the drawn test set, part of its name")
    seed: int = Field(SEED, ge=0, description="of the drawn runs")
    drawn: Draw | None = Field(None, description="test set: drawn from boxes")
    drawn_outside: Draw | None = Field(
        None, description="the same beyond the boxes: whether models warn"
    )
    sensitive: dict[str, Limit] = Field(
        default_factory=dict,
        description="output -> largest value of the full order's run in the first 10 s; beyond it "
        "(spin, rollover) a drawn run is reported apart",
    )
    contestants: list[ContestantEntry] = Field(min_length=1, description="who competes")
    targets: list[SpeedTarget] = Field(default_factory=list, description="speed that is aimed at")
    failure_rate: float | None = Field(
        None, gt=0.0, le=1.0, description="rate of misses that the runs must exclude at 95 %"
    )
    flagged_misses: int = Field(
        3, ge=0, description="runs outside of the bounds that the chosen model may have flagged"
    )
    straight: Straight | None = Field(None, description="whether a car drives straight on")

    @model_validator(mode="after")
    def _tested(self) -> "ProtocolFile":
        if not (self.test or self.drawn):
            raise ValueError("there is nothing to test: neither test nor drawn is given")
        return self
