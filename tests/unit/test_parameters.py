"""Parameter files and overrides: what is wrong is said in one line that names the place."""

from pathlib import Path

import numpy as np
import pytest

from vehiclemor.exceptions import FileError, InputError
from vehiclemor.parameters import Declared, load_parameters, parameter_path, point
from vehiclemor.simulation.build import build

EXPECTED = {
    "mass": Declared("kg", above=0.0),
    "speed": Declared("m/s", at_least=10.0, at_most=50.0),
    "friction": Declared("1", at_least=0.0),
    "pivot": point(),
}
VALUES = {"pivot": [4, 5.0, 6.0], "mass": 2, "speed": 20.0, "friction": 0}
VALID = """
model = "toy"
title = "A toy"
[sources.book]
text = "A book"
licence = "CC0-1.0"
""" + "".join(
    f"""
[parameters.{name}]
symbol = "x"
description = "a value"
value = {value}
unit = "{EXPECTED[name].unit}"
source = "book"
status = "published"
"""
    for name, value in VALUES.items()
)


@pytest.fixture
def load(tmp_path):
    """Parameters of the toy from its file with a change."""

    def load(old="", new="", overrides=None):
        assert old in VALID
        path = tmp_path / "toy.toml"
        path.write_text(VALID.replace(old, new, 1), encoding="utf-8")
        return load_parameters("toy", EXPECTED, path, overrides)

    return load


def test_values_come_in_declared_order_and_an_override_says_so(load):
    parameters, changed = load(), load(overrides={"pivot": (7, 8, np.float64(9)), "speed": 10})
    assert list(parameters.values()) == list(EXPECTED)
    assert (parameters["mass"].shape, parameters["pivot"].shape) == ((), (3,))
    one = load(overrides={"pivot.y": 8})
    for found, wanted in (
        (changed, [2, 10, 0, 7, 8, 9]),
        (parameters, [2, 20, 0, 4, 5, 6]),
        (one, [2, 20, 0, 4, 8, 6]),
    ):
        np.testing.assert_array_equal(found.flat(), wanted)
    for found, told in ((parameters, ("published", "book")), (changed, ("assumed", "override"))):
        assert (found.entries["pivot"].status, found.entries["pivot"].source) == told
    assert changed.entries["mass"].source == "book"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('model = "toy"', 'model = "other"', "'other'"),
        ("[parameters.pivot]", "[parameters.pivots]", "parameters.pivot is missing"),
        ('source = "book"', 'source = "blog"', "parameters.pivot.source: 'blog'"),
        ("[4, 5.0, 6.0]", "[4.0, 5.0]", "parameters.pivot: a point has 3 components"),
        ("value = 20.0", "value = 5.0", "parameters.speed: 5 m/s"),
    ],
)
def test_a_wrong_file_is_named(load, tmp_path, old, new, words):
    with pytest.raises(FileError, match=words) as error:
        load(old, new)
    assert str(error.value).startswith(f"{tmp_path / 'toy.toml'}: ")


def test_files_that_are_none_or_of_another_model(tmp_path: Path):
    path = tmp_path / "toy.toml"
    path.write_bytes(b"\xff\xfe\x00")
    for place, words in (("none", "no such file"), (".", "not a file"), (path.name, "UTF-8")):
        with pytest.raises(FileError, match=words):
            load_parameters("toy", EXPECTED, tmp_path / place)
    path.write_text(VALID)
    with pytest.raises(FileError, match=r"parameters\.pivot is not a parameter of toy"):
        load_parameters("toy", {"mass": EXPECTED["mass"]}, path)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("pivots", [1, 2, 3], "did you mean pivot"),
        ("pivot", [[1, 2, 3]], "not a number or list"),
        ("pivot", [1, 2, -695], "-695"),
        ("pivot.y", [1], "a number is needed"),
        ("pivot.w", 1, "components x, y, z"),
        ("mass", 0, "0 kg is not above 0"),
        ("speed", 5, "smallest allowed 10 m/s"),
    ],
)
def test_a_wrong_override_is_named(load, name, value, words):
    with pytest.raises(InputError, match=words) as error:
        load(overrides={name: value})
    assert name in str(error.value)


def test_a_model_reads_its_own_file_or_another(tmp_path: Path):
    text, path = parameter_path("double_wishbone").read_text(), tmp_path / "mine.toml"
    assert build("double_wishbone").parameters["wheel_centre"].tolist() == [0.0, 0.7979, -0.1199]
    path.write_text(text.replace("[0.0, 0.7979, -0.1199]", "[0.0, 0.8, -0.12]"))
    assert build("double_wishbone", path).parameters["wheel_centre"][1] == 0.8
