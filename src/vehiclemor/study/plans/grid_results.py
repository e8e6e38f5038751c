"""Combined dataset of a study: every cell at its place on named dimensions."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.study.plans.grid import Grid
from vehiclemor.study.provenance import attributes, layout_digest, versions
from vehiclemor.study.store import read_arrays, read_dataset, result_path
from vehiclemor.study.variables import meaning_of, variables

if TYPE_CHECKING:
    import xarray as xr

# Dimensions of a cell's errors; each has the units of its labels beside it.
QUANTITIES = ("output", "coordinate", "speed")


def cells_digest(grid: Grid) -> str:
    """Hash of a study and its cells at their places, for a combined dataset to be current."""
    digest = hashlib.sha256(grid.definition.model_dump_json().encode())
    digest.update(layout_digest().encode())
    for place, cell in grid.cells.items():
        digest.update(f"{place} {cell.key}".encode())
    return digest.hexdigest()[:20]


def grid_dataset(grid: Grid, folder: Path) -> xr.Dataset:
    """Read all cells of a grid and put them together.

    Raises
    ------
    FileError
        If a cell is missing, corrupt or foreign.
    """
    import xarray as xr

    first_places: dict[str, list[tuple[int, ...]]] = {}
    for place, cell in grid.cells.items():
        first_places.setdefault(cell.key, []).append(place)
    sizes = tuple(len(values) for values in grid.dimensions.values())
    arrays: dict[str, np.ndarray] = {}
    template: xr.Dataset | None = None
    for key, places in first_places.items():
        path = result_path(folder, key)
        if template is None:
            template = read_dataset(path, "cell", key)
            for name, variable in template.data_vars.items():
                arrays[str(name)] = _empty(sizes + variable.shape, variable.dtype)
        found = read_arrays(path, "cell", key)
        for name, array in arrays.items():
            for place in places:
                array[place] = found[name]
    assert template is not None
    names = tuple(grid.dimensions)
    keys = np.full(sizes, "", dtype=object)
    for place, cell in grid.cells.items():
        keys[place] = cell.key
    coordinates: dict[str, Any] = {
        name: (name, values, {"long_name": meaning_of(name)})
        for name, values in grid.dimensions.items()
    }
    coordinates |= {str(name): variable for name, variable in template.coords.items()}
    combined = {
        str(name): (names + variable.dims, arrays[str(name)], variable.attrs)
        for name, variable in template.data_vars.items()
    }
    dataset = xr.Dataset(combined | variables({"cell_key": keys}, *names), coordinates)
    cell = next(iter(grid.cells.values()))
    return dataset.assign_attrs(
        attributes(
            grid.definition.title,
            cell.kernel,
            study=grid.name,
            model=cell.model,
            training=grid.definition.training,
            configuration=json.dumps(grid.definition.model_dump(), sort_keys=True),
        )
    )


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
