"""The method that the handbook shows works as it stands, and passes the contracts.

The model that it shows is the quarter car of `tests/plugin`, with tests of its own.
"""

import re
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

import vehiclemor as vm
from vehiclemor import registry
from vehiclemor.contracts import check_method

PAGE = Path(__file__).parents[2] / "paper" / "handbook" / "add-a-model-or-method.md"


@pytest.fixture
def example(tmp_path, monkeypatch):
    """The page's method `interpolation`, registered."""
    method, *_ = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    (tmp_path / "handbook_method.py").write_text(method)
    monkeypatch.syspath_prepend(tmp_path)
    entries = {kind: dict(registry._entries(kind)) for kind in registry.GROUPS}
    entry = EntryPoint("interpolation", "handbook_method:METHOD", registry.GROUPS["method"])
    entries["method"]["interpolation"] = entry
    monkeypatch.setattr(registry, "_entries", entries.__getitem__)


def test_method_of_the_handbook(example):
    check_method("interpolation", "double_wishbone")
    data = vm.simulate("double_wishbone", "interpolation", frequency=1.4, training="nominal")
    # The mechanism's path is a curve: wheel travel alone determines all coordinates.
    assert float(data["rms_error"].sel(output="second_euler_angle")) < 1e-7
