"""Saved models with other content, and how they are refused."""

import json
from contextlib import ExitStack, chdir, contextmanager
from types import SimpleNamespace
from typing import Any
from unittest import mock

import numpy as np
import xarray as xr

import vehiclemor as vm
from tests.refusing import refused
from vehiclemor.exceptions import FileError
from vehiclemor.netcdf_file import write_dataset
from vehiclemor.reduction.parts import Reader, Writer

# What refers to no model.
NOTHING: Any = SimpleNamespace()


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
