"""Saved models: files that are refused, files that would do harm, and the ones that ship."""

import dataclasses
import json
import math
import subprocess
import sys
from typing import Any, NamedTuple

import netCDF4
import numpy as np
import pytest
import reduced_models
import xarray as xr

import vehiclemor as vm
from tests.models import CAR
from tests.unit.reduction.saved_files import NOTHING, refusal, rewritten
from vehiclemor.codegen.kernels import Kernels
from vehiclemor.exceptions import FileError, InputError
from vehiclemor.netcdf_file import write_dataset
from vehiclemor.reduction import parts
from vehiclemor.reduction.parts import Parts
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.simulation.build import build
from vehiclemor.study.plans.protocol import protocol_names
from vehiclemor.study.scenario import start_of

KERNELS = Kernels([])


class Pair(NamedTuple):
    """A part of a model, as methods have them."""

    first: Any
    second: Any


LOADED = """
import json, sys
import vehiclemor as vm
runs = [vm.load(path).simulate() for path in sys.argv[1:]]
print(json.dumps([[run.outputs.tobytes().hex() for run in runs], sorted(sys.modules)]))
"""


def test_another_process_gets_the_same_to_the_bit_and_derives_nothing(car, tmp_path):
    methods = "modal_truncation", "pod"
    made = [car, *(vm.reduce(CAR, name, training="nominal") for name in methods)]
    here = [rom.simulate().outputs.tobytes().hex() for rom in made]
    paths = [str(rom.save(tmp_path / f"{rom.method}.nc")) for rom in made]
    command = [sys.executable, "-c", LOADED, *paths]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    outputs, modules = json.loads(done.stdout)
    assert outputs == here
    assert not {"sympy", "numba", "xarray"} & set(modules)


class Kinds(NamedTuple):
    """Fields of all types that a plug-in may declare."""

    arrays: tuple[np.ndarray, ...]
    scalars: tuple[float | int | bool | str | None, ...]
    pair: Pair
    open: Any
    choice: Pair | float
    items: list[Pair]
    by_name: dict[str, tuple[float, ...]]
    bare: tuple


def read_again(value):
    """A value, written and read again."""
    writer = Parts(NOTHING)
    written = json.loads(json.dumps(writer.write(value, "value")))
    return Parts(NOTHING, writer.arrays).read(written, "value")


def test_parts_are_what_they_were(monkeypatch):
    # As of a plug-in that is in use.
    monkeypatch.setattr(parts, "_plug_ins", lambda: {__name__.partition(".")[0]})
    table = np.arange(6.0).reshape(2, 3)
    numbers = table.astype(int), table > 2.0, table + 1j * table, np.array(2j)
    arrays = table, table.T, *numbers, np.zeros((0, 3)), np.array([np.nan, -np.inf]), np.array(2.0)
    scalars = 1, -0.0, np.inf, True, None, "text", np.float64(0.1)
    further = Pair(1, (2, (3.0,))), 2.0, [Pair(table, "a")], {"b": (), "c": (1.0,)}, (1, Pair(1, 2))
    kinds = Kinds(arrays, scalars, Pair(1, 2), *further)
    again = read_again(kinds)
    for before, after in zip(arrays, again.arrays, strict=True):
        assert (after.dtype, after.shape) == (before.dtype, before.shape)
        np.testing.assert_array_equal(after, before)
    # Rows or columns stand together as they did: products are rounded by it.
    assert again.arrays[1].flags.f_contiguous
    assert math.copysign(1.0, again.scalars[1]) == -1.0
    np.testing.assert_array_equal(again.items[0].first, table)
    assert again._replace(arrays=(), items=[]) == kinds._replace(arrays=(), items=[])


def test_parameters_settings_and_training_come_along(tmp_path):
    mass = {"sprung_mass": 1400.0}
    given: dict[str, Any] = {"training": "nominal", "rank": 4}
    made = vm.reduce(build(CAR, overrides=mass), "pod", **given)
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
    with pytest.raises(FileError, match="no saved model"):
        car.save(saved.parent, overwrite=True)
    assert car.save(saved, overwrite=True) == saved
    with pytest.raises(InputError, match="is not a path"):
        car.save("")
    with pytest.raises(FileError, match="can't be written"):
        car.save(saved.parent / "nowhere" / "car.nc")
    assert [path.name for path in saved.parent.iterdir()] == ["car.nc"]


UNWRITABLE = [
    lambda state: state,
    build(CAR).start,
    KERNELS,
    [1.0, KERNELS],
    {2: 3.0},
    dataclasses.replace(build(CAR).system, inputs=1),
]


@pytest.mark.parametrize("wrong", UNWRITABLE)
def test_what_cant_be_written_is_named_and_leaves_no_file(wrong, car, tmp_path):
    other = dataclasses.replace(car, reduced=dataclasses.replace(car.reduced, offline=wrong))
    with pytest.raises(InputError, match=r"it can't be saved: reduced\.offline is "):
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


def test_another_version_that_makes_the_same_of_it_is_not(car, saved, monkeypatch):
    rewritten(saved, lambda dataset, _: dataset.attrs.update(vehiclemor="9.0"))
    np.testing.assert_array_equal(vm.load(saved).simulate().outputs, car.simulate().outputs)
    # What the same numbers are taken for has changed.
    encode = ReducedVehicle.encode
    monkeypatch.setattr(ReducedVehicle, "encode", lambda *given: encode(*given) + 0.01)
    assert "linear_single_track makes something else of these numbers" in refusal(saved)


def test_other_equations_and_formats_are_refused(car, saved):
    rewritten(saved, lambda dataset, _: dataset.update({"fingerprint": 1.01 * dataset.fingerprint}))
    assert "changed since" in refusal(saved)
    rewritten(saved, lambda dataset, _: dataset.attrs.update(saved_model=99))
    assert "format 99 where" in refusal(saved)
    assert reduced_models.fitted_once(saved, lambda: car).method == vm.load(saved).method


SHIPPED = [*protocol_names()]


@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_model_is_what_a_fit_gives(name):
    choice = reduced_models.shipped(name)
    other = reduced_models.stale(name, choice)
    mend = f"data/reduced is out of date, see the other side: run {reduced_models.COMMAND}"
    # Of other source a fit may be the same; one that takes no time is always made.
    assert set(other) <= {"source"}, mend
    if other or name == "double_wishbone":
        made = reduced_models.fitted(choice)
        assert reduced_models.difference(choice, vm.rom(name), made) <= reduced_models.SAME, mend


@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_model_keeps_its_bounds_on_runs_of_the_validation(name):
    rom, choice = vm.rom(name), reduced_models.shipped(name)
    for scenario in choice.protocol.sets["validation"][:2]:
        own = rom.for_parameters(dict(scenario.parameters)) if scenario.parameters else rom
        start = start_of(own.model, scenario)
        run, full = (it.simulate(scenario.maneuver, start) for it in (own, own.model))
        assert reduced_models.in_bounds(choice.protocol, run, full) <= 1.0
        assert run.status == "ok"


def test_a_model_without_a_shipped_one_is_named():
    with pytest.raises(InputError, match="unknown reduced model that ships 'tricycle'"):
        vm.rom("tricycle")
