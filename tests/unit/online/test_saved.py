"""Saved models: files that are refused, files that would do harm, and the ones that ship."""

import dataclasses
import json
import math
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple
from unittest import mock

import netCDF4
import numpy as np
import pytest
import reduced_models
import xarray as xr

import vehiclemor as vm
from vehiclemor.codegen.kernels import Kernels, KernelSource
from vehiclemor.errors import FileError, InputError
from vehiclemor.online import model_file, parts
from vehiclemor.online.parts import Reader, Writer
from vehiclemor.online.rom import ReducedOrderModel
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.resources import data_names
from vehiclemor.simulation.build import build
from vehiclemor.study.netcdf_file import write_dataset
from vehiclemor.study.scenario import start_of

CAR = "independent_suspension_vehicle"


@pytest.fixture(scope="module")
def car() -> ReducedOrderModel:
    """A car whose equations are features in a text."""
    return vm.reduce(CAR, "linear_single_track", training="nominal")


@pytest.fixture
def saved(car: ReducedOrderModel, tmp_path: Path) -> Path:
    return car.save(tmp_path / "car.nc")


def rewritten(path: Path, change: Callable[[xr.Dataset, dict[str, Any]], None]) -> Path:
    """A file with other content that is whole, as its author would write it."""
    with xr.open_dataset(path, decode_cf=False) as file:
        dataset = file.load()
    found = json.loads(dataset["parts"].item())
    change(dataset, found)
    dataset["parts"] = ((), json.dumps(found))
    path.unlink()
    write_dataset(dataset, path)
    return path


def refusal(path: Path) -> str:
    with pytest.raises(FileError) as caught:
        vm.load(path)
    line = str(caught.value)
    assert line.startswith(f"{path}: ")
    assert "\n" not in line
    return line


LOADED = """
import json, sys
import vehiclemor as vm
runs = [vm.load(path).simulate() for path in sys.argv[1:]]
print(json.dumps([[run.outputs.tobytes().hex() for run in runs], sorted(sys.modules)]))
"""


def test_another_process_gets_the_same_to_the_bit_and_derives_nothing(car, tmp_path):
    made = [car, *(vm.reduce(CAR, name, training="nominal") for name in ("softened_slip", "pod"))]
    here = [rom.simulate().outputs.tobytes().hex() for rom in made]
    paths = [str(rom.save(tmp_path / f"{rom.method}.nc")) for rom in made]
    command = [sys.executable, "-c", LOADED, *paths]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    outputs, modules = json.loads(done.stdout)
    assert outputs == here
    assert not {"sympy", "numba", "xarray"} & set(modules)


class Pair(NamedTuple):
    """A part of a model, as methods have them."""

    first: Any
    second: Any


def parted(value: Any) -> tuple[Any, dict[str, np.ndarray]]:
    """A value, written and read again; arrays as they were written."""
    model = build("double_wishbone")
    writer = Writer(model)
    written = json.loads(json.dumps(writer.part(value, "value")))
    return Reader(model, writer.arrays).value(written, "value"), writer.arrays


def test_parts_are_what_they_were(monkeypatch):
    # As of a plug-in that is in use.
    monkeypatch.setattr(parts, "_plug_ins", lambda: {"tests"})
    table = np.arange(6.0).reshape(2, 3)
    values = {
        "numbers": (1, -0.0, np.inf, True, None, "text", np.float64(0.1), np.int64(3)),
        "nested": [Pair(1, (2, [3.0])), {"a": {"b": ()}}],
        "arrays": Pair(table, table.T),
        "kinds": (
            table > 2.0,
            table.astype(int),
            table + 1j * table,
            np.zeros((0, 3)),
            np.array(2.0),
        ),
        "rest": np.array([np.nan, -np.inf]),
    }
    made, _ = parted(values)
    for before, after in zip(values["kinds"], made["kinds"], strict=True):
        assert (after.dtype, after.shape) == (before.dtype, before.shape)
        np.testing.assert_array_equal(after, before)
    assert made["numbers"] == values["numbers"]
    assert math.copysign(1.0, made["numbers"][1]) == -1.0
    assert made["nested"] == values["nested"]
    assert isinstance(made["nested"][0], Pair)
    # Rows or columns stand together as they did: products are rounded by it.
    assert made["arrays"].second.flags.f_contiguous
    np.testing.assert_array_equal(made["arrays"].second, table.T)
    np.testing.assert_array_equal(made["rest"], values["rest"])
    again, once = parted((table, table))
    assert len(once) == 1
    np.testing.assert_array_equal(again[0], again[1])


def test_parameters_settings_and_training_come_along(tmp_path):
    mass = {"sprung_mass": 1400.0}
    made = vm.reduce(build(CAR, overrides=mass), "pod", training="nominal", rank=4)
    again = vm.load(made.save(tmp_path / "model.nc"))
    assert again.parameters["sprung_mass"] == 1400.0
    assert again.settings == made.settings
    assert again.settings["rank"] == 4
    assert [dict(run) for run in again.training] == [run.content for run in made.training]
    assert again.model.parameters.entries["unsprung_mass"].source != "override"
    # What was loaded can be saved.
    third = vm.load(again.save(tmp_path / "third.nc"))
    assert third.training == again.training
    np.testing.assert_array_equal(third.simulate().outputs, made.simulate().outputs)


def test_a_path_that_is_taken_is_refused_unless_asked(car, saved):
    before = saved.read_bytes()
    with pytest.raises(InputError, match="is there already"):
        car.save(saved)
    assert saved.read_bytes() == before
    with pytest.raises(InputError, match="is there already"):
        car.save(saved.parent, overwrite=True)
    assert car.save(saved, overwrite=True) == saved
    with pytest.raises(InputError, match="is not a path"):
        car.save("")
    with pytest.raises(FileError, match="can't be written"):
        car.save(saved.parent / "nowhere" / "car.nc")
    assert [path.name for path in saved.parent.iterdir()] == ["car.nc"]


def test_what_cant_be_written_is_named_and_leaves_no_file(car, tmp_path):
    @dataclasses.dataclass(frozen=True)
    class Local:
        weight: float = 1.0

    for wrong, what in (
        (lambda state: state, "reduced.offline"),
        (Local(), "reduced.offline"),
        ([1.0, {2: 3.0}], "reduced.offline.1"),
        (np.array(["text"]), "reduced.offline"),
        (np.zeros(3, dtype=np.float32), "reduced.offline"),
    ):
        other = dataclasses.replace(car, reduced=dataclasses.replace(car.reduced, offline=wrong))
        with pytest.raises(InputError, match=f"linear_single_track of {CAR}: .* {what} is"):
            other.save(tmp_path / "car.nc")
    assert list(tmp_path.iterdir()) == []


def test_what_is_no_saved_model_is_refused(saved, tmp_path):
    assert "no such saved model" in refusal(tmp_path / "none.nc")
    assert "is a folder" in refusal(tmp_path)
    content = saved.read_bytes()
    (text := tmp_path / "text.nc").write_text("mass = 3")
    assert "damaged, or no netCDF-4 file" in refusal(text)
    (torn := tmp_path / "torn.nc").write_bytes(content[: len(content) // 2])
    assert "not a readable saved model" in refusal(torn)
    (other := tmp_path / "other.nc").write_bytes(content)
    with netCDF4.Dataset(other, "r+") as file:
        file["reduced.coefficients"][0, 0] += 1e-12
    assert "not what was written" in refusal(other)
    write_dataset(xr.Dataset({"x": ("t", [1.0])}), foreign := tmp_path / "foreign.nc")
    assert refusal(foreign).endswith("not a saved model")
    with pytest.raises(InputError, match="is not a path"):
        vm.load(3)


def test_another_version_is_refused(saved):
    rewritten(saved, lambda dataset, _: dataset.attrs.update(saved_model=99))
    assert "saved by another version, format 99 where" in refusal(saved)


def test_another_version_that_makes_the_same_of_it_is_not(car, saved, monkeypatch):
    rewritten(saved, lambda dataset, _: dataset.attrs.update(vehiclemor="9.0"))
    np.testing.assert_array_equal(vm.load(saved).simulate().outputs, car.simulate().outputs)
    # What the same numbers are taken for has changed.
    encoded = ReducedVehicle.encoded
    monkeypatch.setattr(ReducedVehicle, "encoded", lambda *given: encoded(*given) + 0.01)
    assert "linear_single_track makes something else of these numbers" in refusal(saved)


@pytest.mark.parametrize(
    ("name", "text", "why"),
    [
        ("parameters", {"no_such_mass": 3.0}, "'no_such_mass' is not a parameter"),
        ("parameters", {"sprung_mass": -3.0}, "sprung_mass"),
        ("settings", {"no_such_setting": 3.0}, "unknown setting"),
        ("settings", {"tolerance": "wide"}, "tolerance"),
        ("training", 3, "TypeError"),
    ],
)
def test_texts_that_dont_fit_are_refused(saved, name, text, why):
    def change(dataset: xr.Dataset, _: object) -> None:
        dataset[name] = ((), json.dumps(text))

    assert why in refusal(rewritten(saved, change))


def test_other_equations_are_refused(saved):
    def change(dataset: xr.Dataset, _: object) -> None:
        dataset["fingerprint"] *= 1.0 + 1e-6

    assert f"the equations of {CAR} have changed" in refusal(rewritten(saved, change))


def replaced(places: str, value: Any) -> Callable[[xr.Dataset, dict[str, Any]], None]:
    """Puts a value at `a.b.c` in the parts of a model."""

    def change(_: object, found: dict[str, Any]) -> None:
        *path, last = places.split(".")
        for name in path:
            found = found[name]
        found[last] = value

    return change


HARM = "__import__('pathlib').Path('harm').touch()"
FEATURES = "reduced.fields.features.fields"


@pytest.mark.parametrize(
    ("place", "value"),
    [
        ("reduced.class", "os:system"),
        ("reduced.class", "vehiclemor.files:write_text"),
        ("reduced.class", "vehiclemor.reduction.vehicle.features:monomials.__globals__"),
        ("reduced.class", "vehiclemor.cli.app:main"),
        ("reduced.fields.offline", {"function": "os:abort"}),
        ("reduced.fields.offline", {"function": "subprocess:run"}),
        ("reduced.fields.offline", {"code": HARM}),
        ("reduced.fields.offline", {"method": "__reduce__", "of": {"model": ""}}),
        ("reduced.fields.offline", {"same": "reduced.nothing"}),
        ("reduced.fields.offline.fields", {"minutes": 0.0}),
        ("reduced", {"tuple": [1.0]}),
        ("known", {"function": "vehiclemor.reduction.trust:trust_of"}),
        ("reduced.fields.coefficients", {"array": "reduced.nothing"}),
        # Texts that would become machine code: nothing but arithmetic, of their own numbers.
        (f"{FEATURES}.terms.tuple", [HARM] * 8),
        (f"{FEATURES}.terms.tuple", ["_x[99999]"] * 8),
        (f"{FEATURES}.terms.tuple", ["p[99999]"] * 8),
        (f"{FEATURES}.terms.tuple", ["z0\n    _result[99999] = z0"] * 8),
        (f"{FEATURES}.terms.tuple", ["z0", "z1"]),
        (f"{FEATURES}.lines.tuple", [{"tuple": ["_result[99999]", "z0"]}]),
        (f"{FEATURES}.lines.tuple", [{"tuple": ["a = 1.0\n    _x", "z0"]}]),
        (f"{FEATURES}.diagonal.tuple", [9, 9]),
        (
            "reduced.fields.error_scale",
            {"array": "reduced.parameters", "type": "float64", "shape": [1], "turned": False},
        ),
    ],
)
def test_parts_that_would_do_harm_are_refused(saved, place, value, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    refusal(rewritten(saved, replaced(place, value)))
    assert not Path("harm").exists()


@pytest.mark.parametrize(
    "name",
    [
        "os:system",
        "subprocess:run",
        "builtins:eval",
        "vehiclemor.files:write_text",
        "vehiclemor.cli.app:main",
        "vehiclemor.reduction.no_such_room:thing",
        "vehiclemor.reduction.vehicle.features:Features.blocks",
        "vehiclemor.reduction.vehicle.features:PLANAR",
        # Defined elsewhere.
        "vehiclemor.reduction.vehicle.shape:dataclass",
    ],
)
def test_names_of_other_things_are_refused(name):
    with pytest.raises(ValueError, match="there is no"):
        parts.named(name)


@pytest.mark.parametrize(
    "text",
    [
        "_result[99999] = _x[0]",
        "_result[0] = _x[99999]",
        "_result[0] = _constants[99999]",
        "a, b = weighted_sums(_constants, 0, (" + "_x[0], " * 9999 + "))\n    _result[0] = a",
        "combine(_result[0], 99999, 1.0, _x[0])",
        "_result[_x[0]] = 1.0",
    ],
)
def test_kernels_that_reach_beyond_their_arrays_are_refused(text, tmp_path):
    refusal(with_kernel(text, tmp_path))


def test_a_kernel_is_arithmetic_or_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert "import" in refusal(with_kernel(f"_result[0] = {HARM}", tmp_path))
    assert not Path("harm").exists()


def with_kernel(text: str, folder: Path) -> Path:
    """File of a car whose equations are another text."""
    arguments = ("_x", "_u", "_constants", "_result")
    kernel = f"def derivative({', '.join(arguments)}):\n    {text}\n"
    kernels = Kernels({"derivative": KernelSource("derivative", kernel, arguments, (0,) * 4, 1)})
    made = vm.reduce(CAR, "softened_slip")
    system = dataclasses.replace(made.reduced.system, kernels=kernels)
    reduced = dataclasses.replace(made.reduced, system=system)
    # Nothing here runs it.
    with mock.patch.object(model_file, "response", return_value=np.empty(0)):
        return dataclasses.replace(made, reduced=reduced).save(folder / "model.nc")


SHIPPED = data_names("protocols")


@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_model_is_what_its_protocol_chooses(name):
    choice = reduced_models.chosen(name)
    other = reduced_models.stale(name, choice)
    mend = f"data/reduced is out of date, see the other side: run {reduced_models.COMMAND}"
    # Of other source a fit may be the same; one that takes no time is always made.
    assert set(other) <= {"source"}, mend
    if other or name == "double_wishbone":
        made = reduced_models.fitted(choice)
        assert reduced_models.difference(choice, vm.rom(name), made) <= reduced_models.SAME, mend


@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_model_keeps_its_bounds_on_runs_of_the_validation(name):
    rom, choice = vm.rom(name), reduced_models.chosen(name)
    bounds = choice.protocol.definition.bounds
    for scenario in choice.protocol.sets["validation"][:2]:
        start = start_of(rom.model, scenario)
        run, full = (
            rom.simulate(scenario.maneuver, start),
            rom.model.simulate(scenario.maneuver, start),
        )
        errors = np.abs(run.outputs - full.outputs)
        for output, bound in bounds.items():
            column = errors[:, rom.output_names.index(output)]
            size = column.max() if bound.measure == "max" else np.sqrt(np.mean(column**2))
            assert size <= bound.bound
        assert run.status == "ok"


def test_a_model_without_a_shipped_one_is_named():
    with pytest.raises(InputError, match="unknown model with a reduced one that ships 'tricycle'"):
        vm.rom("tricycle")


def test_a_reduced_plug_in_is_saved(plug_in_package, tmp_path):
    made = vm.reduce("quarter_car", "pod", training="nominal", rank=2)
    again = vm.load(made.save(tmp_path / "model.nc"))
    np.testing.assert_array_equal(again.simulate().outputs, made.simulate().outputs)
