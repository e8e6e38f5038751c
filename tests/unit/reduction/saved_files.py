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
from vehiclemor.reduction.parts import Parts

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
    """Puts values, or functions of what is there, at paths `a.b.c` in the parts of a model."""

    def change(dataset, tree):
        stored = {str(name): variable.values for name, variable in dataset.items()}
        for path, value in changes.items():
            holder, key, node = tree, "", tree
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
