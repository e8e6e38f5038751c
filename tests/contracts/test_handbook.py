"""What the handbook shows works as it stands, and passes the contracts."""

import re
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest

import vehiclemor as vm
from vehiclemor import registry
from vehiclemor.contracts import check_method, check_model
from vehiclemor.registry import component

PAGE = Path(__file__).parents[2] / "paper" / "handbook" / "add-a-model-or-method.md"
PARAMETER = """
[parameters.{0}]
symbol = "{0}"
description = "of the oscillator"
value = {1}
unit = "{2}"
source = "tests"
status = "assumed"
"""


@pytest.fixture
def example(tmp_path, monkeypatch):
    """The page's method `interpolation` and model `oscillator`, registered."""
    method, model = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    (tmp_path / "handbook_method.py").write_text(method)
    (tmp_path / "handbook_model.py").write_text(model)
    head = (
        'model = "oscillator"\ntitle = "test"\n[sources.tests]\ntext = "test"\nlicence = "none"\n'
    )
    values = PARAMETER.format("mass", 2.0, "kg") + PARAMETER.format("stiffness", 18.0, "N/m")
    (tmp_path / "oscillator.toml").write_text(head + values)
    monkeypatch.syspath_prepend(tmp_path)
    entries = {kind: dict(registry._entries(kind)) for kind in registry.GROUPS}
    for kind, name, value in (
        ("method", "interpolation", "handbook_method:METHOD"),
        ("model", "oscillator", "handbook_model:DEFINITION"),
        ("maneuver", "shaken", "handbook_model:shaken"),
    ):
        entries[kind][name] = EntryPoint(name, value, registry.GROUPS[kind])
    monkeypatch.setattr(registry, "_entries", entries.__getitem__)


def test_method_of_the_handbook(example):
    check_method("interpolation", "double_wishbone")
    data = vm.simulate("double_wishbone", "interpolation", frequency=1.4, training="nominal")
    # The mechanism's path is a curve: wheel travel alone determines all coordinates.
    assert float(data["rms_error"].sel(output="second_euler_angle")) < 1e-7


def test_model_of_the_handbook(example):
    check_model("oscillator")
    check_method("replay", "oscillator")
    # 2 x'' + 18 x = sin t from rest.
    run = vm.simulate("oscillator", rtol=1e-9)
    exact = (np.sin(run["time"]) - np.sin(3.0 * run["time"]) / 3.0) / 16.0
    assert float(np.abs(run["outputs"].sel(output="position") - exact).max()) < 1e-8
    # It declares no report and has tables all the same.
    definition = component("model", "oscillator")
    assert definition.shown.outputs == ("position",)
    assert [case.id for case in definition.shown.timing][:2] == ["baseline", "strongest"]
