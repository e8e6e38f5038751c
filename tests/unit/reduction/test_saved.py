"""Saved models: files that are refused, files that would do harm, and the ones that ship."""

import dataclasses
import json
import math
import os
import subprocess
import sys
from contextlib import ExitStack, chdir, contextmanager, suppress
from types import SimpleNamespace
from typing import Any, NamedTuple
from unittest import mock

import netCDF4
import numpy as np
import pytest
import reduced_models
import xarray as xr

import vehiclemor as vm
from tests.models import CAR
from tests.refusing import refused
from vehiclemor import netcdf_file
from vehiclemor.codegen.kernels import Kernels
from vehiclemor.codegen.operations import KINDS, MOST_SIZE
from vehiclemor.exceptions import FileError, InputError
from vehiclemor.netcdf_file import write_dataset
from vehiclemor.reduction import parts
from vehiclemor.reduction.parts import Reader, Writer
from vehiclemor.reduction.reduced_model import shipped_folder
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.simulation.build import build
from vehiclemor.study.plans.protocol import protocol_names
from vehiclemor.study.scenario import start_of

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


def written(path, dataset, change):
    """A file with other content that is complete, as its author would write it."""
    dataset, tree = dataset.copy(), json.loads(dataset["parts"].item())
    change(dataset, tree)
    dataset["parts"] = ((), json.dumps(tree))
    path.unlink(missing_ok=True)
    write_dataset(dataset, path)
    return path


def content(path):
    with xr.open_dataset(path, decode_cf=False) as file:
        return file.load().drop_encoding()


def rewritten(path, change):
    return written(path, content(path), change)


def replaced(changes):
    """Puts values, or functions of what is there, at places `a.b.c` in the parts of a model."""

    def change(dataset, tree):
        arrays = {str(name): variable.values for name, variable in dataset.items()}
        writer = Writer(NOTHING)
        for number, (place, value) in enumerate(changes.items()):
            holder, key, node = tree, "", tree
            for name in place.split("."):
                inside = isinstance(node, list) or name in node
                holder = node if inside else node.get("fields") or node["tuple"]
                key = int(name) if isinstance(holder, list) else name
                node = holder[key]
            stored = isinstance(node, dict) and "array" in node
            old = Reader(NOTHING, arrays).value(node, "") if stored else node
            new = value(old) if callable(value) else value
            part = writer.part(new, f"changed{number}") if isinstance(new, np.ndarray) else new
            holder[key] = part
        for name, array in writer.arrays.items():
            dataset[name] = [f"{name}_{axis}" for axis in range(array.ndim)], array

    return change


def refusal(path):
    line = refused(lambda: vm.load(path), error=FileError)
    assert line.startswith(f"{path}: ")
    return line


@contextmanager
def nothing_runs():
    """Nothing is compiled or run in this block; whether something should have been."""
    names = ("codegen.kernels.MachineCode", "codegen.loops.MachineCode")
    with ExitStack() as stack:
        mocks = [
            stack.enter_context(mock.patch(f"vehiclemor.{name}"))
            for name in (*names, "reduction.model_file.response")
        ]
        yield lambda: any(used.called for used in mocks)


def refused_untouched(path):
    """Why a file is refused of which nothing is compiled, run or left in its folder."""
    before = [*path.parent.iterdir()]
    with chdir(path.parent), nothing_runs() as used:
        line = refusal(path)
    assert not used()
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


def parted(value):
    """A value, written and read again; arrays as they were written."""
    writer = Writer(NOTHING)
    written = json.loads(json.dumps(writer.part(value, "value")))
    return Reader(NOTHING, writer.arrays).value(written, "value"), writer.arrays


def test_parts_are_what_they_were(monkeypatch):
    # As of a plug-in that is in use.
    monkeypatch.setattr(parts, "_plug_ins", lambda: {"tests"})
    table = np.arange(6.0).reshape(2, 3)
    whole = table.astype(int), table > 2.0, table + 1j * table
    arrays = (table, table.T, *whole, np.zeros((0, 3)), np.array([np.nan, -np.inf]), np.array(2.0))
    values = 1, -0.0, np.inf, True, None, "text", np.float64(0.1), [Pair(1, (2, [3.0]))], {"b": ()}
    (made, others), _ = parted((arrays, values))
    for before, after in zip(arrays, made, strict=True):
        assert (after.dtype, after.shape) == (before.dtype, before.shape)
        np.testing.assert_array_equal(after, before)
    assert others == values
    assert math.copysign(1.0, others[1]) == -1.0
    assert isinstance(others[-2][0], Pair)
    # Rows or columns stand together as they did: products are rounded by it.
    assert made[1].flags.f_contiguous
    assert len(parted((table, table))[1]) == 1


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
    *((KERNELS, "offline"), ([1.0, KERNELS], "offline.1"), ({2: 3.0}, "offline")),
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
VECTOR = {"array": "reduced.error_scale", "type": "float64", "shape": [6], "turned": False}
SHAPES = ([-1], [5, -1], [True, 6], [2, 3], [1, 6], [10**9], [6.0], 6, None, "6")
# Types are checked whatever else a part says of itself.
HIDDEN = {"model": "none", "class": f"{ROOM}.interface:OfflineCost", "fields": {"seconds": "long"}}
NAN = {"tuple": [{"tuple": [{"tuple": [math.nan]}, {"tuple": [1]}]}]}
KERNEL = {"kernels": "def derivative(x, result): result[9] = x[9]"}
# Of the bicycle: place -> what is no part that may stand there.
PARTS = [
    *(("input_range", wrong) for wrong in (None, {"tuple": [1.0]}, {"same": "reduced.offline"})),
    *(("class", f"{ROOM}.vehicle.features:monomials"), ("fields", {}), ("offline", HIDDEN)),
    *(("offline", {"function": f"{ROOM}.trust:trust_of"}), ("offline", {"code": HARM})),
    *(("offline", KERNEL), ("offline", {"method": "encoded", "of": {"same": "reduced"}})),
    *(("offline", {"same": same}) for same in ("reduced.nothing", [], "reduced.shape")),
    *(("offline", {"model": name}) for name in ("parameters", "kernels")),
    *(("offline.fields", {"minutes": 0.0}), ("features", {"same": "reduced.shape"})),
    *(("features.terms.tuple", ["z0", 3]), ("features.groups", NAN)),
    *(("coefficients", 3.0), ("coefficients", VECTOR | {"array": "reduced.nothing"})),
    ("solver", VECTOR),
    ("model", {"class": "vehiclemor.simulation.dynamic:DynamicModel", "fields": {}}),
    *(("error_scale", VECTOR | {"shape": shape}) for shape in SHAPES),
    *(("error_scale", VECTOR | {"type": kind}) for kind in ("int64", "object")),
    *(("error_scale", VECTOR | {"array": name}) for name in ("parts", ["reduced.error_scale"])),
]


@pytest.mark.parametrize(("place", "value"), PARTS)
def test_parts_that_would_do_harm_are_refused(saved, place, value):
    whole = place if place == "input_range" else f"reduced.{place}"
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


def arrays_instead(array):
    """Arrays of other sizes and types, and of other numbers where these are whole."""
    for axis in range(array.ndim):
        yield array.swapaxes(0, axis)[:-1].swapaxes(0, axis)
    yield from (array[:0], array[None], np.concatenate([array, array]))
    if array.dtype.kind == "i":
        yield from (-1 - array, array + 10**6, array.astype(float))
    else:
        yield array.real.astype(int)


def values_instead(value):
    """What may stand in a text in the place of a value."""
    match value:
        case bool():
            return None, 1.0
        case int():
            return None, True, -1 - value, value + 1, value + 10**6, str(value)
        case float():
            return None, True, str(value)
        case str():
            return None, 1, f"{value}x"
        case list():
            return None, value[:-1], [], value + value
        case dict():
            return None, dict([*value.items()][1:])
    return 1, "text"


def mutations(node, arrays, place):
    """Changes of every part of a model, each of one place; of lists the first entry alone."""
    if isinstance(node, dict) and "array" in node:
        array = Reader(NOTHING, arrays).value(node, "")
        for other in arrays_instead(array):
            if other.dtype != array.dtype or not np.array_equal(other, array):
                yield {place: other}
        return
    for value in values_instead(node):
        yield {place: value}
    children = enumerate(node[:1]) if isinstance(node, list) else ()
    for key, part in node.items() if isinstance(node, dict) else children:
        yield from mutations(part, arrays, f"{place}.{key}")


# A basis may have fewer vectors.
SMALLER = "reduced.fields.bases.tuple.0.fields.vectors"


@pytest.mark.parametrize("name", ["bicycle", "car", "map", "pod", "windows", "replay"])
def test_any_other_part_is_refused_in_a_line_or_changes_nothing(name, contents, tmp_path):
    """Arrays that don't fit are refused before code is compiled or run."""
    (path := tmp_path / "model.nc").write_bytes(contents[name])
    dataset, expected = content(path), vm.load(path).simulate().outputs
    arrays = {str(name): variable.values for name, variable in dataset.items()}
    tree = json.loads(dataset["parts"].item())
    for change in (c for root in tree for c in mutations(tree[root], arrays, root)):
        written(path, dataset, replaced(change))
        ((place, value),) = change.items()
        with nothing_runs() as used, suppress(FileError):
            vm.load(path)
        if not used():
            continue
        exact = isinstance(value, np.ndarray) and place != SMALLER
        if exact:
            np.testing.assert_array_equal(vm.load(path).simulate().outputs, expected, str(change))
        else:
            with suppress(FileError):
                vm.load(path)


def nan(array):
    return np.nan * array


# File, word of the check that sees it, places that are changed together.
TOGETHER = [
    ("bicycle", "modes", {f"transient.{n}": np.ones((22, 21)) for n in ("left", "right")}),
    ("car", "transient", {f"transient.{n}": lambda a: a[:, :-1] for n in ("left", "right")}),
    ("car", "lasted", {f"reach.{n}": lambda a: a[:-1] for n in ("decaying", "steered")}),
    ("car", "lasted", {"reach.left": lambda a: a[:-1], "reach.starts": lambda a: a[:, :-1]}),
    ("map", "ranges", {"ranges": nan}),
    *(("map", "cells", {f"cells.{n}": nan}) for n in ("centres", "scales")),
    ("map", "cells", {f"cells.{n}": lambda a: a[:1] for n in ("centres", "scales", "numbers")}),
    ("map", "degree", {"moving.tuple": [], "cells.coefficients": lambda a: a[:, :1]}),
    ("pod", "formulation", {"spaces.formulation": "full"}),
    ("pod", "spaces", {f"spaces.{n}": lambda a: a[..., :-1] for n in ("means", "trial_basis")}),
    ("windows", "bases", {f"bases.1.{n}": lambda a: a[:-1] for n in ("mean", "vectors")}),
    ("windows", "rank", {"bases.0.vectors": lambda a: np.ones((len(a), len(a) + 1))}),
]
TOGETHER[0][2]["transient.rates"] = np.ones(22)


@pytest.mark.parametrize(("file", "word", "change"), TOGETHER)
def test_parts_that_dont_fit_one_another_are_refused(file, word, change, contents, tmp_path):
    (path := tmp_path / "model.nc").write_bytes(contents[file])
    changes = {f"reduced.{place}": value for place, value in change.items()}
    assert word in refused_untouched(rewritten(path, replaced(changes)))


def with_row(number, *values):
    """Operations of which one has other arguments."""
    return {"arguments": lambda a: np.vstack([a[:number], [values], a[number:][1:]])}


def repeated(kind):
    """Only operations of one kind, on the first one, so many that they take long to compile."""
    more, number = MOST_SIZE // 150, [*KINDS].index(kind)
    return {
        "kinds": lambda a: np.append(a, np.full(more, number)),
        "arguments": lambda a: np.vstack([a, np.zeros((more, 3), dtype=int)]),
        "numbers": lambda a: np.append(a, np.zeros(more)),
    }


# Operations 0, 1 and 2 of the bicycle are reduced coordinates, the last one multiplies.
OPERATIONS = [
    {"kinds": lambda a: a + 99},
    # What they were not given, and what is not there yet.
    *(with_row(0, *entry) for entry in ((0, 9, 0), (1, 9, 0), (2, 99999, 0), (3, 0, 0))),
    with_row(-1, 0, 9999, 0),
    # A comparison for a number, and a number for a comparison.
    {"kinds": lambda a: np.where(a == 2, [*KINDS].index("<"), a)},
    {"kinds": lambda a: np.append(a[:-1], len(KINDS) - 1)},
    # More than compiles soon.
    *map(repeated, ("sqrt", "atan2", "power")),
]


@pytest.mark.parametrize("change", OPERATIONS, ids=range(len(OPERATIONS)))
def test_operations_that_are_more_than_arithmetic_of_what_is_given_are_refused(change, saved):
    inner = "reduced.features.operations.operations"
    changes = {f"{inner}.{name}": value for name, value in change.items()}
    refused_untouched(rewritten(saved, replaced(changes)))


def test_what_is_huge_where_it_is_written_small_is_refused_soon(saved):
    # Never written: it takes no space in the file.
    with netCDF4.Dataset(saved, "r+") as file:
        for axis in "ab":
            file.createDimension(axis, 10**9)
        file.createVariable("huge", "f8", ("a", "b"), chunksizes=(1000, 1000))
    content = saved.read_bytes()
    saved.write_bytes(content + netcdf_file.SEAL + netcdf_file._digest(content))
    assert "its variables have more than" in refused_untouched(saved)


def test_parts_that_stand_for_ever_more_are_refused_soon(saved):
    twice = [{"tuple": [{"same": f"reduced.offline.{number}"}] * 2} for number in range(60)]
    many = replaced({"reduced.offline": {"tuple": [{"tuple": [1.0, 2.0]}, *twice]}})
    assert "too many parts" in refused_untouched(rewritten(saved, many))
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
