"""Ranges in study files, from which the numbers of runs are drawn."""

import math
from typing import Annotated, Any

from pydantic import AfterValidator, Field

from vehiclemor.reduction.training import SPEED

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
    """Parameters of scenarios; `ValueError` if the speed is among them, which has its own key."""
    if SPEED in parameters:
        raise ValueError(f"{SPEED} is not given as a parameter, but by speed = [...]")
    return parameters


Range = Annotated[list[float], Field(min_length=2, max_length=2), AfterValidator(_ordered)]
# Of members of a family.
Number = Annotated[int, Field(ge=0, le=10**15)]
Numbers = Annotated[list[Number], Field(min_length=2, max_length=2), AfterValidator(_ordered)]
# Of parameters by name.
Printable = Annotated[Range, AfterValidator(_printable)]
Drawn = Annotated[dict[str, Printable], AfterValidator(without_speed)]
