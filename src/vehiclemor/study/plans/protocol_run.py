"""Running a protocol: fit, validate, choose, test."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import xarray as xr

from vehiclemor.exceptions import FileError
from vehiclemor.simulation.trajectory import FINISHED
from vehiclemor.study import timing
from vehiclemor.study.experiment import Experiment, complete_settings, make_experiment
from vehiclemor.study.plans.choice import (
    MARGIN_OF_CHOSEN,
    TIE_OF_TIMES,
    Row,
    choose,
    reasons,
    validation_of,
)
from vehiclemor.study.plans.protocol import CONTENDER, FULL_ORDER, Protocol, Scenarios, sampled_sets
from vehiclemor.study.plans.results import judged_set, protocol_dataset, stored_study
from vehiclemor.study.store import combined_path
from vehiclemor.study.workers import Workers


def run_protocol(protocol: Protocol, workers: Workers) -> xr.Dataset:
    """Run a protocol; what an earlier run has finished is not computed again."""
    sets = {key: protocol.sets[key] for key in ("test", "outside") if protocol.sets[key]}
    sets |= sampled_sets(protocol)
    path = combined_path(workers.folder, protocol.study)
    rows = with_winner(protocol, validate(protocol, workers), path)
    experiments: list[list[Experiment]] = []
    for row in rows:
        test = partial(row.entry.experiment, protocol.model, row.candidate)
        experiments.append([test(scenarios) for scenarios in sets.values()])
    workers(experiments)
    results: dict[str, list[xr.Dataset]] = {}
    for number, name in enumerate(sets):
        results[name] = [workers.result(of_row[number]) for of_row in experiments]
    screened = [name for name in protocol.screened if name in sets]
    seconds = {name: second_runs(protocol, sets[name]) for name in screened}
    workers([[experiment] for experiment in seconds.values()])
    apart = {name: reasons(protocol, workers.result(e)) for name, e in seconds.items()}
    judged = judged_set(sets)
    if judged in apart and all(apart[judged]):
        raise FileError(
            f"{protocol.path}: no run can be judged, the first because {apart[judged][0]}"
        )
    # A run whose result in the test set is a failure is not timed.
    ends = np.array([row["status"].values for row in results[judged]])
    timed = _timed(protocol, rows, sets[judged], np.isin(ends, FINISHED), path)
    combine = partial(protocol_dataset, protocol, rows, sets, results, timed, apart)
    times = str(timed["seconds"].values.tolist())
    return stored_study(workers, protocol.definition, sorted(workers.asked), combine, times)


def second_runs(protocol: Protocol, scenarios: Scenarios) -> Experiment:
    """The full order by another integrator than that of the references, see `reasons`."""
    model = protocol.model
    preset = "recommended" if model.kind == "ae" else "paper"
    settings = complete_settings(model, "full_order", preset=preset)
    # With the training, of which it learns nothing, it may be a row of the protocol too.
    training = protocol.sets["training"]
    return make_experiment(model, "full_order", settings, training, scenarios, "errors")


def validation_runs(protocol: Protocol) -> list[list[Experiment]]:
    """Candidates of every entry on the validation set; the choice needs them before any test."""
    model, scenarios = protocol.model, protocol.sets["validation"]
    return [entry.experiments(model, scenarios) for entry in protocol.entries]


def validate(protocol: Protocol, workers: Workers) -> list[Row]:
    """Fit every candidate on its training, simulate the validation set, choose.

    Of a full-order method every candidate becomes a row.
    """
    model, bounds = protocol.model, protocol.definition.bounds
    experiments = validation_runs(protocol)
    # Most candidates of an entry share a fit.
    workers(experiments)
    rows: list[Row] = []
    for entry, candidates in zip(protocol.entries, experiments, strict=True):
        datasets = map(workers.result, candidates)
        results = tuple(validation_of(data, bounds, model.evaluations) for data in datasets)
        every = entry.role == FULL_ORDER
        chosen = range(len(candidates)) if every else [choose(results)]
        rows += [Row(entry, candidate, results) for candidate in chosen]
    return rows


def with_winner(protocol: Protocol, rows: Sequence[Row], path: Path) -> list[Row]:
    """The rows, one of them marked as chosen among the contenders, by validation alone.

    Of those that leave room to the bounds (`choice.MARGIN_OF_CHOSEN`) the one whose calls take
    the least time, by our clock, on the validation set, of times that are nearly the same
    (`choice.TIE_OF_TIMES`) the more accurate; if there is none, the one of the smallest score.
    """
    racing = [row for row in rows if row.entry.role == CONTENDER]
    # What gives no run at all is not chosen.
    if not any(row.result.stable for row in racing):
        return list(rows)
    best = min(racing, key=lambda row: (-row.result.stable, row.result.score))
    fitting = [
        row for row in racing if row.result.score <= MARGIN_OF_CHOSEN and row.result.stable == 1.0
    ]
    if len(fitting) > 1:
        validation = protocol.sets["validation"]
        every = np.ones((len(fitting), len(validation)), dtype=bool)
        timed = _timed(protocol, fitting, validation, every, path, "validation-")
        seconds = timed["seconds"].mean("scenario").values
        near = np.flatnonzero(seconds <= (1.0 + TIE_OF_TIMES) * seconds.min())
        best = min((fitting[k] for k in near), key=lambda row: row.result.score)
    return [replace(row, winner=row is best) for row in rows]


def _timed(
    protocol: Protocol,
    rows: Sequence[Row],
    scenarios: Scenarios,
    finished: np.ndarray,
    path: Path,
    name: str = "",
) -> xr.Dataset:
    """Stored timing of the finished runs (rows, scenarios), measured first if one is missing.

    Of a large set it is that of the runs that the protocol times.
    """
    sample = protocol.timed_runs(len(scenarios))
    tests = tuple(scenarios[run] for run in sample)
    experiments: dict[str, Experiment] = {}
    for row in rows:
        experiments[row.label] = row.entry.experiment(protocol.model, row.candidate, tests)
    keys = [[label, experiment.key] for label, experiment in experiments.items()]
    what = f"{name}runs of {protocol.study}"
    measure = partial(timing.timed_tests, experiments, finished[:, sample], what)
    return timing.stored_timing(path.with_name(f"timing-{name}{path.name}"), keys, measure)
