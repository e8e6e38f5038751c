"""Combined datasets: every run of a grid at its place, every row of a protocol on its tests."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Container, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from vehiclemor.exceptions import CorruptError
from vehiclemor.parameters import AXES, parameter_and_axis
from vehiclemor.provenance import attributes, layout_digest, versions
from vehiclemor.simulation.model import Model
from vehiclemor.study.plans.choice import Row
from vehiclemor.study.plans.grid import Grid
from vehiclemor.study.plans.protocol import Protocol
from vehiclemor.study.plans.study_file import StudyFile
from vehiclemor.study.plans.study_runs import PARAMETER
from vehiclemor.study.result import meaning_of, variables
from vehiclemor.study.store import MEND, read_run, run_path

# Dimensions of a run's errors; each has the units of its labels beside it.
QUANTITIES = ("output", "coordinate", "speed")


def grid_digest(grid: Grid) -> str:
    """Hash of a study and its runs at their places, for a combined dataset to be current."""
    digest = hashlib.sha256(grid.definition.model_dump_json().encode())
    digest.update(layout_digest().encode())
    digest.update(grid.keys.tobytes())
    return digest.hexdigest()[:20]


def combined(grid: Grid, folder: Path) -> xr.Dataset:
    """All runs of a grid put together; `FileError` if one is missing, corrupt or foreign."""
    names, keys = tuple(grid.dimensions), grid.keys
    found, numbers = np.unique(keys, return_inverse=True)
    order = np.argsort(numbers, axis=None, kind="stable")
    ends = np.cumsum(np.bincount(numbers.ravel(), minlength=len(found)))
    first = read_run(folder, found[0].decode())
    template = first.dataset()
    # Texts of any length.
    arrays = {
        str(name): np.empty(keys.shape + v.shape, object if v.dtype.kind in "OU" else v.dtype)
        for name, v in template.data_vars.items()
    }
    for key, flat in zip(found.astype(str), np.split(order, ends[:-1]), strict=True):
        places = np.unravel_index(flat, keys.shape)
        run = read_run(folder, key)
        if run.layout != first.layout:
            raise CorruptError("not a run of the same model", run_path(folder, key), MEND)
        for name, array in arrays.items():
            array[places] = run.variables[name][1][()]
    whole = {
        name: (names + template[name].dims, array, template[name].attrs)
        for name, array in arrays.items()
    }
    whole |= variables({"cell_key": keys.astype(str).astype(object)}, *names)
    coordinates = {str(name): variable for name, variable in template.coords.items()}
    dataset = xr.Dataset(whole, _coordinates(grid) | coordinates)
    own = {"training": grid.definition.trained_on}
    return _with_attributes(dataset, grid.name, grid.definition, grid.model, **own)


def _with_attributes(
    dataset: xr.Dataset, study: str, definition: StudyFile, model: Model, **further: object
) -> xr.Dataset:
    own = {"study": study, "model": model.name}
    own["configuration"] = definition.model_dump_json(exclude_defaults=True)
    found = attributes(definition.title, model.kernel_hash, **own, **further)
    return dataset.assign_attrs(found)


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


def flattened(results: dict[str, xr.Dataset]) -> xr.Dataset:
    """Combined datasets of several studies as rows of one, on the dimension `cell`.

    Histories are left out; grid dimensions become coordinates of the rows, missing where a study
    does not have them.
    """
    parts: list[xr.Dataset] = []
    units: dict[str, dict[str, str]] = {name: {} for name in QUANTITIES}
    for name, dataset in results.items():
        rows = dataset.drop_dims([d for d in ("time", "input") if d in dataset.dims])
        for quantity in set(QUANTITIES) & set(rows.dims):
            units[quantity] |= rows[f"{quantity}_unit"].to_series().to_dict()
            rows = rows.drop_vars(f"{quantity}_unit")
        rows = rows.stack(cell=[d for d in rows.dims if d not in QUANTITIES]).reset_index("cell")
        parts.append(rows.assign_coords(study=("cell", [name] * rows.sizes["cell"])))
    labels = sorted({str(c) for part in parts for c in part.coords if part[c].dims == ("cell",)})
    for place, part in enumerate(parts):
        missing = "cell", np.full(part.sizes["cell"], np.nan)
        parts[place] = part.assign_coords({n: missing for n in labels if n not in part.coords})
    # Models differ in their quantities and counts: what a row does not have is missing in it.
    dataset = xr.concat(parts, dim="cell", coords="minimal", compat="override", join="outer")
    for quantity in (name for name in QUANTITIES if name in dataset.dims):
        column = [units[quantity][label] for label in dataset[quantity].values.tolist()]
        meaning = {"long_name": f"SI unit of the {quantity}"}
        dataset = dataset.assign_coords({f"{quantity}_unit": (quantity, column, meaning)})
    dataset.attrs = {"source": "vehiclemor", "studies": ", ".join(results), "versions": versions()}
    return dataset


def protocol_dataset(
    protocol: Protocol,
    rows: Sequence[Row],
    found: dict[str, list[xr.Dataset]],
    timed: xr.Dataset,
    apart: Mapping[str, list[str]],
) -> xr.Dataset:
    """Results of all rows on the dimensions `label`, `scenario` and `output`.

    Given by set are the results of the rows, and why scenarios are not judged; `timed` has
    those of the scenarios that are judged which the protocol times.
    """
    parts: list[xr.Dataset] = []
    for name, datasets in found.items():
        number = datasets[0].sizes["scenario"]
        of_run = {"scenario_set": [name] * number, "apart": apart.get(name, [""] * number)}
        part = xr.concat(datasets, dim="label", combine_attrs="override")
        parts.append(part.assign_coords(variables(of_run, "scenario")))
    # What does not depend on the scenario is the same in every set, but for seconds.
    fixed = [n for n, v in parts[0].data_vars.items() if "scenario" not in v.dims]
    rest = [part.drop_vars(fixed) for part in parts]
    dataset = xr.concat(rest, dim="scenario", combine_attrs="override").merge(parts[0][fixed])
    # How the files store text holds for their own longest words only.
    dataset = dataset.drop_vars(["seconds", "offline_seconds"]).drop_encoding()
    cells = [
        {name: sets[index].attrs["cell"] for name, sets in found.items()}
        for index in range(len(rows))
    ]
    per_row: dict[str, list[Any]] = {
        "role": [row.entry.role for row in rows],
        "series": [row.entry.label for row in rows],
        "winner": [row.winner for row in rows],
        "method": [row.entry.method for row in rows],
        "settings": [json.dumps(row.settings, sort_keys=True) for row in rows],
        "cell_keys": [json.dumps(keys) for keys in cells],
        "validation": [_validation(row) for row in rows],
        "validation_score": [row.result.score for row in rows],
        "offline_seconds": [float(value) for value in timed["offline_seconds"]],
    }
    dataset = dataset.assign(variables(per_row, "label")).set_coords("method")
    dataset = dataset.assign_coords(label=[row.label for row in rows])
    for name in ("label", "scenario"):
        dataset[name].attrs["long_name"] = meaning_of(name)
    judged = np.flatnonzero(dataset["scenario_set"].values == judged_set(found))
    columns = judged[protocol.timed_runs(len(judged))]
    for name in (n for n, variable in timed.data_vars.items() if "scenario" in variable.dims):
        online = np.full((len(rows), dataset.sizes["scenario"]), np.nan)
        online[:, columns] = timed[name].values
        dataset[name] = (("label", "scenario"), online, dict(timed[name].attrs))
    # Of the first run.
    dataset.attrs.clear()
    own = {"evaluations": protocol.model.evaluations, "test_set": _test_set(protocol, found)}
    return _with_attributes(dataset, protocol.study, protocol.definition, protocol.model, **own)


def _test_set(protocol: Protocol, found: Mapping[str, Sequence[xr.Dataset]]) -> str:
    """Name of what is judged, with a hash of the very runs where they are sampled."""
    if "drawn" not in found:
        return "listed"
    labels = "\n".join(str(label) for label in found["drawn"][0]["scenario"].values)
    return f"{protocol.test_set}, runs {hashlib.sha256(labels.encode()).hexdigest()[:8]}"


def judged_set(sets: Container[str]) -> str:
    """The set on which a protocol judges: what is sampled, else what is listed."""
    return "drawn" if "drawn" in sets else "test"


def judged_part(dataset: xr.Dataset) -> xr.Dataset:
    """What is judged of a combined dataset: without runs on which the full order is sensitive."""
    sets = dataset["scenario_set"].values
    chosen = (sets == judged_set(set(sets))) & (dataset["apart"].values == "")
    return dataset.isel(scenario=chosen)


def _validation(row: Row) -> str:
    """Every candidate's settings and validation result as JSON text; the chosen one is marked."""
    content = []
    for index, result in enumerate(row.validation):
        # JSON has no infinity: a number that is infinite is null.
        finite = {n: v if np.isfinite(v) else None for n, v in asdict(result).items()}
        chosen = {"settings": row.entry.candidates[index], "chosen": index == row.candidate}
        content.append(chosen | finite)
    return json.dumps(content, sort_keys=True)
