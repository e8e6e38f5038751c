"""Saved models: files that are refused, files that would do harm, and the ones that ship."""

import dataclasses
import json
import math
import os
import subprocess
import sys
from contextlib import ExitStack, chdir
from types import SimpleNamespace
from typing import Any, NamedTuple
from unittest import mock

import netCDF4
import numpy as np
import pytest
import reduced_models
import xarray as xr

import vehiclemor as vm
from vehiclemor import netcdf_file
from vehiclemor.codegen.kernels import Kernels
from vehiclemor.codegen.operations import KINDS, MOST_SIZE
from vehiclemor.exceptions import FileError, InputError
from vehiclemor.netcdf_file import write_dataset
from vehiclemor.reduction import parts
from vehiclemor.reduction.parts import Parts
from vehiclemor.reduction.reduced_model import shipped_folder
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.simulation.build import build
from vehiclemor.study.plans.protocol import protocol_names
from vehiclemor.study.scenario import start_of

CAR = "independent_suspension_vehicle"
KERNELS = Kernels([])
# What refers to no model.
NOTHING: Any = SimpleNamespace()


class Pair(NamedTuple):
    """A part of a model, as methods have them."""

    first: Any
    second: Any


@pytest.fixture(scope="module")
def car():
    """A car whose equations are features."""
    return vm.reduce(CAR, "linear_single_track", training="nominal")


@pytest.fixture
def saved(car, tmp_path):
    return car.save(tmp_path / "car.nc")


@pytest.fixture(scope="module")
def contents(car, tmp_path_factory):
    """Files of all kinds of reduced models."""
    made = {
        "bicycle": car,
        "pod": vm.reduce(CAR, "pod", training="nominal", formulation="state"),
        "windows": vm.reduce("double_wishbone", "pod", training="nominal"),
        "replay": vm.reduce("double_wishbone", "replay"),
    }
    folder = tmp_path_factory.mktemp("saved")
    paths = {name: rom.save(folder / f"{name}.nc") for name, rom in made.items()}
    names = {"car": CAR, "map": "double_wishbone", "guarded": "high_fidelity_vehicle"}
    paths |= {name: shipped_folder() / f"{model}.nc" for name, model in names.items()}
    # What the full models need is compiled.
    _ = [vm.load(path) for path in paths.values()]
    return {name: path.read_bytes() for name, path in paths.items()}


def rewritten(path, change):
    """A file with other content that is whole, as its author would write it."""
    with xr.open_dataset(path, decode_cf=False) as file:
        dataset = file.load()
    found = json.loads(dataset["parts"].item())
    change(dataset, found)
    dataset["parts"] = ((), json.dumps(found))
    path.unlink()
    write_dataset(dataset, path)
    return path


def replaced(changes):
    """Puts values, or functions of what is there, at paths `a.b.c` in the parts of a model."""

    def change(dataset, found):
        stored = {str(name): variable.values for name, variable in dataset.items()}
        for path, value in changes.items():
            holder, key, node = found, "", found
            for name in path.split("."):
                holder, key = node, int(name) if isinstance(node, list) else name
                node = node[key]
            is_array = isinstance(node, dict) and "@array" in node
            old = Parts(NOTHING, stored).read(node, path) if is_array else node
            new, parts_of = value(old) if callable(value) else value, Parts(NOTHING)
            holder[key] = parts_of.write(new, path) if isinstance(new, np.ndarray) else new
            for array in parts_of.arrays.values():
                dataset[path] = [f"{path}_changed_{axis}" for axis in range(array.ndim)], array

    return change


def refusal(path):
    with pytest.raises(FileError) as caught:
        vm.load(path)
    line = str(caught.value)
    assert line.startswith(f"{path}: ")
    assert "\n" not in line
    return line


def refused_untouched(path):
    """Why a file is refused of which nothing is compiled, run or left in its folder."""
    before = [*path.parent.iterdir()]
    places = (
        "codegen.kernels.MachineCode",
        "codegen.loops.MachineCode",
        "reduction.model_file.response",
    )
    with ExitStack() as stack:
        stack.enter_context(chdir(path.parent))
        mocks = [stack.enter_context(mock.patch(f"vehiclemor.{place}")) for place in places]
        line = refusal(path)
    assert not any(used.called for used in mocks)
    assert [*path.parent.iterdir()] == before
    return line


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
    arrays = (
        table,
        table.T,
        *numbers,
        np.zeros((0, 3)),
        np.array([np.nan, -np.inf]),
        np.array(2.0),
    )
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


def test_values_of_another_type_than_declared_are_not_written(monkeypatch):
    monkeypatch.setattr(parts, "_plug_ins", lambda: {__name__.partition(".")[0]})
    for wrong in ([1.0], {"a": 1.0}, np.zeros(3, dtype=np.float32), SimpleNamespace()):
        with pytest.raises(InputError, match="it can't be saved: value\\.first is"):
            read_again(Pair(wrong, 1.0))


def test_parameters_settings_and_training_come_along(tmp_path):
    mass = {"sprung_mass": 1400.0}
    given: dict[str, Any] = {"training": "nominal", "rank": 4, "restart": "full_model"}
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
    *((lambda state: state, "offline"), (build(CAR).start, "offline"), (Pair(1.0, 2.0), "offline")),
    *((KERNELS, "offline"), ([1.0, KERNELS], "offline"), ({2: 3.0}, "offline")),
    *((np.array(["text"]), "offline"), (np.zeros(3, dtype=np.float32), "offline")),
    (dataclasses.replace(build(CAR).system, inputs=1), "offline"),
]


@pytest.mark.parametrize(("wrong", "what"), UNWRITABLE)
def test_what_cant_be_written_is_named_and_leaves_no_file(wrong, what, car, tmp_path):
    other = dataclasses.replace(car, reduced=dataclasses.replace(car.reduced, offline=wrong))
    with pytest.raises(InputError) as error:
        other.save(tmp_path / "car.nc")
    start = f"linear_single_track of {CAR}: it can't be saved: reduced.{what} is "
    assert str(error.value).startswith(start)
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


TEXTS_BESIDE = [
    *(("parameters", {"no_such_mass": 3.0}, "no_such_mass"), ("training", 3, "TypeError")),
    *(("parameters", {"sprung_mass": -3.0}, "sprung_mass"), ("settings", {"none": 1.0}, "none")),
    ("settings", {"tolerance": "wide"}, "tolerance"),
]


@pytest.mark.parametrize(("name", "text", "why"), TEXTS_BESIDE)
def test_texts_that_dont_fit_are_refused(saved, name, text, why):
    change = {name: ((), json.dumps(text))}
    assert why in refusal(rewritten(saved, lambda dataset, _: dataset.update(change)))


def test_other_equations_and_formats_are_refused(saved):
    rewritten(saved, lambda dataset, _: dataset.update({"fingerprint": 1.01 * dataset.fingerprint}))
    assert "changed since" in refusal(saved)
    rewritten(saved, lambda dataset, _: dataset.attrs.update(saved_model=99))
    assert "format 99 where" in refusal(saved)


HARM = "__import__('pathlib').Path('harm').touch()"
ROOM = "vehiclemor.reduction"
VECTOR = {"@array": "float64", "turned": False}
COST = {"@class": f"{ROOM}.interface:OfflineCost"}
# Types are checked whatever else a part says of itself.
HIDDEN = {"@class": f"{ROOM}.interface:OfflineCost", "seconds": "long"}
KERNEL = {"kernels": "def derivative(x, result): result[9] = x[9]"}
# Of the bicycle: path -> what is no part that may stand there.
PARTS = [
    *(("input_range", wrong) for wrong in (None, [1.0], COST, {"@full": "system"})),
    *(("reduced", wrong) for wrong in ({}, [], 3.0, {"@full": "model"}, COST)),
    *(("@class", f"{ROOM}.vehicle.features:monomials"), ("offline", HIDDEN), ("offline", None)),
    *(("offline", {"function": f"{ROOM}.trust:trust_of"}), ("offline", {"code": HARM})),
    *(("offline", KERNEL), ("offline", {"minutes": 0.0}), ("offline", {"@full": "model"})),
    *(("offline", {"@full": name}) for name in ("parameters", "kernels", [])),
    *(("features", COST), ("features", []), ("shape", {}), ("shape", [1.0])),
    *(
        ("features.states", True),
        ("features.terms", ["z0", 3]),
        ("features.terms", [True]),
        ("features.groups", [[[math.nan], [1]]]),
        ("features.operations", {"kinds": VECTOR}),
    ),
    *(("coefficients", 3.0), ("coefficients", [VECTOR]), ("coefficients", {"array": "parts"})),
    *(("solver", VECTOR), ("tolerance", "1e-3"), ("tolerance", True), ("tolerance", [1e-3])),
    ("model", {"@class": "vehiclemor.simulation.dynamic:DynamicModel"}),
    *(("error_scale", {"@array": kind}) for kind in ("int64", "object", "complex128", [], None)),
    ("error_scale", {"@array": "float64"}),
]


@pytest.mark.parametrize(("place", "value"), PARTS)
def test_parts_that_would_do_harm_are_refused(saved, place, value):
    whole = place if place in ("input_range", "reduced") else f"reduced.{place}"
    refused_untouched(rewritten(saved, replaced({whole: value})))


NAMES = [
    *("os:system", "builtins:eval", "vehiclemor.files:write_text", f"{ROOM}.no_such_room:thing"),
    *("vehiclemor.simulation.dynamic:DynamicModel", "vehiclemor.simulation.build:build"),
    *("vehiclemor.simulation.system:System", f"{ROOM}.reduced_system:ReducedMechanism"),
    *(f"{ROOM}.vehicle.features:{name}" for name in ("monomials", "Features.blocks", "PLANAR")),
    # Defined elsewhere.
    f"{ROOM}.vehicle.reduced_vehicle:Features",
]


@pytest.mark.parametrize("name", NAMES)
def test_names_of_other_things_are_refused(name):
    with pytest.raises(ValueError, match="there is no"):
        parts.named(name)


# File, word of the check that sees it, changes of the array a that reach beyond other parts.
SIZES = """
bicycle states features.states=0 features.states=101 features.inputs=-1 features.inputs=101
bicycle features features.inputs=2
bicycle lateral features.lateral=1 features.lateral=-1
bicycle groups features.groups=g([0,0],[1]) features.groups=g([-1],[1]) features.groups=g([8],[1])
bicycle groups features.groups=g([0],[1,1]) features.groups=g([0],[6]) features.groups=g([],[1])
bicycle groups features.groups=g([0],[]) features.groups=g(*[[0]]*14)
bicycle parameters parameters=a[:-1] parameters=a.astype(int) parameters=a[None]
bicycle modes transient.rates=ones(22)|transient.left=ones([22,21])|transient.right=ones([22,21])
bicycle largest input_range.largest=a[:-1] input_range.largest=a[:,:0]
bicycle largest input_range.largest=a.astype(int)
car lateral features.lateral=4
car features decoded_features.states=10 decoded_features.inputs=2
car coefficients coefficients=a[:-1] coefficients=a[:,:-1] coefficients=a.astype(int)
car decoding decoding=a[:-1] decoding=a[:,:-1]
car encoding encoding=a[:,:-1] feedthrough=a[:-1]
car error_scale error_scale=a[:-1]
car transient transient.rates=a[:-1] transient.left=a[:-1] transient.right=a[:-1]
car transient transient.left=a[:,:-1]|transient.right=a[:,:-1]
car lasted reach.lasted=a[:,:-1] reach.lasted=a[:-2] reach.left=a[:-1]|reach.starts=a[:,:-1]
car lasted reach.decaying=a[:-1]|reach.steered=a[:-1]
car starts reach.starts=a[:,:-1] reach.left=a.astype(int) reach.begun=a.astype(int)
car steered reach.steered=a[:-1] reach.decaying=a.astype(int)
car reach reach.inputs=a[:-1] reach.inputs=a.astype(int) reach.inputs=hstack([a,a])
guarded simulate reduced=COST
guarded full full=COST
map ranges ranges=a[:-1] ranges=nan*a
map moving moving=[0,2] moving=[0,-1] moving=[1,1]
map degree degree=21 degree=-1 moving=[]|cells.coefficients=a[:,:1]
map columns columns=a[:-1] columns=[*a[:-1],-1] columns=[*a[:-1],14]
map cells cells.centres=a[:1] cells.scales=a[:1]
map cells cells.centres=nan*a cells.scales=nan*a
map cells cells.coefficients=a[:-1] cells.coefficients=a.astype(int)
map coefficients cells.coefficients=a[:,:-1] cells.coefficients=a[:,:,:-1]
map numbers cells.numbers=-a cells.numbers=1.0*a
pod spaces spaces.edges=a[:-1] spaces.means=a[:-1] spaces.means=a[:,:-1]
pod spaces spaces.test_basis=a[:-1] spaces.test_basis=a[:,:,:-1] spaces.trial_basis=a[:-1]
pod formulation spaces.formulation="other" spaces.formulation="full"
pod ranks spaces.ranks=a+99 spaces.ranks=-a spaces.ranks=1.0*a
windows edges edges=a[:-1]
windows basis bases.0.mean=a[:-1] bases.0.mean=a.astype(int)
windows bases bases.1.mean=a[:-1]|bases.1.vectors=a[:-1]
windows rank bases.0.vectors=ones((len(a),len(a)+1))
replay samples recorded.0.inputs=a[:-1] recorded.0.outputs=a[:-1] recorded.0.speeds=ones(3)
replay time recorded.0.times=a[:0] recorded.0.times=a.astype(int)
replay outputs recorded.0.outputs=a[:,:-1]
replay conditions conditions=a[:0] conditions=a[:,:-1]
"""
ROWS = [row.split() for row in SIZES.strip().splitlines()]
CASES = [(file, word, change) for file, word, *row in ROWS for change in row]
# At several places.
BOXES = ("centres=a[:1]", "scales=a[:1]", "numbers=a[:1]")
BASES, NO_BASES = (
    ("means=a[{}]", "trial_basis=a[{}]", "test_basis=a[{}]"),
    ("ranks=a[:0]", "edges=a[:1]"),
)
CASES += [
    ("map", "cells", "|".join(f"cells.{box}" for box in (*BOXES, "coefficients=a[:24]"))),
    ("pod", "spaces", "|".join(f"spaces.{base}".format("...,:-1") for base in BASES)),
    ("pod", "formulation", "|".join(f"spaces.{b}".format(":0") for b in (*BASES, *NO_BASES))),
]


def grouped(*parts):
    return [[*pair] for pair in zip(parts[::2], parts[1::2], strict=True)]


def changed(text):
    """Changes `place=expression|place=expression`."""
    names = vars(np) | {"g": grouped, "COST": COST}
    pairs = [pair.split("=") for pair in text.split("|")]
    return {
        place if place.startswith("input_range") else f"reduced.{place}": way
        for place, expression in pairs
        for way in [eval(f"lambda a: {expression}", names)]  # noqa: S307 - own texts
    }


@pytest.mark.parametrize(("file", "word", "change"), CASES)
def test_sizes_that_dont_fit_are_refused(file, word, change, contents, tmp_path):
    (path := tmp_path / "model.nc").write_bytes(contents[file])
    assert word in refused_untouched(rewritten(path, replaced(changed(change))))


def row(number, *values):
    """Another row of the arguments of operations."""
    return f"arguments=where(arange(len(a))[:,None]-{number},a,{[*values]})".replace(" ", "")


def alone(kind):
    """Only operations of one kind, on the first one, so many that they take long to compile."""
    more = MOST_SIZE // 150
    kinds = f"kinds=append(a,repeat({[*KINDS].index(kind)},{more}))"
    return f"{kinds}|arguments=vstack([a,zeros(({more},3),int)])|numbers=append(a,zeros({more}))"


# Operations 0, 1 and 2 of the bicycle are reduced coordinates, the last one multiplies.
OPERATIONS = [
    *(
        "kinds=a+99",
        "kinds=-1-a",
        "kinds=1.0*a",
        "kinds=a[None]",
        "numbers=a.astype(int)",
        "arguments=a+99",
        "arguments=1.0*a",
        "numbers=a[:-1]",
    ),
    # What they were not given, and what is not there yet.
    *(row(0, *entry) for entry in ((0, 9, 0), (1, 9, 0), (2, 99999, 0), (3, 0, 0))),
    row("len(a)+1", 0, 9999, 0),
    # A comparison for a number, and a number for a comparison.
    *(f"kinds=where(a-2,a,{[*KINDS].index('<')})", f"kinds=append(a[:-1],{len(KINDS) - 1})"),
    # More than compiles soon.
    *map(alone, ("sqrt", "atan2", "power")),
]


@pytest.mark.parametrize("change", OPERATIONS, ids=range(len(OPERATIONS)))
def test_operations_that_are_more_than_arithmetic_of_what_is_given_are_refused(change, saved):
    inner = "features.operations"
    changes = changed("|".join(f"{inner}.{one}" for one in change.split("|")))
    refused_untouched(rewritten(saved, replaced(changes)))


@pytest.mark.parametrize("number", [-1, 10**6, 0.0, "0", HARM, None])
@pytest.mark.parametrize("place", ["named", "terms", "watched"])
def test_numbers_of_operations_must_be_there(place, number, saved):
    entry = [number, "speed"] if place == "watched" else number
    more = {f"reduced.features.{place}": lambda known: [entry, *known[1:]]}
    refused_untouched(rewritten(saved, replaced(more)))


def test_what_is_huge_where_it_is_written_small_is_refused_soon(saved):
    # Never written: it takes no space in the file.
    with netCDF4.Dataset(saved, "r+") as file:
        for axis in "ab":
            file.createDimension(axis, 10**9)
        file.createVariable("huge", "f8", ("a", "b"), chunksizes=(1000, 1000))
    content = saved.read_bytes()
    saved.write_bytes(content + netcdf_file.SEAL + netcdf_file._digest(content))
    assert "its variables have more than" in refused_untouched(saved)


def test_parts_that_are_deep_are_refused(saved):
    deep = replaced({"reduced.offline": json.loads("[" * 900 + "]" * 900)})
    refused_untouched(rewritten(saved, deep))


@pytest.mark.parametrize("text", ["[" * 100_000, "1" * 5_000, "[" + "0," * 2_000_001 + "0]"])
def test_texts_that_are_deep_or_long_are_refused_soon(text, saved):
    with mock.patch.object(json, "dumps", return_value=text):
        rewritten(saved, lambda *_: None)
    refused_untouched(saved)


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


@pytest.mark.parametrize("processor", ["Prescott", "SkylakeX"])
def test_shipped_models_can_be_read_on_other_processors(processor):
    # OpenBLAS then computes as there; other libraries of linear algebra ignore this.
    environment = os.environ | {"OPENBLAS_CORETYPE": processor}
    read = f"import vehiclemor as vm; [vm.rom(name) for name in {SHIPPED}]"
    subprocess.run([sys.executable, "-c", read], env=environment, check=True)


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


def test_a_plug_in_is_saved_unless_it_has_kernels(plug_in_package, tmp_path, monkeypatch):
    monkeypatch.setattr(parts, "_plug_ins", lambda: {"quarter_car"})
    made = vm.reduce("quarter_car", "quarter_car_modes", training="nominal")
    again = vm.load(made.save(tmp_path / "model.nc"))
    np.testing.assert_array_equal(again.simulate().outputs, made.simulate().outputs)
    wrong = dataclasses.replace(made.reduced, equations=KERNELS)
    with pytest.raises(InputError, match=r"can't be saved: reduced\.equations is .*Kernels"):
        dataclasses.replace(made, reduced=wrong).save(tmp_path / "wrong.nc")
