"""Combined datasets: all runs of a grid on its dimensions, all rows of a protocol on its tests."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from vehiclemor.exceptions import CorruptError, InputError
from vehiclemor.parameters import AXES, parameter_and_axis
from vehiclemor.provenance import attributes, layout_digest, versions
from vehiclemor.simulation.model import Model
from vehiclemor.study.plans.choice import Row
from vehiclemor.study.plans.grid import Grid
from vehiclemor.study.plans.loading import content_hash
from vehiclemor.study.plans.protocol import Protocol, Scenarios
from vehiclemor.study.plans.study_file import StudyFile
from vehiclemor.study.plans.study_runs import PARAMETER
from vehiclemor.study.result import meaning_of, variables
from vehiclemor.study.store import MEND, combined_path, read_run, run_path, stored
from vehiclemor.study.workers import Workers

# Dimensions of a run's errors; each has the units of its labels beside it.
QUANTITIES = ("output", "coordinate", "speed")


def stored_study(
    workers: Workers,
    definition: StudyFile,
    keys: Sequence[str],
    make: Callable[[], xr.Dataset],
    times: str = "",
) -> xr.Dataset:
    """Combined dataset of a study: what is stored of the same runs, else what `make` gives."""
    parts = [layout_digest(), definition.model_dump_json(), times, *keys]
    digest = hashlib.sha256("\n".join(parts).encode()).hexdigest()[:20]
    sources = (run_path(workers.folder, key) for key in dict.fromkeys(keys))
    path, content = combined_path(workers.folder, workers.name), content_hash(definition)
    return stored(path, "cells", digest, make, sources, content)


def combined(grid: Grid, folder: Path) -> xr.Dataset:
    """All runs of a grid put together; `FileError` if one is missing, corrupt or foreign."""
    names, keys = tuple(grid.dimensions), grid.keys
    # One run may stand at several points.
    points_of: dict[str, list[int]] = {}
    for point, key in enumerate(keys.ravel().tolist()):
        points_of.setdefault(key, []).append(point)
    first = read_run(folder, next(iter(points_of)))
    template = first.dataset()
    arrays: dict[str, np.ndarray] = {}
    for name, variable in template.data_vars.items():
        # Texts of any length.
        dtype = object if variable.dtype.kind in "OU" else variable.dtype
        arrays[str(name)] = np.empty(keys.shape + variable.shape, dtype)
    for key, points in points_of.items():
        indices = np.unravel_index(points, keys.shape)
        run = read_run(folder, key)
        if run.layout != first.layout:
            raise CorruptError("not a run of the same model", run_path(folder, key), MEND)
        for name, array in arrays.items():
            array[indices] = run.variables[name][1][()]
    columns = {
        name: (names + template[name].dims, array, template[name].attrs)
        for name, array in arrays.items()
    }
    columns |= variables({"cell_key": keys}, *names)
    coordinates = {str(name): variable for name, variable in template.coords.items()}
    dataset = xr.Dataset(columns, _coordinates(grid) | coordinates)
    training = grid.definition.training
    training = training if isinstance(training, str) else ", ".join(training)
    return _with_attributes(dataset, grid.name, grid.definition, grid.model, training=training)


def _with_attributes(
    dataset: xr.Dataset, study: str, definition: StudyFile, model: Model, **further: object
) -> xr.Dataset:
    configuration = definition.model_dump_json(exclude_defaults=True)
    of_study = {"study": study, "model": model.name, "configuration": configuration}
    return dataset.assign_attrs(
        attributes(definition.title, model.kernel_hash, **of_study, **further)
    )


def _coordinates(grid: Grid) -> dict[str, Any]:
    """Values of the dimensions, with meanings."""
    coordinates: dict[str, Any] = {}
    for name, points in grid.dimensions.items():
        coordinates[name] = name, points, described(grid.model, name)
    methods = [entry.method for entry in grid.definition.methods]
    return coordinates | {"method": ("label", methods, described(grid.model, "method"))}


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
    does not have them.  `InputError` if units of one name differ.
    """
    parts: list[xr.Dataset] = []
    labels: set[str] = set()
    for name, dataset in results.items():
        rows = dataset.drop_dims(["time", "input"], errors="ignore")
        rows = rows.stack(cell=[d for d in rows.dims if d not in QUANTITIES]).reset_index("cell")
        rows = rows.assign_coords(study=("cell", [name] * rows.sizes["cell"]))
        of_rows = [str(label) for label in rows.coords if rows[label].dims == ("cell",)]
        labels.update(of_rows)
        # Data that a study does not have are missing in its rows; coordinates must not be.
        parts.append(rows.reset_coords(of_rows))
    try:
        dataset = xr.concat(
            parts,
            dim="cell",
            data_vars="minimal",
            coords="minimal",
            compat="no_conflicts",
            join="outer",
        )
    except xr.MergeError:
        raise InputError(
            "quantities of one name have several units in these studies: read each of the results"
        ) from None
    dataset = dataset.set_coords(labels)
    dataset.attrs = {"source": "vehiclemor", "studies": ", ".join(results), "versions": versions()}
    return dataset


def protocol_dataset(
    protocol: Protocol,
    rows: Sequence[Row],
    sets: Mapping[str, Scenarios],
    results: dict[str, list[xr.Dataset]],
    timed: xr.Dataset,
    apart: Mapping[str, list[str]],
) -> xr.Dataset:
    """Results of all rows on the dimensions `label`, `scenario` and `output`.

    By name of the `sets`, `results` are those of the rows, and `apart` says why scenarios are not
    judged; `timed` has those of the judged scenarios that the protocol times.
    """
    parts: list[xr.Dataset] = []
    for name, datasets in results.items():
        number = datasets[0].sizes["scenario"]
        of_run = {"scenario_set": [name] * number, "apart": apart.get(name, [""] * number)}
        # Of a family and of a log all members together.
        names = [run.maneuver.name for run in sets[name]]
        of_run["maneuver"] = [run.rpartition(":")[0] or run for run in names]
        part = xr.concat(datasets, dim="label", combine_attrs="override")
        parts.append(part.assign_coords(variables(of_run, "scenario")))
    # What does not depend on the scenario is the same in every set, but for seconds.
    fixed = [n for n, v in parts[0].data_vars.items() if "scenario" not in v.dims]
    by_scenario = [part.drop_vars(fixed) for part in parts]
    dataset = xr.concat(by_scenario, dim="scenario", combine_attrs="override")
    dataset = dataset.merge(parts[0][fixed])
    dataset = dataset.drop_vars(["seconds", "offline_seconds"])
    per_row: dict[str, object] = {
        "offline_seconds": timed["offline_seconds"].values.tolist(),
        "role": [row.entry.role for row in rows],
        "series": [row.entry.label for row in rows],
        "winner": [row.winner for row in rows],
        "method": [row.entry.method for row in rows],
        "settings": [json.dumps(row.settings, sort_keys=True) for row in rows],
        "validation": [_validation(row) for row in rows],
        "validation_score": [row.result.score for row in rows],
        "cell_keys": [
            json.dumps({name: of_set[number].attrs["cell"] for name, of_set in results.items()})
            for number in range(len(rows))
        ],
    }
    dataset = dataset.assign(variables(per_row, "label")).set_coords("method")
    dataset = dataset.assign_coords(label=[row.label for row in rows])
    for name in ("label", "scenario"):
        dataset[name].attrs["long_name"] = meaning_of(name)
    test_runs = np.flatnonzero(dataset["scenario_set"].values == judged_set(results))
    columns = test_runs[protocol.timed_runs(len(test_runs))]
    for name, variable in timed.data_vars.items():
        if "scenario" in variable.dims:
            online = np.full((len(rows), dataset.sizes["scenario"]), np.nan)
            online[:, columns] = variable.values
            dataset[name] = (("label", "scenario"), online, dict(variable.attrs))
    # Of the first run.
    dataset.attrs.clear()
    return _with_attributes(
        dataset,
        protocol.study,
        protocol.definition,
        protocol.model,
        evaluations=protocol.model.evaluations,
        test_set=_test_set(protocol, results),
    )


def _test_set(protocol: Protocol, results: Mapping[str, Sequence[xr.Dataset]]) -> str:
    """Name of what is judged, with a hash of the very runs where they are sampled."""
    if "drawn" not in results:
        return "listed"
    labels = "\n".join(str(label) for label in results["drawn"][0]["scenario"].values)
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
