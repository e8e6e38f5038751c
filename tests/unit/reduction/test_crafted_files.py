"""Saved models that somebody has changed: any part is refused in a line or changes nothing."""

import json
from contextlib import suppress
from unittest import mock

import netCDF4
import numpy as np
import pytest

import vehiclemor as vm
from tests.unit.reduction.saved_files import (
    NOTHING,
    content,
    nothing_runs,
    refused_untouched,
    replaced,
    rewritten,
    written,
)
from vehiclemor import netcdf_file
from vehiclemor.codegen.operations import KINDS, MOST_SIZE
from vehiclemor.exceptions import FileError
from vehiclemor.reduction import parts
from vehiclemor.reduction.parts import Parts

ROOM = "vehiclemor.reduction"
NAMES = [
    *("os:system", "vehiclemor.files:write_text", f"{ROOM}.no_such_room:thing"),
    *("vehiclemor.simulation.dynamic:DynamicModel", f"{ROOM}.reduced_system:ReducedMechanism"),
    *(f"{ROOM}.vehicle.features:{name}" for name in ("monomials", "Features.terms", "PLANAR")),
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
            return None, True, -1 - value, value + 10**6, str(value)
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
    if isinstance(node, dict) and "@array" in node:
        array = Parts(NOTHING, arrays).read(node, place)
        for other in arrays_instead(array):
            if other.dtype != array.dtype or not np.array_equal(other, array):
                yield {place: other}
        return
    for value in values_instead(node):
        yield {place: value}
    children = enumerate(node[:1]) if isinstance(node, list) else ()
    for key, part in node.items() if isinstance(node, dict) else children:
        yield from mutations(part, arrays, f"{place}.{key}")


# Where a file may hold another model: fewer vectors, other blocks of coefficients, other names.
OTHER_MODELS = ("bases.0.vectors", "features.named", "features.groups", "groups.0.0", "groups.0.1")


@pytest.mark.parametrize("name", ["car", "map", "pod", "windows", "replay"])
def test_any_other_part_is_refused_in_a_line_or_changes_nothing(name, contents, tmp_path):
    """Arrays and whole numbers that don't fit are refused before code is compiled or run."""
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
        exact = isinstance(value, np.ndarray | int | list) and not place.endswith(OTHER_MODELS)
        if exact:
            np.testing.assert_array_equal(vm.load(path).simulate().outputs, expected, str(change))
        else:
            with suppress(FileError):
                vm.load(path)


def nan(array):
    return np.nan * array


# File, word of the check that sees it, places that are changed together.
TOGETHER = [
    ("car", "decoding", {"encoding": lambda a: a[:, :-1], "decoding": lambda a: a[:, :-1]}),
    ("map", "ranges", {"ranges": nan}),
    *(("map", "cells", {f"cells.{n}": nan}) for n in ("centres", "scales")),
    ("map", "cells", {f"cells.{n}": lambda a: a[:1] for n in ("centres", "scales", "numbers")}),
    ("map", "degree", {"moving": [], "cells.coefficients": lambda a: a[:, :1]}),
    ("pod", "formulation", {"spaces.formulation": "full"}),
    ("pod", "spaces", {f"spaces.{n}": lambda a: a[..., :-1] for n in ("means", "trial_basis")}),
    ("windows", "bases", {f"bases.1.{n}": lambda a: a[:-1] for n in ("mean", "vectors")}),
    ("windows", "rank", {"bases.0.vectors": lambda a: np.ones((len(a), len(a) + 1))}),
]


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
    inner = "reduced.features.operations"
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


@pytest.mark.parametrize("text", ["[" * 100_000, "1" * 5_000, "[" + "0," * 2_000_001 + "0]"])
def test_texts_that_are_deep_or_long_are_refused_soon(text, saved):
    with mock.patch.object(json, "dumps", return_value=text):
        rewritten(saved, lambda *_: None)
    refused_untouched(saved)
