"""Timing pass of a protocol: all rows over the test scenarios, round robin in one process."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from vehiclemor.simulation.model import Model
from vehiclemor.simulation.run_timer import repeated
from vehiclemor.study.choice import Row
from vehiclemor.study.executor import results_folder
from vehiclemor.study.protocol import Protocol
from vehiclemor.study.provenance import machine, versions
from vehiclemor.study.scenarios import maneuver_of, start_of
from vehiclemor.study.store import up_to_date, write_dataset
from vehiclemor.study.trial_execution import Fit, fit, fresh_fit
from vehiclemor.study.trials import Trial, make_trial

if TYPE_CHECKING:
    import xarray as xr

ROUNDS = 7
# Of each short run one after the other; the first warms the caches, as long ones do themselves.
REPEATS, LONG_RUN = 4, 2e-3
# Length (s) of a fit beside which loading machine code is nothing.
LONG_FIT = 10.0


def timing(
    protocol: Protocol,
    rows: Sequence[Row],
    tested: dict[str, list[xr.Dataset]],
    folder: Path,
) -> xr.Dataset:
    """Stored timing of the rows on the test set, measured first if missing or out of date.

    Parameters
    ----------
    tested
        Results of the rows by set; a run that has failed in the test set is not timed.

    Returns
    -------
    xarray.Dataset
        `seconds` on `row` and `scenario`: median of the rounds, missing where the run has failed;
        `offline_seconds` of a fit that found its machine code loaded, or took long.
    """
    path = results_folder(folder) / f"timing-{protocol.name}.nc"
    scenarios = protocol.sets["test"]
    model = protocol.model
    trials = [make_trial(model, r.contestant, r.candidate, "test", scenarios) for r in rows]
    labels = [row.label for row in rows]
    content = json.dumps([labels, [trial.key for trial in trials], machine(), ROUNDS, REPEATS])
    key = hashlib.sha256(content.encode()).hexdigest()[:16]
    if (known := up_to_date(path, "timing", key)) is not None:
        return known
    finished = np.array([found["status"].values == "ok" for found in tested["test"]])
    dataset = measure(model, trials, finished)
    dataset = dataset.assign_coords(row=labels)
    dataset.attrs["timing"] = key
    write_dataset(dataset, path)
    return dataset


def measure(model: Model, trials: Sequence[Trial], finished: np.ndarray) -> xr.Dataset:
    """Time the trials' candidates.

    Parameters
    ----------
    finished
        Whether a run is timed (rows, scenarios).
    """
    import xarray as xr

    fits = [_fitted(model, trial, runs.any()) for trial, runs in zip(trials, finished, strict=True)]
    runs = [(maneuver_of(s), start_of(model, s)) for s in trials[0].scenarios]
    seconds = np.full((ROUNDS + 1, *finished.shape), np.nan)
    for turn in range(ROUNDS + 1):
        for place, (maneuver, start) in enumerate(runs):
            for index, candidate in enumerate(fits):
                if finished[index, place] and candidate.reduced is not None:
                    # The first round tells how long a run takes.
                    short = turn > 0 and seconds[0, index, place] < LONG_RUN
                    with repeated(REPEATS if short else 1):
                        run = candidate.reduced.simulate(maneuver, start)
                    seconds[turn, index, place] = run.seconds
    # The first round loads machine code and warms caches.
    median = np.median(seconds[1:], axis=0)
    variables: dict[str, tuple] = {
        "seconds": (
            ("row", "scenario"),
            median,
            {"units": "s", "long_name": f"median of {ROUNDS} rounds, in the compiled loop"},
        ),
        "offline_seconds": (
            "row",
            [candidate.offline.seconds for candidate in fits],
            {"units": "s", "long_name": "training simulations and fit"},
        ),
    }
    dataset = xr.Dataset(
        variables, {"scenario": [scenario.label for scenario in trials[0].scenarios]}
    )
    dataset.attrs = {
        "title": f"timing of {model.name}, test set, interleaved, {ROUNDS} rounds",
        "source": "vehiclemor",
        "model": model.name,
        "machine": machine(),
        "versions": versions(),
    }
    return dataset


def _fitted(model: Model, trial: Trial, needed: bool) -> Fit:
    """A fit that finds its machine code loaded, which counts where a fit is short."""
    fitted = fit(model, trial)
    if not needed or fitted.reduced is None or fitted.offline.seconds > LONG_FIT:
        return fitted
    return fresh_fit(model, trial.method, trial.settings, trial.training)
