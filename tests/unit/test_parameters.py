"""Parameter files and overrides: what is wrong is said in one line that names the place."""

from pathlib import Path

import numpy as np
import pytest

from vehiclemor.errors import FileError, InputError
from vehiclemor.parameters import Declared, load_parameters, point
from vehiclemor.resources import data_folder
from vehiclemor.simulation.build import build

EXPECTED = {"pivot": point(), "joint": point()}
VALID = """
model = "toy"
title = "A toy"

[sources.book]
text = "A book"
licence = "CC0-1.0"

[parameters.joint]
symbol = "J"
description = "a joint"
value = [4, 5.0, 6.0]
unit = "m"
source = "book"
status = "published"

[parameters.pivot]
symbol = "P"
description = "a pivot"
value = [1.0, 2.0, 3.0]
unit = "m"
source = "book"
status = "assumed"
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "toy.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_values_come_in_declared_order(tmp_path: Path) -> None:
    parameters = load_parameters("toy", EXPECTED, written(tmp_path, VALID))
    assert list(parameters.values()) == ["pivot", "joint"]
    np.testing.assert_array_equal(parameters.flat(), [1, 2, 3, 4, 5, 6])
    np.testing.assert_array_equal(parameters["joint"], [4.0, 5.0, 6.0])
    assert parameters.entries["pivot"].status == "assumed"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('model = "toy"', 'model = "other"', "parameters of model 'other', not of 'toy'"),
        ('model = "toy"', "", "model: Field required"),
        ("[parameters.pivot]", "[parameters.pivots]", "parameters.pivot is missing"),
        ('unit = "m"', 'unit = "mm"', "parameters.joint.unit: 'mm' is not the SI unit 'm'"),
        ('source = "book"', 'source = "blog"', "parameters.joint.source: 'blog' is not listed"),
        ("[4, 5.0, 6.0]", "[4.0, 5.0]", r"a point has 3 components \(x, y, z\), not 2"),
        ("[4, 5.0, 6.0]", "4.0", r"a point has 3 components \(x, y, z\), not 1"),
        ("[4, 5.0, 6.0]", "[4.0, 5.0, nan]", "parameters.joint.value: .* is not finite"),
        ("[4, 5.0, 6.0]", "[4.0, 5.0, -inf]", "parameters.joint.value: .* is not finite"),
        (
            "[4, 5.0, 6.0]",
            "[4.0, 500.0, 6.0]",
            r"joint: 500.0 m is outside .* \(is it in millimetres",
        ),
        ("[4, 5.0, 6.0]", '["4", 5.0, 6.0]', "parameters.joint.value"),
        ('status = "published"', 'status = "guessed"', "parameters.joint.status: .*'assumed'"),
        ('symbol = "J"', 'symbols = "J"', r"parameters.joint.symbol.*\(and 1 more\)"),
        ("[sources.book]", "[sources.book", "not a valid TOML file"),
    ],
)
def test_wrong_file_is_one_line(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in VALID
    path = written(tmp_path, VALID.replace(old, new, 1))
    with pytest.raises(FileError, match=message) as error:
        load_parameters("toy", EXPECTED, path)
    assert str(error.value).startswith(f"{path}: ")
    assert "\n" not in str(error.value)


def test_parameter_that_the_model_does_not_have_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path, VALID)
    with pytest.raises(FileError, match=r"parameters\.joint is not a parameter of toy"):
        load_parameters("toy", {"pivot": point()}, path)


def test_missing_and_unreadable_files(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="no such file"):
        load_parameters("toy", EXPECTED, tmp_path / "none.toml")
    with pytest.raises(FileError, match="can't be read"):
        load_parameters("toy", EXPECTED, tmp_path)
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FileError, match="not a text file in UTF-8"):
        load_parameters("toy", EXPECTED, tmp_path / "binary.toml")


def test_override_replaces_a_value_and_says_so(tmp_path: Path) -> None:
    path = written(tmp_path, VALID)
    parameters = load_parameters("toy", EXPECTED, path, {"joint": (7, 8, np.float64(9))})
    np.testing.assert_array_equal(parameters["joint"], [7.0, 8.0, 9.0])
    assert (parameters.entries["joint"].status, parameters.entries["joint"].source) == (
        "assumed",
        "override",
    )
    unchanged = load_parameters("toy", EXPECTED, path)
    np.testing.assert_array_equal(unchanged["joint"], [4.0, 5.0, 6.0])
    np.testing.assert_array_equal(parameters["pivot"], unchanged["pivot"])


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("joints", [1, 2, 3], "'joints' is not a parameter of toy; did you mean joint?"),
        ("joint", [1, 2], "parameter joint: a point has 3 components"),
        ("joint", 1.0, "parameter joint: a point has 3 components"),
        ("joint", [[1, 2, 3]], "parameter joint: .* is not a number or list of numbers"),
        ("joint", "here", "parameter joint: 'here' is not a number"),
        ("joint", None, "parameter joint: "),
        ("joint", [1, 2, np.nan], "parameter joint: nan is not finite"),
        ("joint", [1, 2, -695], "parameter joint: -695.0 m is outside"),
    ],
)
def test_wrong_override_is_one_line(tmp_path: Path, name: str, value: object, message: str) -> None:
    with pytest.raises(InputError, match=message) as error:
        load_parameters("toy", EXPECTED, written(tmp_path, VALID), {name: value})
    assert "\n" not in str(error.value)


SCALARS = {
    "mass": Declared("kg", above=0.0),
    "speed": Declared("m/s", at_least=10.0, at_most=50.0),
    "friction": Declared("1", at_least=0.0),
    "pivot": point(),
}
WITH_SCALARS = (
    VALID[: VALID.index("[parameters.joint]")]
    + "".join(
        f"""
[parameters.{name}]
symbol = "x"
description = "a number"
value = {value}
unit = "{unit}"
source = "book"
status = "assumed"
"""
        for name, value, unit in (("mass", 2, "kg"), ("speed", 20.0, "m/s"), ("friction", 0, "1"))
    )
    + VALID[VALID.index("[parameters.pivot]") :]
)


def test_scalars_and_points_have_their_shapes(tmp_path: Path) -> None:
    parameters = load_parameters("toy", SCALARS, written(tmp_path, WITH_SCALARS), {"speed": 10})
    assert parameters["mass"].shape == parameters["speed"].shape == ()
    assert parameters["pivot"].shape == (3,)
    np.testing.assert_array_equal(parameters.flat(), [2.0, 10.0, 0.0, 1.0, 2.0, 3.0])


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("mass", -3, "parameter mass: -3 kg is not above 0"),
        ("mass", 0, "parameter mass: 0 kg is not above 0"),
        ("mass", np.inf, "parameter mass: inf is not finite"),
        ("mass", [2.0], "parameter mass: a number is needed, not a list of 1"),
        ("mass", [1.0, 2.0, 3.0], "parameter mass: a number is needed, not a list of 3"),
        ("mass", 10**400, f"parameter mass: 1{59 * '0'}... is not a number or list of numbers"),
        ("speed", 5, "parameter speed: 5 m/s is below the smallest allowed 10 m/s"),
        ("speed", 60.5, "parameter speed: 60.5 m/s is above the largest allowed 50 m/s"),
        ("friction", -0.1, "parameter friction: -0.1 is below the smallest allowed 0"),
        ("pivot", 1.0, "parameter pivot: a point has 3 components (x, y, z), not 1"),
    ],
)
def test_wrong_scalar_is_one_line(tmp_path: Path, name: str, value: object, message: str) -> None:
    with pytest.raises(InputError) as error:
        load_parameters("toy", SCALARS, written(tmp_path, WITH_SCALARS), {name: value})
    assert str(error.value) == message


def test_wrong_scalar_in_a_file_is_one_line(tmp_path: Path) -> None:
    for old, new, message in (
        ("value = 20.0", "value = 5.0", "parameters.speed: 5 m/s is below the smallest allowed 10"),
        ("value = 2\n", "value = [2]\n", "parameters.mass: a number is needed, not a list of 1"),
        ('unit = "kg"', 'unit = "t"', "parameters.mass.unit: 't' is not the SI unit 'kg'"),
    ):
        path = written(tmp_path, WITH_SCALARS.replace(old, new, 1))
        with pytest.raises(FileError) as error:
            load_parameters("toy", SCALARS, path)
        assert str(error.value).startswith(f"{path}: {message}")


def test_files_of_the_package_name_a_source_for_every_value() -> None:
    text = (data_folder() / "parameters" / "double_wishbone.toml").read_text(encoding="utf-8")
    assert text.count('source = "chrono"') == 9
    assert build("double_wishbone").parameters["wheel_centre"] == pytest.approx(
        [0.0, 0.7979, -0.1199]
    )


def test_model_reads_another_file(tmp_path: Path) -> None:
    text = (data_folder() / "parameters" / "double_wishbone.toml").read_text(encoding="utf-8")
    path = tmp_path / "mine.toml"
    path.write_text(text.replace("[0.0, 0.7979, -0.1199]", "[0.0, 0.8, -0.12]"), encoding="utf-8")
    assert build("double_wishbone", path).parameters["wheel_centre"][1] == 0.8
