"""Timing pass: full-order and reduced runs interleaved in one process, medians.

Seconds stored with the cells of a study are measured while other cells run beside them; a speed-up
is quoted from this pass only.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from vehiclemor.maneuvers import Maneuver
from vehiclemor.metrics import rms
from vehiclemor.models.report import TimingCase
from vehiclemor.reduction.interface import Method, ReducedModel
from vehiclemor.reduction.settings import validated
from vehiclemor.reduction.training import training_runs
from vehiclemor.registry import component
from vehiclemor.simulation.model import Model
from vehiclemor.study.provenance import code_digest, machine, versions
from vehiclemor.study.store import prepare_folder, up_to_date, write_dataset

if TYPE_CHECKING:
    import xarray as xr

ROUNDS = 41
FIT_ROUNDS = 9


def stored_timing(model: Model, cases: Sequence[TimingCase], folder: Path, name: str) -> xr.Dataset:
    """Stored timing of cases from every start, measured first if it is missing or out of date.

    Parameters
    ----------
    name
        Of the file in the results folder.

    Returns
    -------
    xarray.Dataset
        On the dimensions `start` and `case`: median and quartiles of the seconds of a run,
        seconds for a time point, offline seconds, counts, errors, status.
    """
    import xarray as xr

    cases = tuple(cases)
    path = folder / "studies" / f"{name}.nc"
    digests = [code_digest(model.name, method) for method in sorted({c.method for c in cases})]
    content = [[repr(case) for case in cases], digests, model.kernel_hash, machine(), ROUNDS]
    key = hashlib.sha256(json.dumps(content).encode()).hexdigest()[:16]
    if (known := up_to_date(path, "timing", key)) is not None:
        return known
    prepare_folder(folder)
    parts = [measure(model, cases, start) for start in model.starts]
    dataset = xr.concat(parts, dim="start", join="exact", combine_attrs="override")
    dataset.attrs["timing"] = key
    write_dataset(dataset, path)
    return dataset


def measure(model: Model, cases: tuple[TimingCase, ...], start: str) -> xr.Dataset:
    """Time the cases on the model's nominal maneuver from one start."""
    import xarray as xr

    maneuver: Maneuver = component("maneuver", component("model", model.name).maneuver)
    fits: list[list[float]] = [[] for _ in cases]
    reduced: list[ReducedModel] = []
    tolerances: list[float] = []
    for index, case in enumerate(cases):
        method: Method = component("method", case.method)
        preset = method.presets(model)[case.preset]
        declared = method.settings(model.kind)
        settings = validated(case.method, declared, case.settings, preset)
        runs = training_runs(model, maneuver, start, "nominal")
        # The first fit loads machine code and is not counted.
        candidates = [method.fit(model, runs, settings) for _ in range(FIT_ROUNDS + 1)]
        fits[index] = [candidate.offline.seconds for candidate in candidates[1:]]
        reduced.append(candidates[-1])
        tolerances.append(float(settings.get("tolerance", np.nan)))
    seconds = np.empty((ROUNDS + 1, len(cases)))
    counts: list[dict[str, int]] = [{} for _ in cases]
    status = [""] * len(cases)
    errors = np.empty((len(cases), len(model.outputs)))
    reference = model.simulate(maneuver, start).outputs
    for turn in range(ROUNDS + 1):
        for index, candidate in enumerate(reduced):
            trajectory = candidate.simulate(maneuver, start)
            seconds[turn, index] = trajectory.seconds
            counts[index], status[index] = trajectory.counts, trajectory.status
            errors[index] = rms(trajectory.outputs - reference)
    seconds = seconds[1:]

    def speed_up(baseline: int) -> np.ndarray:
        # Round by round, so that a burst of other load on the machine hits both alike.
        own = np.where(seconds > 0.0, seconds, np.nan)
        return np.median(seconds[:, [baseline]] / own, axis=0)

    samples = maneuver.samples
    columns: dict[str, tuple] = {
        "seconds": (np.median(seconds, axis=0), "s", "median time of a run in the compiled loop"),
        "seconds_lower": (np.quantile(seconds, 0.25, axis=0), "s", "lower quartile"),
        "seconds_upper": (np.quantile(seconds, 0.75, axis=0), "s", "upper quartile"),
        "speed_up": (speed_up(0), "1", "against the paper's kind of baseline, median of rounds"),
        "speed_up_strongest": (speed_up(1), "1", "against the strongest full order, median"),
        "tolerance": (tolerances, "1", "tolerance of the solver"),
        "seconds_per_sample": (np.median(seconds, axis=0) / samples, "s", "for one time point"),
        "offline_seconds": ([float(np.median(f)) for f in fits], "s", "training and fit, median"),
        "offline_evaluations": (
            [candidate.offline.evaluations for candidate in reduced],
            "1",
            "evaluations of the full model's equations in training",
        ),
        "effective_rank": ([candidate.effective_rank for candidate in reduced], "1", "rank"),
    }
    for name in model.counts:
        columns[name] = ([count[name] for count in counts], "1", name.replace("_", " "))
    variables: dict[str, tuple] = {
        name: ("case", values, {"units": unit, "long_name": text})
        for name, (values, unit, text) in columns.items()
    }
    variables["rms_error"] = (
        ("case", "output"),
        errors,
        {"units": "see outputs", "long_name": "RMS error on the run that is timed"},
    )
    variables["status"] = ("case", status, {"long_name": "ok, or why there is no result"})
    coordinates = {"case": [case.id for case in cases], "output": list(model.outputs)}
    labels = ("case", [case.label for case in cases])
    dataset = xr.Dataset(variables, {**coordinates, "label": labels, "start": start})
    dataset.attrs = {
        "title": f"timing of {model.name}, interleaved, {ROUNDS} rounds, {samples} time points",
        "source": "vehiclemor",
        "model": model.name,
        "machine": machine(),
        "versions": versions(),
        "kernel_hash": model.kernel_hash,
    }
    return dataset
