"""Combined dataset of a study: every cell at its place on named dimensions."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.parameters import AXES, parameter_and_axis
from vehiclemor.simulation.model import Model
from vehiclemor.study.plans.grid import Grid
from vehiclemor.study.plans.study_file import PARAMETER
from vehiclemor.study.provenance import attributes, layout_digest, versions
from vehiclemor.study.store import read_arrays, read_cell
from vehiclemor.study.variables import meaning_of, variables

if TYPE_CHECKING:
    import xarray as xr

# Dimensions of a cell's errors; each has the units of its labels beside it.
QUANTITIES = ("output", "coordinate", "speed")


def cells_digest(grid: Grid) -> str:
    """Hash of a study and its cells at their places, for a combined dataset to be current."""
    digest = hashlib.sha256(grid.definition.model_dump_json().encode())
    digest.update(layout_digest().encode())
    digest.update(grid.keys.tobytes())
    return digest.hexdigest()[:20]


def combined(grid: Grid, folder: Path) -> xr.Dataset:
    """All cells of a grid put together.

    Raises
    ------
    FileError
        If a cell is missing, corrupt or foreign.
    """
    import xarray as xr

    names, keys = tuple(grid.dimensions), grid.keys
    arrays: dict[str, np.ndarray] = {}
    found, numbers = np.unique(keys, return_inverse=True)
    order = np.argsort(numbers, axis=None, kind="stable")
    ends = np.cumsum(np.bincount(numbers.ravel(), minlength=len(found)))
    template: xr.Dataset | None = None
    for key, flat in zip(found.astype(str), np.split(order, ends[:-1]), strict=True):
        if template is None:
            template = read_cell(folder, key)
            for name, variable in template.data_vars.items():
                arrays[str(name)] = _empty(keys.shape + variable.shape, variable.dtype)
        places = np.unravel_index(flat, keys.shape)
        cell = read_arrays(folder, key)
        for name, array in arrays.items():
            array[places] = cell[name]
    assert template is not None
    combined = {
        str(name): (names + variable.dims, arrays[str(name)], variable.attrs)
        for name, variable in template.data_vars.items()
    }
    combined |= variables({"cell_key": keys.astype(str).astype(object)}, *names)
    coordinates = {str(name): variable for name, variable in template.coords.items()}
    dataset = xr.Dataset(combined, _coordinates(grid) | coordinates)
    definition, model = grid.definition, grid.model
    own = {
        "study": grid.name,
        "model": model.name,
        "training": definition.training_words,
        "configuration": json.dumps(definition.model_dump(), sort_keys=True),
    }
    return dataset.assign_attrs(attributes(definition.title, model.kernel_hash, **own))


def _coordinates(grid: Grid) -> dict[str, Any]:
    """Values of the dimensions, and of what is sampled; with meanings."""
    found = {name: (name, values) for name, values in grid.dimensions.items()}
    found |= {name: ("sample", values) for name, values in grid.samples.items()}
    found["method"] = "label", [entry.method for entry in grid.definition.methods]
    return {
        name: (dimension, values, described(grid.model, name))
        for name, (dimension, values) in found.items()
    }


def described(model: Model, dimension: str) -> dict[str, str]:
    """Meaning of a dimension, and unit of a parameter: as its parameter file has them."""
    if not dimension.startswith(PARAMETER):
        return {"long_name": meaning_of(dimension)}
    given = dimension.removeprefix(PARAMETER)
    name, axis = parameter_and_axis(model.name, model.definition.parameters, given)
    entry = model.parameters.entries[name]
    component = "" if axis is None else f", component {AXES[axis]}"
    return {"long_name": f"{entry.description}{component}", "units": entry.unit}


def _empty(shape: tuple[int, ...], dtype: np.dtype) -> np.ndarray:
    if dtype.kind in "OUT":
        return np.full(shape, "", dtype=object)
    return np.zeros(shape, dtype=dtype)


def flattened(results: dict[str, xr.Dataset]) -> xr.Dataset:
    """Combined datasets of several studies as rows of one, on the dimension `cell`.

    Histories are left out; grid dimensions become coordinates of the rows, missing where a study
    does not have them.
    """
    import xarray as xr

    parts: list[xr.Dataset] = []
    units: dict[str, dict[str, str]] = {name: {} for name in QUANTITIES}
    for name, dataset in results.items():
        rows = dataset.drop_dims([d for d in ("time", "input") if d in dataset.dims])
        for quantity in QUANTITIES:
            if quantity in rows.dims:
                pairs = zip(rows[quantity].values, rows[f"{quantity}_unit"].values, strict=True)
                units[quantity] |= {str(label): str(unit) for label, unit in pairs}
                rows = rows.drop_vars(f"{quantity}_unit")
        rows = rows.stack(cell=[d for d in rows.dims if d not in QUANTITIES]).reset_index("cell")
        parts.append(rows.assign_coords(study=("cell", [name] * rows.sizes["cell"])))
    labels = sorted({str(c) for part in parts for c in part.coords if part[c].dims == ("cell",)})
    complete = [
        part.assign_coords(
            {
                label: ("cell", np.full(part.sizes["cell"], np.nan))
                for label in labels
                if label not in part.coords
            }
        )
        for part in parts
    ]
    # Models differ in their quantities and counts: what a row does not have is missing in it.
    dataset = xr.concat(complete, dim="cell", coords="minimal", compat="override", join="outer")
    for quantity in QUANTITIES:
        if quantity in dataset.dims:
            column = [units[quantity][str(label)] for label in dataset[quantity].values]
            attributes = {"long_name": f"SI unit of the {quantity}"}
            dataset = dataset.assign_coords({f"{quantity}_unit": (quantity, column, attributes)})
    dataset.attrs = {"source": "vehiclemor", "studies": ", ".join(results), "versions": versions()}
    return dataset
