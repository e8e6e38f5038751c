"""Running a protocol: fit, validate, choose, test.

The stages are functions of what they may see: `validate` gets no scenario of the test set.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from vehiclemor.errors import FileError, InputError
from vehiclemor.provenance import layout_digest
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import FINISHED
from vehiclemor.study import timing
from vehiclemor.study.plans.choice import (
    MARGIN_OF_CHOSEN,
    TIE_OF_TIMES,
    Row,
    choose,
    reasons,
    second_run,
    validation_of,
)
from vehiclemor.study.plans.loading import content_hash
from vehiclemor.study.plans.protocol import (
    CONTENDER,
    FULL_ORDER,
    Entry,
    Protocol,
    Scenarios,
    drawn_sets,
)
from vehiclemor.study.plans.results import judged_set, protocol_dataset
from vehiclemor.study.plans.study_file import DRAWN, StudyFile
from vehiclemor.study.store import cell_path, combined_path, stored
from vehiclemor.study.workers import Engine, Workers

if TYPE_CHECKING:
    import xarray as xr

# Runs that are timed: the first of a set.
TIMED = 24


def run_protocol(
    protocol: Protocol, folder: Path, jobs: int = 1, elsewhere: Engine | None = None
) -> xr.Dataset:
    """Run a protocol; what an earlier run has finished is not computed again.

    Returns
    -------
    xarray.Dataset
        On the dimensions `label`, `scenario` and `output`, stored as `studies/NAME.nc` too.
    """
    workers = Workers(protocol.study, folder, jobs, elsewhere)
    sets = {key: protocol.sets[key] for key in ("test", "outside") if protocol.sets[key]}
    try:
        sets |= drawn_sets(protocol)
    except InputError as error:
        raise FileError(f"{protocol.path}: {error}") from None
    path, model = combined_path(folder, protocol.study), protocol.model
    validation = protocol.sets["validation"]
    rows = validate(model, protocol.definition, protocol.entries, validation, workers)
    rows = with_winner(protocol, rows, path)
    found = test(model, rows, sets, workers)
    apart = _sensitive(protocol, sets, workers)
    if "drawn" in sets and all(apart["drawn"]):
        raise FileError(
            f"{protocol.path}: no drawn run can be judged, the first because {apart['drawn'][0]}"
        )
    timed = timed_rows(protocol, rows, found, sets, path)
    keys = sorted(workers.asked)
    parts = [layout_digest(), protocol.definition.model_dump_json(), timed.attrs["timing"], *keys]
    return stored(
        path,
        "cells",
        hashlib.sha256("\n".join(parts).encode()).hexdigest()[:20],
        lambda: protocol_dataset(protocol, rows, found, timed, apart),
        lambda: (cell_path(folder, key) for key in keys),
        content_hash(protocol.definition),
    )


def validate(
    model: Model,
    definition: StudyFile,
    entries: Sequence[Entry],
    validation: Scenarios,
    workers: Workers,
) -> list[Row]:
    """Fit every candidate on its training, simulate the validation set, choose.

    Of a full-order method every candidate becomes a row.
    """
    experiments = [entry.experiments(model, validation) for entry in entries]
    # Most candidates of an entry share a fit.
    workers(experiments)
    rows: list[Row] = []
    for entry, candidates in zip(entries, experiments, strict=True):
        found = map(workers.result, candidates)
        results = tuple(validation_of(f, definition.bounds, model.evaluations) for f in found)
        every = entry.role == FULL_ORDER
        chosen = range(len(candidates)) if every else [choose(results)]
        rows += [Row(entry, candidate, results) for candidate in chosen]
    return rows


def test(
    model: Model, rows: Sequence[Row], sets: dict[str, Scenarios], workers: Workers
) -> dict[str, list[xr.Dataset]]:
    """Results of the chosen candidates: set -> one dataset for each row."""
    experiments = [
        [row.entry.experiment(model, row.candidate, scenarios) for scenarios in sets.values()]
        for row in rows
    ]
    workers(experiments)
    results = [[workers.result(experiment) for experiment in group] for group in experiments]
    return dict(zip(sets, map(list, zip(*results, strict=True)), strict=True))


def with_winner(protocol: Protocol, rows: Sequence[Row], path: Path) -> list[Row]:
    """The rows, one of them marked as chosen among the contenders, by validation alone.

    Of those that leave room to the bounds (`choice.MARGIN_OF_CHOSEN`) the one whose whole calls
    take the least time, by our clock, on the first scenarios of the validation set, of times that
    are nearly the same (`choice.TIE_OF_TIMES`) the more accurate; if there is none, the one of the
    smallest score.

    Parameters
    ----------
    path
        Of the combined dataset.
    """
    racing = [i for i, row in enumerate(rows) if row.entry.role == CONTENDER]
    results = {i: rows[i].validation[rows[i].candidate] for i in racing}
    # What gives no run at all is not chosen.
    if not any(result.stable for result in results.values()):
        return list(rows)
    best = min(racing, key=lambda i: (-results[i].stable, results[i].score))
    within = [i for i in racing if results[i].score <= MARGIN_OF_CHOSEN]
    fitting = [i for i in within if results[i].stable == 1.0]
    if len(fitting) > 1:
        sample = protocol.sets["validation"][:TIMED]
        every = np.ones((len(fitting), len(sample)), dtype=bool)
        what = f"validation set of {protocol.study}"
        place = path.with_name(f"timing-validation-{path.name}")
        timed = _timed(protocol, [rows[i] for i in fitting], (sample, every), place, what)
        seconds = timed["seconds"].mean("scenario").values
        near = np.flatnonzero(seconds <= (1.0 + TIE_OF_TIMES) * seconds.min())
        best = min((fitting[k] for k in near), key=lambda i: results[i].score)
    elif fitting:
        best = fitting[0]
    return [replace(row, winner=index == best) for index, row in enumerate(rows)]


def timed_rows(
    protocol: Protocol,
    rows: Sequence[Row],
    tested: dict[str, list[xr.Dataset]],
    sets: dict[str, Scenarios],
    path: Path,
) -> xr.Dataset:
    """Stored timing of the rows on the first test runs, measured first if missing or out of date.

    A run whose result in the test set is a failure is not timed.  `path` is of the combined
    dataset.
    """
    name = judged_set(sets)
    sample = sets[name][:TIMED]
    ends = [found["status"].values[: len(sample)] for found in tested[name]]
    finished, what = np.isin(np.array(ends), FINISHED), f"test set of {protocol.study}"
    place = path.with_name(f"timing-{path.name}")
    return _timed(protocol, rows, (sample, finished), place, what)


def _timed(
    protocol: Protocol,
    rows: Sequence[Row],
    wanted: tuple[Scenarios, np.ndarray],
    path: Path,
    what: str,
) -> xr.Dataset:
    """Stored timing of rows on some scenarios, those of each row that are wanted."""
    sample, finished = wanted
    experiments = {
        row.label: row.entry.experiment(protocol.model, row.candidate, sample) for row in rows
    }
    content = [[label, experiment.key] for label, experiment in experiments.items()]
    return timing.stored_timing(
        path,
        [content, timing.PROTOCOL_ROUNDS],
        lambda: timing.timed_tests(experiments, finished, what=what),
    )


def _sensitive(
    protocol: Protocol, sets: dict[str, Scenarios], workers: Workers
) -> dict[str, list[str]]:
    """Why drawn runs are reported apart, by set."""
    second = {n: second_run(protocol, sets[n]) for n in DRAWN if n in sets}
    workers([[experiment] for experiment in second.values()])
    return {name: reasons(protocol, workers.result(e)) for name, e in second.items()}
