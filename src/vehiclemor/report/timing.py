"""Timing pass: full-order and reduced runs interleaved in one process, medians.

Seconds stored with the cells of a study are measured while other cells run beside them; a speed-up
is quoted from this pass only.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from vehiclemor.maneuvers import Maneuver
from vehiclemor.metrics import rms
from vehiclemor.reduction.interface import Method, ReducedModel
from vehiclemor.reduction.training import training_runs
from vehiclemor.reduction.validation import validated
from vehiclemor.registry import component
from vehiclemor.report.contestants import RACES, Contestant
from vehiclemor.simulation.build import build
from vehiclemor.simulation.model import Model
from vehiclemor.study.provenance import code_digest, machine, versions
from vehiclemor.study.store import prepare_folder, up_to_date, write_dataset

if TYPE_CHECKING:
    import xarray as xr

ROUNDS = 41
FIT_ROUNDS = 9


def timing(model_name: str, folder: Path) -> xr.Dataset:
    """Stored timing of a model's contestants, measured first if it is missing or out of date.

    Returns
    -------
    xarray.Dataset
        On the dimensions `start` and `contestant`: median and quartiles of the seconds of a run,
        seconds for a time point, offline seconds, counts, errors, status.
    """
    import xarray as xr

    model = build(model_name)
    path = folder / "studies" / f"timing-{model_name}.nc"
    key = _identity(model)
    if (known := up_to_date(path, "timing", key)) is not None:
        return known
    prepare_folder(folder)
    contestants = RACES[model_name].contestants
    parts = [measure(model, contestants, start) for start in model.starts]
    dataset = xr.concat(parts, dim="start", join="exact", combine_attrs="override")
    dataset.attrs["timing"] = key
    write_dataset(dataset, path)
    return dataset


def _identity(model: Model) -> str:
    race = RACES[model.name].contestants
    contestants = [repr(contestant) for contestant in race]
    digests = [code_digest(model.name, contestant.method) for contestant in race]
    content = json.dumps([contestants, digests, model.kernel_hash, machine(), ROUNDS])
    return hashlib.sha256(content.encode()).hexdigest()[:16]


def measure(model: Model, contestants: tuple[Contestant, ...], start: str) -> xr.Dataset:
    """Time the contestants on the model's nominal maneuver from one start."""
    import xarray as xr

    maneuver: Maneuver = component("maneuver", component("model", model.name).maneuver)
    fits: list[list[float]] = [[] for _ in contestants]
    reduced: list[ReducedModel] = []
    tolerances: list[float] = []
    for index, contestant in enumerate(contestants):
        method: Method = component("method", contestant.method)
        settings = validated(method, model.kind, contestant.settings, contestant.preset)
        runs = training_runs(model, maneuver, start, "nominal")
        # The first fit loads machine code and is not counted.
        candidates = [method.fit(model, runs, settings) for _ in range(FIT_ROUNDS + 1)]
        fits[index] = [candidate.offline.seconds for candidate in candidates[1:]]
        reduced.append(candidates[-1])
        tolerances.append(float(settings.model_dump().get("tolerance", np.nan)))
    seconds = np.empty((ROUNDS + 1, len(contestants)))
    counts: list[dict[str, int]] = [{} for _ in contestants]
    status = [""] * len(contestants)
    errors = np.empty((len(contestants), len(model.outputs)))
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
        name: ("contestant", values, {"units": unit, "long_name": text})
        for name, (values, unit, text) in columns.items()
    }
    variables["rms_error"] = (
        ("contestant", "output"),
        errors,
        {"units": "see outputs", "long_name": "RMS error on the run that is timed"},
    )
    variables["status"] = ("contestant", status, {"long_name": "ok, or why there is no result"})
    labels = [contestant.label for contestant in contestants]
    dataset = xr.Dataset(
        variables, {"contestant": labels, "output": list(model.outputs), "start": start}
    )
    dataset.attrs = {
        "title": f"timing of {model.name}, interleaved, {ROUNDS} rounds, {samples} time points",
        "source": "vehiclemor",
        "model": model.name,
        "machine": machine(),
        "versions": versions(),
        "kernel_hash": model.kernel_hash,
    }
    return dataset
