"""What the settings of all methods share: one pydantic class by method and kind of model."""

from collections.abc import Collection
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, WithJsonSchema, field_validator

from vehiclemor.simulation.integrators.catalogue import INTEGRATORS, frozen

Value = int | float | str
LARGEST_NUMBER = 1e300
# Marks a setting that is at most the number of the model's coordinates where it is not given.
AT_MOST_COORDINATES = "at most the number of coordinates"
# Shortest time step in s.
SHORTEST = 1e-6
# Beyond a tenth nothing is solved any more.
LARGEST_TOLERANCE = 0.1


class Settings(BaseModel):
    """Settings of a method: a subclass declares each with its type, default, bounds and meaning."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)
    # Settings that `fit` only hands on: the reduced model, a dataclass, has fields of these names.
    integration: ClassVar[tuple[str, ...]] = ()

    @field_validator("*", mode="before")
    @classmethod
    def _plain_number(cls, value: object) -> object:
        """NumPy's numbers as Python's, and 3.0 as 3: the type of the field decides what it is."""
        if isinstance(value, np.integer | np.floating):
            value = value.item()
        if isinstance(value, int | float) and LARGEST_NUMBER < abs(value) < np.inf:
            raise ValueError(f"is beyond +-{LARGEST_NUMBER:g}")
        if isinstance(value, float):
            if not np.isfinite(value):
                raise ValueError(f"is {value}, not finite")
            return int(value) if value.is_integer() else value
        return value


def _one_of(names: Collection[str]) -> tuple[Any, ...]:
    """What makes a text the name of one of these integrators."""

    def check(name: str) -> str:
        if name not in names:
            raise ValueError(f"is {name!r}; allowed: {', '.join(names)}")
        return name

    meaning = "; ".join(f"{name}: {INTEGRATORS[name].summary}" for name in names)
    schema = WithJsonSchema({"type": "string", "enum": list(names)})
    return AfterValidator(check), schema, Field(description=meaning)


AnyIntegrator = Annotated[str, *_one_of(INTEGRATORS)]
# Projected systems have no Jacobian to freeze.
ProjectedSolver = Annotated[str, *_one_of([name for name in INTEGRATORS if not frozen(name)])]
# Of an iteration.
StepTolerance = Annotated[
    float,
    Field(gt=0.0, le=LARGEST_TOLERANCE, description="largest step of the last iteration"),
]
Tolerance = Annotated[
    float,
    Field(
        ge=1e-13,
        le=LARGEST_TOLERANCE,
        description="largest local error of a state relative to its typical size",
    ),
]


class OnlineSettings(Settings):
    """How a reduced system is integrated."""

    integration = ("solver", "tolerance")
    solver: AnyIntegrator = Field(
        "etdrk4", description="as of full_order; etdrk4 freezes the Jacobian"
    )
    tolerance: Tolerance = 1e-3


class FallbackSettings(OnlineSettings):
    """Settings of reduced vehicles, behind which the full order may stand."""

    fallback: Literal["none"] | AnyIntegrator = Field(
        "none", description="integrator of the full order for runs that are not to be trusted"
    )
    fallback_tolerance: Tolerance = 1e-4
