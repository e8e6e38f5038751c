"""Error tables: every cell of a study, and the largest errors by groups of quantities."""

import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from vehiclemor.registry import component
from vehiclemor.report.default_studies import nominal, of_paper, perturbed
from vehiclemor.report.labels import trained_runs
from vehiclemor.report.printing import ends_text
from vehiclemor.report.published import rms_numbers
from vehiclemor.report.shown import tabled_outputs
from vehiclemor.simulation.trajectory import ALGEBRAIC_COUNTS, DYNAMIC_COUNTS
from vehiclemor.study.run import run_studies

# Of a remark, see study/evaluate.py.
UNTRUSTED = "not to be trusted"


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
    parts = [
        flat(dataset, outputs).assign(study=name)
        for name, dataset in datasets.items()
        if dataset.attrs["model"] == model
    ]
    table = pd.concat(parts, ignore_index=True)
    first = ["study", "label", "start"]
    return table.reindex(columns=[*first, *(c for c in table.columns if c not in first)])


def settings_table(
    study: str, outputs: Sequence[str], results: Path, jobs: int = 1
) -> pd.DataFrame:
    """Control-period POD on a vehicle with every combination of its settings, as of `flat`."""
    dataset = next(iter(run_studies(study, results, jobs).values()))
    return flat(dataset, outputs)


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


def warned_runs(dataset: xr.Dataset) -> xr.DataArray:
    """Which runs of a study aren't trusted: by the method (status), or as a protocol would judge.

    A study leaves the second to its remarks, so that errors of such runs are still shown.
    """
    return (dataset["status"] == "untrusted") | dataset["remark"].str.contains(UNTRUSTED)


def counted_ends(dataset: xr.Dataset) -> str:
    """How the runs of a study have ended; a cell that stands at several places counts once."""
    status = dataset["status"]
    # A protocol's runs have no remarks and no cells of their own.
    warned = (status == "ok") & (warned_runs(dataset) if "remark" in dataset else False)
    once: Any = slice(None)
    if "cell_key" in dataset:
        once = np.unique(dataset["cell_key"].values.astype(str), return_index=True)[1]
    ends, doubted, trained = (
        found.transpose(*status.dims).values.ravel()[once]
        for found in (status, warned, trained_runs(dataset))
    )
    told = f"; {trained.sum()} trained on the tested run" if trained.any() else ""
    return ends_text(ends.tolist(), int(doubted.sum())) + told


def flat(dataset: xr.Dataset, outputs: Sequence[str]) -> pd.DataFrame:
    """One row for each cell of a study: its place in the grid, errors, counts, status."""
    grid = list(dataset["status"].dims)
    kept = ["effective_rank", *(DYNAMIC_COUNTS | ALGEBRAIC_COUNTS), "growth_rate", "in_training"]
    scalars = [name for name in kept if name in dataset]
    table = dataset[[*scalars, "status", "message"]].to_dataframe().reset_index()
    for output in outputs:
        for name, short in (("rms_error", "rms"), ("floor_rms_error", "floor")):
            values = dataset[name].sel(output=output).transpose(*grid)
            table[f"{short}_{output}"] = values.to_series().to_numpy()
    columns = [*grid, *(c for c in table.columns if c.startswith(("rms_", "floor_"))), *scalars]
    return table.reindex(columns=[*columns, "status", "message"])
