"""Settings of methods: one pydantic class by method and kind of model, validated at the border."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    field_validator,
)

from vehiclemor.errors import InputError
from vehiclemor.registry import unknown
from vehiclemor.simulation.system import SOLVERS

if TYPE_CHECKING:
    from vehiclemor.reduction.interface import Method

Value = int | float | str
LARGEST_NUMBER = 1e300


class Settings(BaseModel):
    """Settings of a method: a subclass declares each with its type, default, bounds and meaning."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    @field_validator("*", mode="before")
    @classmethod
    def _plain_number(cls, value: object) -> object:
        """NumPy's numbers as Python's, and 3.0 as 3: the field's own type decides what it is."""
        if isinstance(value, np.integer | np.floating):
            value = value.item()
        if isinstance(value, int | float) and LARGEST_NUMBER < abs(value) < np.inf:
            raise ValueError(f"is beyond +-{LARGEST_NUMBER:g}")
        if isinstance(value, float):
            if not np.isfinite(value):
                raise ValueError(f"is {value}, not finite")
            return int(value) if value.is_integer() else value
        return value


def one_of(choices: tuple[str, ...]) -> AfterValidator:
    """Validator of a text that is one of the choices, where these stand in another place."""

    def check(value: str) -> str:
        if value not in choices:
            raise ValueError(f"is {value!r}; allowed: {', '.join(choices)}")
        return value

    return AfterValidator(check)


# How a reduced system is integrated: the same two settings of all methods that have one.
Solver = Annotated[
    str,
    one_of(SOLVERS),
    Field(description="as of full_order; ros34pw2 and etdrk4 freeze the Jacobian"),
]
# Projected systems have no Jacobian to freeze.
ProjectedSolver = Annotated[
    str,
    one_of(("explicit", "rodas4")),
    Field(description="explicit: Dormand-Prince 5(4); rodas4: Rosenbrock of order 4"),
]
Tolerance = Annotated[
    float,
    Field(ge=1e-13, description="largest local error of a state relative to its typical size"),
]


class OnlineSettings(Settings):
    """How a reduced system is integrated."""

    solver: Solver = "ros34pw2"
    tolerance: Tolerance = 1e-3


class ProjectedSettings(Settings):
    """How a projected system is integrated."""

    solver: ProjectedSolver = "explicit"
    tolerance: Tolerance = 1e-4


def validated(
    method: Method, kind: str, given: Mapping[str, object], preset: str = "recommended"
) -> Any:
    """All settings of a method: those given, else those of the preset, else the defaults.

    Returns
    -------
    Settings
        An instance of `method.settings[kind]`.

    Raises
    ------
    InputError
        If a name is not declared, or a value has the wrong kind or is out of bounds.
    """
    presets = method.presets_of(kind)
    if preset not in presets:
        raise unknown(f"preset of {method.name}", preset, presets)
    declared = method.settings.get(kind, Settings)
    for name in given:
        if name not in declared.model_fields:
            raise unknown(f"setting of {method.name}", name, declared.model_fields)
    try:
        return declared.model_validate({**presets[preset], **given})
    except ValidationError as error:
        first = error.errors()[0]
        raise InputError(f"{method.name}: {first['loc'][0]} {_wrong(first)}") from None


def parsed(text: str) -> object:
    """A value from the command line: an integer, a number or text."""
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def _wrong(error: Any) -> str:
    """What is wrong with a value, in the words of this package."""
    value, limits = error["input"], error.get("ctx", {})
    words: dict[str, Callable[[], str]] = {
        "greater_than_equal": lambda: f"is {value:g}; it must be at least {limits['ge']:g}",
        "greater_than": lambda: f"is {value:g}; it must be above {limits['gt']:g}",
        "less_than_equal": lambda: f"is {value:g}; it must be at most {limits['le']:g}",
        "int_type": lambda: f"is {value!r}, not an integer",
        "float_type": lambda: f"is {value!r}, not a number",
        "string_type": lambda: f"is {value!r}; allowed: text",
        "literal_error": lambda: f"is {value!r}; allowed: {_listed(limits['expected'])}",
    }
    return words.get(error["type"], lambda: error["msg"].removeprefix("Value error, "))()


def _listed(expected: str) -> str:
    """Pydantic's "'a', 'b' or 'c'" as "a, b, c"."""
    return expected.replace(" or ", ", ").replace("'", "")
