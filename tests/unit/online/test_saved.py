"""Saved models: files that are refused, files that would do harm, and the ones that ship."""

import dataclasses
import json
import math
import subprocess
import sys
from collections.abc import Callable
from contextlib import ExitStack, chdir
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple
from unittest import mock

import netCDF4
import numpy as np
import pytest
import reduced_models
import xarray as xr

import vehiclemor as vm
from vehiclemor.codegen.kernels import Kernels, kernel_sources
from vehiclemor.errors import FileError, InputError
from vehiclemor.online import parts
from vehiclemor.online.parts import Reader, Writer
from vehiclemor.online.rom import ReducedOrderModel
from vehiclemor.online.saved import shipped_folder
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.resources import data_names
from vehiclemor.simulation.build import build
from vehiclemor.study import netcdf_file
from vehiclemor.study.netcdf_file import write_dataset
from vehiclemor.study.scenario import start_of

CAR = "independent_suspension_vehicle"
KERNELS = Kernels(kernel_sources("def derivative(_x, _result):\n    _result[0] = _x[0]\n"))
# What refers to no model.
NOTHING: Any = SimpleNamespace()


class Pair(NamedTuple):
    """A part of a model, as methods have them."""

    first: Any
    second: Any


@pytest.fixture(scope="module")
def car() -> ReducedOrderModel:
    """A car whose equations are features in a text."""
    return vm.reduce(CAR, "linear_single_track", training="nominal")


@pytest.fixture
def saved(car: ReducedOrderModel, tmp_path: Path) -> Path:
    return car.save(tmp_path / "car.nc")


@pytest.fixture(scope="module")
def contents(car: ReducedOrderModel, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
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


def replaced(changes: dict[str, Any]) -> Callable[[xr.Dataset, dict[str, Any]], None]:
    """Puts values, or functions of what is there, at places `a.b.c` in the parts of a model."""

    def change(dataset: xr.Dataset, found: dict[str, Any]) -> None:
        for number, (places, value) in enumerate(changes.items()):
            node, *path = found, *places.split(".")
            for name in path:
                inside = node if name in node else node.get("fields") or node["tuple"]
                key = int(name) if isinstance(inside, list) else name
                holder, node = inside, inside[key]
            if callable(value):
                old, writer = node, Writer(NOTHING)
                if "array" in node:
                    arrays = {node["array"]: dataset[node["array"]].values}
                    old = Reader(NOTHING, arrays).value(node, "")
                holder[key] = new = value(old)
                if "array" in node:
                    holder[key] = writer.part(new, f"changed{number}")
                for place, array in writer.arrays.items():
                    dataset[place] = [f"{place}_{axis}" for axis in range(array.ndim)], array
            else:
                holder[key] = value

    return change


def refusal(path: Path) -> str:
    with pytest.raises(FileError) as caught:
        vm.load(path)
    line = str(caught.value)
    assert line.startswith(f"{path}: ")
    assert "\n" not in line
    return line


def refused_untouched(path: Path) -> str:
    """Why a file is refused of which nothing is compiled, run or left in its folder."""
    before = [*path.parent.iterdir()]
    places = "codegen.kernels.fetched", "codegen.loops.fetched", "online.model_file.response"
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


@pytest.mark.parametrize(
    ("wrong", "what"),
    [
        (lambda state: state, "offline"),
        (build(CAR).start, "offline"),
        (Pair(1.0, 2.0), "offline"),
        ([1.0, {2: 3.0}], "offline.1"),
        (np.array(["text"]), "offline"),
        (np.zeros(3, dtype=np.float32), "offline"),
        (KERNELS, "offline"),
        ([KERNELS], "offline.0"),
        (dataclasses.replace(build(CAR).system, inputs=1), "offline"),
    ],
)
def test_what_cant_be_written_is_named_and_leaves_no_file(wrong, what, car, tmp_path):
    other = dataclasses.replace(car, reduced=dataclasses.replace(car.reduced, offline=wrong))
    with pytest.raises(InputError) as error:
        other.save(tmp_path / "car.nc")
    start = f"linear_single_track of {CAR}: it can't be saved: reduced.{what} is "
    assert str(error.value).startswith(start)
    assert "\n" not in str(error.value)
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


def other(name: str, text: Any) -> Callable[[xr.Dataset, Any], None]:
    """Puts another text into a file."""
    return lambda dataset, _: dataset.update({name: ((), json.dumps(text))})


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (other("parameters", {"no_such_mass": 3.0}), "'no_such_mass' is not a parameter"),
        (other("parameters", {"sprung_mass": -3.0}), "sprung_mass"),
        (other("settings", {"no_such_setting": 3.0}), "unknown setting"),
        (other("settings", {"tolerance": "wide"}), "tolerance"),
        (other("training", 3), "TypeError"),
        (lambda dataset, _: dataset.update({"fingerprint": 1.01 * dataset.fingerprint}), "changed"),
        (lambda dataset, _: dataset.attrs.update(saved_model=99), "format 99 where"),
    ],
)
def test_what_doesnt_fit_is_refused(saved, change, why):
    assert why in refusal(rewritten(saved, change))


HARM = "__import__('pathlib').Path('harm').touch()"
ROOM = "vehiclemor.reduction"
VECTOR = {"array": "reduced.error_scale", "type": "float64", "shape": [6], "turned": False}
SHAPES = ([-1], [5, -1], [True, 6], [2, 3], [1, 6], [10**9], [6.0], 6, None, "6")
# A class that is none, its check left out.
HIDDEN = {"model": "none", "class": f"{ROOM}.interface:Offline", "fields": {"seconds": "long"}}
# Of the bicycle: place -> what is no part that may stand there.
PARTS = [
    ("class", f"{ROOM}.vehicle.features:monomials"),
    ("offline", {"function": f"{ROOM}.trust:trust_of"}),
    ("offline", {"code": HARM}),
    ("offline", {"kernels": "def derivative(_x, _result):\n    _result[9] = _x[9]\n"}),
    ("offline", {"method": "encoded", "of": {"same": "reduced"}}),
    ("offline", {"same": "reduced.nothing"}),
    ("offline", {"same": []}),
    ("offline", {"same": "reduced.shape"}),
    ("offline", {"model": "parameters"}),
    ("offline", {"model": "kernels"}),
    ("offline", HIDDEN),
    ("offline.fields", {"minutes": 0.0}),
    ("fields", {}),
    ("features", {"same": "reduced.shape"}),
    ("features.states", True),
    ("features.terms.tuple", ["z0", "z1", 3]),
    ("features.groups", {"tuple": [{"tuple": [{"tuple": [math.nan]}, {"tuple": [1]}]}]}),
    ("coefficients", 3.0),
    ("coefficients", VECTOR | {"array": "reduced.nothing"}),
    ("solver", VECTOR),
    ("tolerance", "1e-3"),
    ("tolerance", True),
    ("model", {"class": "vehiclemor.simulation.dynamic:DynamicModel", "fields": {}}),
    *(("error_scale", VECTOR | {"shape": shape}) for shape in SHAPES),
    *(("error_scale", VECTOR | {"type": kind}) for kind in ("int64", "object")),
    *(("error_scale", VECTOR | {"array": name}) for name in ("parts", ["reduced.error_scale"])),
]


@pytest.mark.parametrize(("place", "value"), PARTS)
def test_parts_that_would_do_harm_are_refused(saved, place, value):
    refused_untouched(rewritten(saved, replaced({f"reduced.{place}": value})))


@pytest.mark.parametrize("known", [None, {"tuple": [1.0]}, {"same": "reduced.offline"}])
def test_a_range_of_inputs_is_one(saved, known):
    refused_untouched(rewritten(saved, replaced({"known": known})))
    refused_untouched(rewritten(saved, replaced({"reduced": known})))


@pytest.mark.parametrize(
    "name",
    [
        "os:system",
        "builtins:eval",
        "vehiclemor.files:write_text",
        f"{ROOM}.no_such_room:thing",
        "vehiclemor.simulation.dynamic:DynamicModel",
        "vehiclemor.simulation.integrators.structures:Equations",
        "vehiclemor.simulation.system:System",
        "vehiclemor.simulation.build:build",
        f"{ROOM}.reduced_system:KinematicStates",
        f"{ROOM}.vehicle.features:monomials",
        f"{ROOM}.vehicle.features:Features.blocks",
        f"{ROOM}.vehicle.features:PLANAR",
        # Defined elsewhere.
        f"{ROOM}.vehicle.reduced_vehicle:Features",
    ],
)
def test_names_of_other_things_are_refused(name):
    with pytest.raises(ValueError, match="there is no"):
        parts.named(name)


def short(a: np.ndarray) -> np.ndarray:
    """Without its last row."""
    return a[:-1]


def thin(a: np.ndarray) -> np.ndarray:
    """Without its last column."""
    return a[..., :-1]


def whole(a: np.ndarray) -> np.ndarray:
    return a.astype(int)


def first(a: np.ndarray) -> np.ndarray:
    return a[:1]


def none(a: np.ndarray) -> np.ndarray:
    return a[:0]


def unknown(a: np.ndarray) -> np.ndarray:
    return np.nan * a


def grouped(*groups: tuple[list[int], list[int]]) -> dict[str, Any]:
    return {"tuple": [{"tuple": [{"tuple": part} for part in group]} for group in groups]}


BOXED = ("centres", "scales", "halves", "tops", "numbers")
MODES = {f"transient.{name}": lambda a: np.ones((22, *a.shape[1:])) for name in ("left", "right")}
# File -> what in its sizes would reach beyond others, and the word of the check that sees it.
SIZES: dict[str, list[tuple[dict[str, Any], str]]] = {
    "bicycle": [
        ({"features.states": 0}, "states"),
        ({"features.states": 101}, "states"),
        ({"features.inputs": -1}, "states"),
        ({"features.inputs": 101}, "states"),
        ({"features.inputs": 2}, "features"),
        ({"features.lateral": 1}, "lateral"),
        ({"features.lateral": -1}, "lateral"),
        ({"features.groups": grouped(*[([0], [0])] * 7)}, "groups"),
        ({"features.groups": grouped(([0, 0], [1]))}, "groups"),
        ({"features.groups": grouped(([-1], [1]))}, "groups"),
        ({"features.groups": grouped(([8], [1]))}, "groups"),
        ({"features.groups": grouped(([0], [1, 1]))}, "groups"),
        ({"features.groups": grouped(([0], [6]))}, "groups"),
        ({"features.groups": grouped(([], [1]))}, "groups"),
        ({"features.groups": grouped(([0], []))}, "groups"),
        ({"parameters": short}, "parameters"),
        ({"parameters": whole}, "parameters"),
        ({"parameters": lambda a: a[None]}, "parameters"),
        ({"transient.rates": lambda _: np.ones(22), **MODES}, "transient"),
    ],
    "car": [
        ({"features.lateral": 4}, "lateral"),
        ({"lifted_features.states": 8}, ""),
        ({"lifted_features.inputs": 2}, "features"),
        *(({name: short}, name) for name in ("coefficients", "lifting", "error_scale")),
        *(({name: thin}, name) for name in ("coefficients", "lifting", "encoding")),
        ({"coefficients": whole}, "coefficients"),
        ({"feedthrough": short}, "encoding"),
        *(({f"transient.{name}": short}, "transient") for name in ("rates", "left", "right")),
        ({"transient.left": thin, "transient.right": thin}, "transient"),
        *(({f"reach.{name}": thin}, "") for name in ("lasted", "starts", "left")),
        *(({f"reach.{name}": short}, "") for name in ("decaying", "steered", "begun")),
        ({"reach.lasted": lambda a: a[:-2]}, "lasted"),
        ({"reach.decaying": short, "reach.steered": short}, "lasted"),
        ({"reach.left": thin, "reach.starts": thin}, "lasted"),
        ({"reach.inputs": short}, "reach"),
        ({"reach.inputs": whole}, "reach"),
        ({"reach.inputs": lambda a: np.hstack([a, a])}, "reach"),
    ],
    "guarded": [
        ({"fast": {"class": f"{ROOM}.interface:Offline", "fields": {}}}, "no simulate"),
        ({"safe": {"same": "reduced.fast.offline"}}, "no simulate"),
    ],
    "map": [
        ({"ranges": short}, "ranges"),
        ({"ranges": unknown}, "ranges"),
        ({"moving.tuple": [0, 2]}, "moving"),
        ({"moving.tuple": [0, -1]}, "moving"),
        ({"moving.tuple": [1, 1]}, "moving"),
        ({"moving.tuple": [], "cells.coefficients": lambda a: a[:, :1]}, "degree"),
        ({"degree": 21}, "degree"),
        ({"degree": -1}, "degree"),
        ({"columns.tuple": short}, "columns"),
        ({"columns.tuple": lambda c: [*c[:-1], -1]}, "columns"),
        ({"columns.tuple": lambda c: [*c[:-1], 14]}, "columns"),
        *(({f"cells.{name}": short}, "cells") for name in BOXED[:4]),
        *(({f"cells.{name}": unknown}, "cells") for name in BOXED[:2]),
        *(({f"cells.{name}": lambda a: a + 1.0}, name) for name in ("halves", "tops")),
        ({"cells.numbers": lambda a: -a}, "numbers"),
        ({"cells.numbers": lambda a: 1.0 * a}, "numbers"),
        ({"cells.coefficients": short}, "cells"),
        ({"cells.coefficients": whole}, "cells"),
        ({"cells.coefficients": lambda a: a[:, :-1]}, "coefficients"),
        ({"cells.coefficients": thin}, "coefficients"),
        (
            {f"cells.{name}": short for name in BOXED} | {"cells.coefficients": lambda a: a[:24]},
            "cells",
        ),
    ],
    "pod": [
        *(({f"spaces.{name}": short}, "spaces") for name in ("edges", "means", "test_basis")),
        *(({f"spaces.{name}": thin}, "spaces") for name in ("means", "test_basis")),
        ({"spaces.trial_basis": lambda a: a[0]}, ""),
        ({f"spaces.{name}": thin for name in ("means", "trial_basis", "test_basis")}, "spaces"),
        ({"spaces.formulation": "other"}, "formulation"),
        (
            {"spaces.edges": first}
            | {f"spaces.{name}": none for name in ("means", "trial_basis", "test_basis", "ranks")},
            "formulation",
        ),
        ({"spaces.formulation": "full"}, "ranks"),
        ({"spaces.ranks": lambda a: a + 99}, "ranks"),
        ({"spaces.ranks": lambda a: -a}, "ranks"),
        ({"spaces.ranks": lambda a: 1.0 * a}, "ranks"),
    ],
    "windows": [
        ({"edges": short}, "edges"),
        ({"bases.0.mean": short}, "basis"),
        ({"bases.0.mean": whole}, "basis"),
        ({"bases.1.mean": short, "bases.1.vectors": short}, "bases"),
        ({"bases.0.vectors": lambda a: np.ones((len(a), len(a) + 1))}, "rank"),
    ],
    "replay": [
        *(({f"recorded.0.{name}": short}, "") for name in ("time", "inputs", "outputs")),
        ({"recorded.0.time": none}, ""),
        ({"recorded.0.coordinates": whole}, "samples"),
        ({"recorded.0.coordinates": lambda a: a[:, 0]}, ""),
        ({"recorded.0.outputs": thin}, "outputs"),
    ],
}
CASES = [(file, *case) for file, cases in SIZES.items() for case in cases]


def crafted(content: bytes, folder: Path, changes: dict[str, Any]) -> Path:
    (path := folder / "model.nc").write_bytes(content)
    return rewritten(path, replaced(changes))


@pytest.mark.parametrize(
    ("file", "changes", "word"), CASES, ids=[f"{c[0]}-{'-'.join(c[1])}" for c in CASES]
)
def test_sizes_that_dont_fit_are_refused(file, changes, word, contents, tmp_path):
    within = {f"reduced.{place}": change for place, change in changes.items()}
    assert word in refused_untouched(crafted(contents[file], tmp_path, within))


@pytest.mark.parametrize("change", [short, thin, whole, lambda a: a[:1]])
def test_the_range_of_inputs_is_of_the_model(change, saved):
    assert "largest" in refused_untouched(rewritten(saved, replaced({"known.largest": change})))


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
    "own name": "term",
    "line behind": "z0\n    _result[99999] = z0",
    "line behind a semicolon": "z0; _result[0] = z0",
    "comment": "z0 # )",
    "two": "z0, z1",
    "end of the sum": "z0,)) or ((z0",
    "two targets": "z1 = z0",
    "walrus": "(z0 := 1.0)",
    "star": "*z0",
    "lambda": "lambda: z0",
    "f-string": "f'{z0}'",
    "attribute": "z0.real",
    "comparison": "z0 < z1",
    "chained comparison": "1.0 if 0.0 < z0 < 1.0 else 0.0",
    "remainder": "z0 % 2.0",
    "whole number": "1",
    "complex number": "1j",
    "full-width": "\uff5a0",
    "unknown function": "math.system(z0)",
    "too many arguments": "math.sin(z0, z0)",
    "keyword": "math.sin(x=z0)",
    "execute": "execute(p[0], p[0], p[0], p[0])",
    "signs": "-" * 60_000 + "u0",
    "deep": "z0 + " * 145 + "z0",
    "nothing": "",
    "number": 3,
}


@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS)
def test_features_that_are_more_than_arithmetic_of_their_numbers_are_refused(text, saved):
    terms = replaced({"reduced.features.terms.tuple": lambda known: [text, *known[1:]]})
    refused_untouched(rewritten(saved, terms))


SINES = " + ".join(["math.sin(z0)"] * 100)


@pytest.mark.parametrize(
    ("place", "entries"),
    [
        *(("lines", [[name, "z0"]]) for name in ("_result[9]", "_x", "_work", "p", "if", "\uff41")),
        *(("lines", [[name, "z0"]]) for name in ("a = 1.0\n    b", "a.b", "", "a, b")),
        ("lines", [["a", "a"]]),
        ("lines", [["a", "z9"]]),
        ("lines", [["a", "z0", "z0"]]),
        ("lines", [["a", SINES]] * 6),
        ("lines", [["a", "z0" + 100_000 * " "]] * 6),
        ("watched", [["p[99999]", "speed"]]),
        ("watched", [["y0", "speed"]]),
    ],
)
def test_lines_of_features_are_as_terms_are(place, entries, saved):
    added = [{"tuple": entry} for entry in entries]
    where = f"reduced.features.{place}.tuple"
    refused_untouched(rewritten(saved, replaced({where: lambda known: added + known})))


def test_what_is_huge_where_it_is_written_small_is_refused_soon(saved):
    # Never written: it takes no space in the file.
    with netCDF4.Dataset(saved, "r+") as file:
        for axis in "ab":
            file.createDimension(axis, 10**9)
        file.createVariable("huge", "f8", ("a", "b"), chunksizes=(1000, 1000))
    netcdf_file._seal(saved)
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
