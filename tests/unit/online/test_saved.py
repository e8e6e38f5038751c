"""Saved models: files that are refused, files that would do harm, and the ones that ship."""

import dataclasses
import json
import math
import subprocess
import sys
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple
from unittest import mock

import netCDF4
import numpy as np
import pytest
import reduced_models
import xarray as xr

import vehiclemor as vm
from vehiclemor.errors import FileError, InputError
from vehiclemor.online import model_file, parts
from vehiclemor.online.parts import Reader, Writer
from vehiclemor.online.rom import ReducedOrderModel
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.resources import data_names
from vehiclemor.simulation.build import build
from vehiclemor.study import netcdf_file
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


def refused_untouched(path: Path) -> str:
    """Why a file is refused of which nothing has been compiled or run."""
    with ExitStack() as stack:
        for compiled in ("kernels", "loops"):
            place = f"vehiclemor.codegen.{compiled}.fetched"
            stack.enter_context(mock.patch(place, side_effect=AssertionError("compiled")))
        ran = AssertionError("ran")
        stack.enter_context(mock.patch.object(model_file, "response", side_effect=ran))
        return refusal(path)


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
# What no array of a file is.
ARRAYS = [
    {"array": "reduced.error_scale", "type": "float64", "shape": shape, "turned": False}
    for shape in ([-1], [5, -1], [True, 6], [2, 3], [1, 6], [10**9], [6.0], 6, None, "6")
] + [
    {"array": name, "type": kind, "shape": [6], "turned": False}
    for name, kind in (
        ("reduced.parameters", "float64"),
        ("reduced.error_scale", "int64"),
        ("reduced.error_scale", "object"),
        ("parts", "float64"),
        (["reduced.error_scale"], "float64"),
    )
]


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
        (f"{FEATURES}.terms.tuple", ["z0", "z1"]),
        (f"{FEATURES}.states", 10**9),
        (f"{FEATURES}.states", True),
        (f"{FEATURES}.lateral", -1),
        (f"{FEATURES}.groups", {"tuple": [{"tuple": [{"tuple": [0, 0]}, {"tuple": [1]}]}]}),
        (f"{FEATURES}.groups", {"tuple": [{"tuple": [{"tuple": [-1]}, {"tuple": [1]}]}]}),
        (f"{FEATURES}.groups", {"tuple": [{"tuple": [{"tuple": [math.nan]}, {"tuple": [1]}]}]}),
        ("reduced.fields.offline", {"same": "reduced.shape"}),
        ("reduced.fields.offline", {"same": []}),
        ("reduced.fields.offline", {"model": "parameters"}),
        ("reduced.fields.features", {"same": "reduced.shape"}),
        ("reduced.fields.coefficients", 3.0),
        ("reduced.fields.solver", {"array": "reduced.parameters"}),
        ("reduced.fields.tolerance", "1e-3"),
        ("reduced.fields.tolerance", True),
        ("reduced.fields.model", {"class": "vehiclemor.simulation.dynamic:DynamicModel"}),
        ("known.fields.longest", None),
        *(("reduced.fields.error_scale", array) for array in ARRAYS),
    ],
)
def test_parts_that_would_do_harm_are_refused(saved, place, value, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    refused_untouched(rewritten(saved, replaced(place, value)))
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
        "vehiclemor.simulation.dynamic:DynamicModel",
        "vehiclemor.simulation.integrators.structures:Equations",
        "vehiclemor.simulation.build:build",
        "vehiclemor.reduction.vehicle.features:monomials",
        "vehiclemor.reduction.vehicle.features:Features.blocks",
        "vehiclemor.reduction.vehicle.features:PLANAR",
        # Defined elsewhere.
        "vehiclemor.reduction.vehicle.shape:dataclass",
    ],
)
def test_names_of_other_things_are_refused(name):
    with pytest.raises(ValueError, match="there is no"):
        parts.named(name)


# Bodies of a kernel `derivative` with 28 states, 1 input and 102 constants that no kernel has.
BODIES = {
    "write beyond": "_result[99999] = _x[0]",
    "write one beyond": "_result[28] = _x[0]",
    "read beyond": "_result[0] = _x[99999]",
    "read an input beyond": "_result[0] = _u[1]",
    "read a constant beyond": "_result[0] = _constants[99999]",
    "sums beyond": "a, b = weighted_sums(_constants, 0, ("
    + "_x[0], " * 9999
    + "))\n_result[0] = a",
    "sums from beyond": "a, b = weighted_sums(_constants, 10**9, (_x[0], ))",
    "sums from afar": f"a, b = weighted_sums(_constants, {10**30}, (_x[0],))",
    "sums from before": "a, b = weighted_sums(_constants, -8, (_x[0],))",
    "sums of the result": "a, b = weighted_sums(_result, 0, (_x[0],))",
    "sums of scratch": "a, b = weighted_sums(_work, 0, (_x[0],))",
    "sums of nothing": "a, b = weighted_sums(_constants, 0, ())",
    "sums into results": "(_result[0], b) = weighted_sums(_constants, 0, (_x[0],))",
    "sums into a star": "(*a, b) = weighted_sums(_constants, 0, (_x[0],))",
    "sums with a keyword": "a, b = weighted_sums(_constants, 0, terms=(_x[0],))",
    "sums of a star": "a, b = weighted_sums(_constants, 0, (*_x,))",
    "combine": "combine(_result[0], 99999, 1.0, _x[0])",
    "magnitudes": "magnitudes(_result[0], 99999, _x[0], _x[0])",
    "product": "product(_result[0], 8, _constants[0], _x[0], (99999,), (), 1.0)",
    "execute": "execute(_x[0], _x[0], _u[0], _constants[0], _result[0])",
    "execute in parentheses": "(execute)(_x[0], _x[0], _u[0], _constants[0], _result[0])",
    "execute in more": "((execute))(_x[0], _x[0], _u[0], _constants[0], _result[0])",
    "full-width execute": "\uff45xecute(_x[0], _x[0], _u[0], _constants[0], _result[0])",
    "mathematical execute": "\U0001d41execute(_x[0], _x[0], _u[0], _constants[0], _result[0])",
    "execute on two lines": "execute\\\n(_x[0], _x[0], _u[0], _constants[0], _result[0])",
    "execute behind a comment": "(execute # (\n)(_x[0], _x[0], _u[0], _constants[0], _result[0])",
    "full-width array": "_result[0] = _\uff58[99999]",
    "assigned execute": "a = execute(_x[0], _x[0], _u[0], _constants[0], _result[0])",
    "index that is none": "_result[_x[0]] = 1.0",
    "index that is a name": "i = 1.0\n_result[i] = 1.0",
    "negative index": "_result[0] = _x[-1]",
    "negative place": "_result[-1] = _x[0]",
    "truth value": "_result[True] = _x[0]",
    "truth value read": "_result[0] = _x[True]",
    "huge index": f"_result[0] = _x[{2**64}]",
    "index of three": "_result[0, 0, 0] = _x[0]",
    "slice": "_result[0:9] = _x[0]",
    "two shapes": "_result[0] = _x[0]\n_result[0, 1] = _x[0]",
    "read results": "_result[0] = _result[1]",
    "unknown name": "_result[0] = a",
    "name before it is known": "_result[0] = a\na = _x[0]",
    "unknown scratch": "_result[0] = _work[0]",
    "batch of unknown scratch": "_work[0] = _x[0]\nsincos_batch(_work, 0)",
    "batch of an array": "sincos_batch(_x, 0)",
    "batch from before": "sincos_batch(_work, -8)",
    "unknown batch": "system_batch(_work, 0)",
    "name of an array": "_constants = _x[0]",
    "attribute": "_result[0] = _x[0].real",
    "import": "import os",
    "import in a line": f"_result[0] = {HARM}",
    "unknown function": "_result[0] = math.system(_x[0])",
    "too many arguments": "_result[0] = math.sin(_x[0], _x[0])",
    "keyword": "_result[0] = math.sin(x=_x[0])",
    "lambda": "_result[0] = (lambda: 1.0)()",
    "f-string": "_result[0] = f'{_x[0]}'",
    "text": "_result[0] = 'a'",
    "walrus": "_result[0] = (a := _x[0])",
    "star": "_result[0] = (*_x,)",
    "comprehension": "_result[0] = sum(x for x in _x)",
    "comparison": "_result[0] = _x[0] < _x[1]",
    "chained comparison": "_result[0] = 1.0 if 0.0 < _x[0] < 1.0 else 0.0",
    "whole number": "_result[0] = 1",
    "complex number": "_result[0] = 1j",
    "remainder": "_result[0] = _x[0] % 2.0",
    "two targets": "_result[0] = _result[1] = _x[0]",
    "augmented": "_result[0] += _x[0]",
    "annotated": "a: float = _x[0]",
    "nested function": "def inner():\n    return 1.0",
    "loop": "for a in _x: pass",
    "delete": "del _x",
    "return": "return 1.0",
    "semicolon": "a = _x[0]; execute(_x[0], _x[0], _u[0], _constants[0], _result[0])",
    "signs": f"_result[0] = {'-' * 60_000}_x[0]",
    "parentheses": f"_result[0] = {'(' * 150}_x[0]{')' * 151}",
    "deep sum": f"_result[0] = {'1.0 + ' * 30_000}_x[0]",
    "deep": f"_result[0] = {'(1.0 + ' * 190}_x[0]{')' * 190}",
    "long": "a = _x[0]\n" + "a = a + 1.0\n" * 40_000,
    "many functions": "a = _x[0]\n" + "a = math.sin(a)\n" * 5_000,
    "wide sums": f"{'a, ' * 999}= weighted_sums(_constants, 0, ({'_x[0], ' * 999}))",
    "null": "a = _x[0]\0",
}
HEADS = (
    "def derivative(_x, _u, _constants, _result, _more):",
    "def derivative(_x, _constants, _u, _result):",
    "def derivative(_x, _u, _result):",
    "def derivative(_x, _u, _constants, *_result):",
    "def derivative(_x, _u, _constants, *, _result):",
    "def derivative(_x, _u, _constants, _result, /):",
    "def derivative(_x, _u, _constants, _result=print('harm')):",
    "def derivative(_x, _u, _constants, _result: print('harm')):",
    "def derivative(_x, _u, _constants, _result) -> print('harm'):",
    "@print\ndef derivative(_x, _u, _constants, _result):",
    "async def derivative(_x, _u, _constants, _result):",
    "class derivative:",
    "def tan(_x, _u, _constants, _result):",
    "def etdrk4_step(_x, _u, _constants, _work, _result):",
    "import os\ndef derivative(_x, _u, _constants, _result):",
)
# Kernel -> what is one too many of its results.
OTHERS = {"speeds": 14, "second_order": 14 * 15, "outputs": 33}


def with_body(body: str, head: str = "def derivative(_x, _u, _constants, _work, _result):") -> str:
    return "\n    ".join([head, *body.splitlines()]) + "\n"


@pytest.fixture(scope="module")
def own_system(tmp_path_factory) -> bytes:
    """A file whose kernels are a text."""
    made = vm.reduce(CAR, "pod", training="nominal", formulation="state")
    system = dataclasses.replace(
        made.reduced.system, constants=made.reduced.system.constants.copy()
    )
    reduced = dataclasses.replace(made.reduced, system=system)
    made = dataclasses.replace(made, reduced=reduced)
    path = made.save(tmp_path_factory.mktemp("system") / "model.nc")
    text = "\n".join(source.text for source in made.reduced.system.kernels.sources.values())
    return with_kernels(path, text).read_bytes()


def with_kernels(path: Path, text: str) -> Path:
    return rewritten(path, replaced("reduced.fields.system.fields.kernels", {"kernels": text}))


def test_kernels_that_are_a_text_are_loaded(own_system, tmp_path):
    (path := tmp_path / "model.nc").write_bytes(own_system)
    assert vm.load(path).simulate().status == "ok"


@pytest.mark.parametrize(
    "text",
    [
        *(pytest.param(with_body(body), id=name) for name, body in BODIES.items()),
        *(pytest.param(with_body("pass", head), id=head) for head in HEADS),
        *(
            with_body(f"_result[{place}] = _x[0]").replace("derivative", name)
            for name, place in {**OTHERS, "unheard_of": 0}.items()
        ),
        pytest.param(with_body("pass") + with_body("_u[9] = 1.0"), id="the second of two"),
        pytest.param("", id="nothing"),
        pytest.param(3, id="a number"),
    ],
)
def test_kernels_that_are_more_than_arithmetic_of_their_arrays_are_refused(
    text, own_system, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    (path := tmp_path / "model.nc").write_bytes(own_system)
    refused_untouched(with_kernels(path, text))
    assert not Path("harm").exists()


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("reference", np.zeros(27)),
        ("reference", np.zeros((28, 1))),
        ("constants", np.zeros(101)),
        ("error_scale", np.ones(1)),
        ("active", np.array([28])),
        ("active", np.array([-1])),
        ("active", np.zeros(28, dtype=int)),
        ("active", np.zeros(1)),
        ("rotating", np.array([5, 0])),
        ("partners", np.zeros(28, dtype=int)),
        ("directions", np.zeros((1, 102))),
    ],
)
def test_arrays_of_a_system_that_dont_fit_it_are_refused(field, value, own_system, tmp_path):
    (path := tmp_path / "model.nc").write_bytes(own_system)
    place = f"reduced.system.{field}"

    def change(dataset: xr.Dataset, found: dict[str, Any]) -> None:
        dataset[place] = [f"{place}_{axis}_" for axis in range(value.ndim)], value
        written = {"array": place, "type": value.dtype.name, "shape": list(value.shape)}
        replaced(f"reduced.fields.system.fields.{field}", written | {"turned": False})(None, found)

    refused_untouched(rewritten(path, change))


def test_what_is_huge_where_it_is_written_small_is_refused_soon(saved):
    # Never written: it takes no space in the file.
    with netCDF4.Dataset(saved, "r+") as file:
        for axis in "ab":
            file.createDimension(axis, 10**9)
        file.createVariable("huge", "f8", ("a", "b"), chunksizes=(1000, 1000))
    netcdf_file._seal(saved)
    assert "its variables have more than" in refused_untouched(saved)


def test_parts_that_stand_for_ever_more_are_refused_soon(saved):
    def change(_: object, found: dict[str, Any]) -> None:
        twice = ({"tuple": [{"same": f"reduced.offline.{number}"}] * 2} for number in range(60))
        found["reduced"]["fields"]["offline"] = {"tuple": [{"tuple": [1.0, 2.0]}, *twice]}

    assert "too many parts" in refused_untouched(rewritten(saved, change))
    deep = replaced("reduced.fields.offline", json.loads("[" * 900 + "]" * 900))
    refused_untouched(rewritten(saved, deep))


@pytest.mark.parametrize("text", ["[" * 100_000, "1" * 5_000, "[" + "0," * 2_000_001 + "0]"])
def test_texts_that_are_deep_or_long_are_refused_soon(text, saved):
    with xr.open_dataset(saved, decode_cf=False) as file:
        dataset = file.load()
    dataset["parts"] = ((), text)
    saved.unlink()
    write_dataset(dataset, saved)
    refused_untouched(saved)


# Texts of one feature.
TEXTS = {
    "call": HARM,
    "array": "_x[99999]",
    "parameter beyond": "p[99999]",
    "negative parameter": "p[-1]",
    "truth value": "p[True]",
    "parameter of parameters": "p[p[0]]",
    "slice": "p[0:1]",
    "unknown": "z9",
    "unknown input": "u9",
    "kernel's own name": "y0",
    "own name": "term",
    "line behind": "z0\n    _result[99999] = z0",
    "line behind a semicolon": "z0; _result[0] = z0",
    "comment": "z0 # )",
    "continued": "z0 \\\n + z0",
    "two": "z0, z1",
    "end of the sum": "z0,)) or ((z0",
    "walrus": "(z0 := 1.0)",
    "star": "*z0",
    "lambda": "lambda: z0",
    "f-string": "f'{z0}'",
    "attribute": "z0.real",
    "comparison": "z0 < z1",
    "full-width": "\uff5a0",
    "execute": "execute(p[0], p[0], p[0], p[0])",
    "signs": "-" * 60_000 + "u0",
    "long": "z0 + " * 20_000 + "z0",
    "nothing": "",
    "number": 3,
}


FEATURES = "reduced.fields.features.fields"


@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS)
def test_features_that_are_more_than_arithmetic_of_their_numbers_are_refused(text, saved):
    where = replaced(f"{FEATURES}.terms", {"tuple": [text, *["z0"] * 7]})
    refused_untouched(rewritten(saved, where))


@pytest.mark.parametrize(
    ("place", "entry"),
    [
        ("lines", ["a", "z9"]),
        ("lines", ["a", "execute(p[0], p[0], p[0], p[0])"]),
        ("lines", ["_result[9]", "z0"]),
        ("lines", ["a = 1.0\n    _x", "z0"]),
        ("lines", ["_x", "z0"]),
        ("lines", ["p", "z0"]),
        ("lines", ["if", "z0"]),
        ("lines", ["\uff41", "z0"]),
        ("lines", ["a.b", "z0"]),
        ("lines", ["", "z0"]),
        ("lines", ["a", "a"]),
        ("lines", ["a", "z0", "z0"]),
        ("watched", ["p[99999]", "speed"]),
        ("watched", ["y0", "speed"]),
    ],
)
def test_lines_of_features_are_as_terms_are(place, entry, saved):
    where = replaced(f"{FEATURES}.{place}", {"tuple": [{"tuple": entry}]})
    refused_untouched(rewritten(saved, where))


SHIPPED = data_names("protocols")


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
