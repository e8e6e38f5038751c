"""Settings of methods are checked at the border: kind, bounds, choices, names."""

from dataclasses import replace
from typing import Annotated, Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import Field

from vehiclemor.exceptions import InputError
from vehiclemor.reduction.interface import Method
from vehiclemor.reduction.settings import AT_MOST_COORDINATES, Settings
from vehiclemor.reduction.validation import validated


class Declared(Settings):
    rank: int = Field(3, ge=1, description="how many")
    period: float = Field(5.0, gt=0.0, description="how long")
    mode: Literal["fast", "slow"] = Field("fast", description="how")
    label: str = Field("", description="any text")
    order: Literal["up", "down"] = "up"
    share: float = Field(0.5, ge=0.0, le=1.0)


def declared(**presets):
    return Method("m", "", {"ode": Declared}, fit=lambda *_: None, presets={"ode": presets})


def test_defaults_then_preset_then_given():
    others = {"label": "", "order": "up", "share": 0.5}
    plain = validated(declared(), "ode", {}).model_dump()
    assert plain == {"rank": 3, "period": 5.0, "mode": "fast", **others}
    method = declared(mine={"rank": 4, "mode": "slow"})
    settings = validated(method, "ode", {"rank": 5}, "mine").model_dump()
    assert settings == {"rank": 5, "period": 5.0, "mode": "slow", **others}


class Bounded(Declared):
    modes: Annotated[int, AT_MOST_COORDINATES] = Field(3, ge=1, description="how many at most")


def test_a_default_is_at_most_the_number_of_coordinates_where_it_says_so():
    method = replace(declared(), presets={"ode": {"mine": {"modes": 4}}}, settings={"ode": Bounded})
    for preset in ("recommended", "mine"):
        settings = validated(method, "ode", {}, preset, coordinates=2)
        assert (settings.rank, settings.modes) == (3, 2)
    assert validated(method, "ode", {"modes": 3}, coordinates=2).modes == 3


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("rank", 0, "rank is 0.*at least 1"),
        ("rank", 2.5, "rank is 2.5, not an integer"),
        ("rank", "3", "rank is '3', not an integer"),
        ("rank", True, "rank is True, not an integer"),
        ("rank", None, "rank is None, not an integer"),
        ("rank", float("nan"), "rank is nan, not finite"),
        ("rank", -(10**400), "rank"),
        ("period", 0.0, "period is 0.*above 0"),
        ("period", -1, "period is -1.*above 0"),
        ("period", float("inf"), "period is inf, not finite"),
        ("period", "long", "period is 'long', not a number"),
        ("mode", "quick", "mode is 'quick'.*fast, slow"),
        ("mode", 1, "mode is 1.*fast, slow"),
        ("label", 1, "label is 1.*text"),
        ("order", "{left}", "order is '{left}'.*up, down"),
        ("share", 2, "share is 2.*at most 1"),
        ("rang", 3, "'rang'.*did you mean rank"),
    ],
)
def test_wrong_setting_is_named_with_what_is_allowed(name, value, words):
    with pytest.raises(InputError, match=words):
        validated(declared(), "ode", {name: value})


def test_wrong_preset_is_caught_too():
    with pytest.raises(InputError, match="rank is 0"):
        validated(declared(mine={"rank": 0}), "ode", {}, "mine")
    with pytest.raises(InputError, match="'mime'; did you mean mine"):
        validated(declared(mine={}), "ode", {}, "mime")


@given(rank=st.integers(1, 10**9), period=st.floats(1e-9, 1e9))
def test_allowed_numbers_pass_with_their_declared_type(rank, period):
    settings = validated(declared(), "ode", {"rank": float(rank), "period": period})
    assert settings.rank == rank
    assert type(settings.rank) is int
    assert settings.period == period
    assert type(settings.period) is float
    assert type(validated(declared(), "ode", {"period": 2}).period) is float
    assert validated(declared(), "ode", {"rank": np.int64(rank)}).rank == rank
