"""Results as frames: a row for each run, of grids and protocols alike, and tables made of them."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from vehiclemor.registry import component
from vehiclemor.report.default_studies import nominal, of_paper, perturbed
from vehiclemor.report.labels import trained_runs
from vehiclemor.report.printing import ends_text
from vehiclemor.report.published import rms_numbers
from vehiclemor.report.shown import tabled_outputs
from vehiclemor.simulation.trajectory import (
    ALGEBRAIC_COUNTS,
    DYNAMIC_COUNTS,
    EVALUATIONS,
    FINISHED,
)
from vehiclemor.study.run import run_studies

if TYPE_CHECKING:
    import xarray as xr

COUNTS = ("effective_rank", *(DYNAMIC_COUNTS | ALGEBRAIC_COUNTS), "growth_rate", "in_training")
# Kind of the rows of a grid in a comparison.
ERRORS = "errors"


def frame(dataset: xr.Dataset, variables: Iterable[str] = ()) -> pd.DataFrame:
    """A row for each run, in the order of the grid; histories are left out.

    Columns are what varies (factors, parameters, start, label and its method, scenario), then
    variables, such as `status`; one with further dimensions has a column for each of their values:
    `rms_error.toe`.

    Parameters
    ----------
    variables
        Those that are wanted; all by default.
    """
    import xarray as xr

    like, wanted = dataset["status"], set(variables)
    columns: dict[str, np.ndarray] = {}
    for name, rest in sorted(_further(dataset).items(), key=lambda e: e[0] not in dataset.coords):
        if not wanted or name in wanted or name in dataset.coords:
            whole = xr.broadcast(dataset[name], like)[0].transpose(*like.dims, *rest)
            values = whole.values.reshape(like.size, -1)
            names = _names(dataset, name, rest)
            columns |= {column: values[:, place] for place, column in enumerate(names)}
    return pd.DataFrame(columns)


def _further(dataset: xr.Dataset) -> dict[str, list[str]]:
    """Variable of a frame -> its dimensions beyond the runs'."""
    runs = set(dataset["status"].dims)
    found: dict[str, list[str]] = {}
    for name, variable in dataset.variables.items():
        rest = [str(d) for d in variable.dims if d not in runs]
        inside = name not in dataset.coords or (not rest and variable.dims)
        if inside and not {"time", "input"} & set(rest):
            found[str(name)] = rest
    return found


def _names(dataset: xr.Dataset, name: str, rest: list[str]) -> list[str]:
    labels = itertools.product(*(dataset[d].values.astype(str).tolist() for d in rest))
    return [".".join((name, *label)) for label in labels]


def column_meanings(dataset: xr.Dataset) -> pd.DataFrame:
    """Name, unit and meaning of every column of a dataset's frame."""
    rows: list[dict[str, str]] = []
    for name, rest in _further(dataset).items():
        attributes, names = dataset[name].attrs, _names(dataset, name, rest)
        units = [attributes.get("units", "")] * len(names)
        # Of outputs that do not share one unit each has its own.
        if "units" not in attributes and len(rest) == 1 and f"{rest[0]}_unit" in dataset.coords:
            units = dataset[f"{rest[0]}_unit"].values.tolist()
        meaning = str(attributes.get("long_name", ""))
        pairs = zip(names, units, strict=True)
        rows += [{"column": column, "unit": unit, "meaning": meaning} for column, unit in pairs]
    return pd.DataFrame(rows)


def flat(dataset: xr.Dataset, outputs: Sequence[str]) -> pd.DataFrame:
    """Frame of a study with its place in the grid, errors of some outputs, counts and status."""
    short = {"rms_error": "rms", "floor_rms_error": "floor"}
    errors = {f"{name}.{o}": f"{word}_{o}" for o in outputs for name, word in short.items()}
    counts = [name for name in COUNTS if name in dataset]
    rows: Any = frame(dataset, [*short, *counts, "status", "message"]).rename(columns=errors)
    return rows[[*map(str, dataset["status"].dims), *errors.values(), *counts, "status", "message"]]


def error_table(model: str, results: Path, jobs: int = 1) -> pd.DataFrame:
    """Every run of a model in the paper's studies; of another model, of every method.

    Those are its nominal and its perturbed runs.
    """
    own = nominal(model, results), perturbed(model, results)
    return study_tables(model, ["paper"] if rms_numbers(model) else own, results, jobs)


def study_tables(model: str, studies: Sequence[str], results: Path, jobs: int = 1) -> pd.DataFrame:
    """RMS errors, floors, counts and status of every cell of studies of a model."""
    outputs = tabled_outputs(component("model", model))
    datasets = {k: v for study in studies for k, v in run_studies(study, results, jobs).items()}
    own = {name: d for name, d in datasets.items() if d.attrs["model"] == model}
    rows = pd.concat(
        [flat(d, outputs).assign(study=name) for name, d in own.items()], ignore_index=True
    )
    first = ["study", "label", "start"]
    return rows.reindex(columns=[*first, *(c for c in rows.columns if c not in first)])


def settings_table(
    study: str, outputs: Sequence[str], results: Path, jobs: int = 1
) -> pd.DataFrame:
    """Control-period POD on a vehicle with every combination of its settings, as of `flat`."""
    return flat(next(iter(run_studies(study, results, jobs).values())), outputs)


def quantity_table(model: str, results: Path, jobs: int = 1) -> pd.DataFrame:
    """Largest RMS errors of a vehicle's nominal runs: positions, speeds, outputs, constraints.

    Returns
    -------
    pandas.DataFrame
        For each method, start, group of quantities and unit: the largest RMS error, and of which
        quantity it is.  For constraints it is the RMS of the violation itself.
    """
    study = of_paper(model) or nominal(model, results)
    dataset = next(iter(run_studies(study, results, jobs).values()))
    rows: list[dict[str, object]] = []
    for label, start in itertools.product(dataset["label"].values, dataset["start"].values):
        point = dataset.sel({"label": label, "start": start}).squeeze(drop=True)
        groups = {
            "coordinate": point["rms_coordinate_error"].to_series(),
            "speed": point["rms_speed_error"].to_series(),
            "output": point["rms_error"].to_series(),
        }
        units = {key: point[f"{key}_unit"].to_series() for key in groups}
        drifts = [str(o) for o in point["output"].values if str(o).endswith("_drift")]
        if drifts:
            squares = point["outputs"].sel(output=drifts) ** 2
            groups["constraint"] = (squares.mean("time", skipna=False) ** 0.5).to_series()
            units["constraint"] = units["output"].loc[drifts]
            groups["output"] = groups["output"].drop(drifts)
        place = {"label": label, "start": start, "status": str(point["status"].item())}
        for group, errors in groups.items():
            for unit, part in errors.groupby(units[group].loc[errors.index]):
                worst = part.idxmax() if part.notna().all() else ""
                entry = {"group": group, "unit": unit, "quantity": worst, "rms": part.max()}
                rows.append(place | entry)
    return pd.DataFrame(rows)


def grid_rows(dataset: xr.Dataset) -> list[dict[str, Any]]:
    """A row for each method, start and output of a combined dataset.

    `runs` are different ones, `failures` says how those that have `failed` ended, `warned` counts
    those that aren't trusted (`warned_runs`), `trained` those that the method was trained on; of
    those that have ended `median` and `largest` are RMS errors over the grid, `largest_deviation`
    is at one time; `largest_at` is the place of the largest RMS error, `floor` that of the best
    approximation there.  `seconds` (of the compiled loop), `offline_seconds` and `evaluations` are
    medians.
    """
    attributes = {key: str(dataset.attrs[key]) for key in ("study", "title", "model", "training")}
    head = {"kind": ERRORS, **attributes, "grid": _grid_words(dataset)}
    count = EVALUATIONS[component("model", head["model"]).kind]
    kept = ["rms_error", "max_error", "floor_rms_error", "cell_key", "status", "seconds"]
    kept += ["offline_seconds", count, "warned", "trained"]
    told = dataset.assign(warned=warned_runs(dataset), trained=trained_runs(dataset))
    runs: Any = frame(told, kept)  # pandas has no types that a checker could follow
    rows: list[dict[str, Any]] = []
    for start, label in itertools.product(dataset["start"].values, dataset["label"].values):
        own = runs[(runs["start"] == start) & (runs["label"] == label)]
        # Points of the grid that a method does not depend on are one run.
        own = own.drop_duplicates("cell_key")
        place = {**head, "start": str(start), "label": str(label)}
        rows += [place | row for row in _rows_of_method(own, dataset, count)]
    return rows


def _rows_of_method(runs: Any, dataset: xr.Dataset, count: str) -> list[dict[str, Any]]:
    """One method from one start: a row for each output."""
    ended = runs[runs["status"].isin(FINISHED)]
    failures = Counter(map(str, runs["status"].drop(ended.index)))
    common = {
        "runs": len(runs),
        "failed": failures.total(),
        "failures": ", ".join(f"{n} {name}" for name, n in failures.most_common()),
        **{name: int(runs[name].sum()) for name in ("warned", "trained")},
        **{name: _median(ended[name]) for name in ("seconds", "offline_seconds")},
        "evaluations": _median(ended[count]),
    }
    varied = [str(d) for d in dataset["status"].dims if len(set(runs[d])) > 1]
    rows = []
    for output, unit in zip(dataset["output"].values, dataset["output_unit"].values, strict=True):
        errors = ended[f"rms_error.{output}"].astype(float)
        errors = errors[np.isfinite(errors)]
        row = {"output": str(output), "unit": str(unit), **common, "median": _median(errors)}
        row |= {"largest": np.nan, "largest_deviation": np.nan, "largest_at": "", "floor": np.nan}
        if len(errors):
            worst = ended.loc[errors.idxmax()]
            at = ", ".join(f"{d} {_value(worst[d])}" for d in varied)
            row["largest"] = float(errors.max())
            row["largest_deviation"] = float(ended[f"max_error.{output}"].max(skipna=False))
            row["largest_at"] = at if row["largest"] > 0.0 else ""
            row["floor"] = float(worst[f"floor_rms_error.{output}"])
        rows.append(row)
    return rows


def _value(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _median(values: Any) -> float:
    return float(values[np.isfinite(values.astype(float))].median())


def _grid_words(dataset: xr.Dataset) -> str:
    """The grid's dimensions with their values."""
    words = []
    for name in map(str, dataset["status"].dims):
        values = [f"{v:g}" if isinstance(v, float) else str(v) for v in dataset[name].values]
        if name not in ("label", "start") and (len(values) > 1 or values != ["1"]):
            every = ", ".join(values) if len(values) <= 8 else f"{values[0]} to {values[-1]}"
            words.append(f"{name} {every}" + (f" ({len(values)})" if len(values) > 8 else ""))
    for name, values in dataset.coords.items():
        if values.dims == ("sample",) and name != "sample":
            words.append(f"{name} {float(values.min()):.4g} to {float(values.max()):.4g}")
    return "; ".join(words)


def warned_runs(dataset: xr.Dataset) -> xr.DataArray:
    """Which runs of a study aren't trusted: by the method (status), or as a protocol would judge.

    A grid leaves the second to this mark, so that errors of such runs are still shown.
    """
    return dataset["warned"].astype(bool)


def counted_ends(dataset: xr.Dataset) -> str:
    """How the runs of a study have ended; a cell that stands at several places counts once."""
    # A protocol's runs have no cells of their own.
    told = dataset.assign(
        warned=(dataset["status"] == "ok") & warned_runs(dataset), trained=trained_runs(dataset)
    )
    runs: Any = frame(told, ["status", "cell_key", "warned", "trained"])
    runs = runs.drop_duplicates("cell_key") if "cell_key" in runs else runs
    trained = int(runs["trained"].sum())
    note = f"; {trained} trained on the tested run" if trained else ""
    return ends_text(runs["status"], int(runs["warned"].sum())) + note
