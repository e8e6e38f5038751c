"""Running a protocol: fit, validate, choose; only then test.

The stages are functions of what they may see: `validate` gets no scenario of the test set.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import FINISHED
from vehiclemor.study import timing
from vehiclemor.study.plans.choice import Row, choose, validation_of
from vehiclemor.study.plans.protocol import FULL_ORDER, Contestant, Protocol
from vehiclemor.study.plans.protocol_file import ProtocolFile
from vehiclemor.study.plans.protocol_results import protocol_dataset
from vehiclemor.study.plans.study_file import file_as_stored
from vehiclemor.study.provenance import layout_digest
from vehiclemor.study.scenario import Scenario
from vehiclemor.study.store import result_path, stored
from vehiclemor.study.workers import Workers

if TYPE_CHECKING:
    import xarray as xr


def run_protocol(protocol: Protocol, folder: Path, jobs: int = 1) -> xr.Dataset:
    """Run a protocol; what an earlier run has finished is not computed again.

    Returns
    -------
    xarray.Dataset
        On the dimensions `row`, `scenario` and `output`, stored as
        `studies/predictive-<protocol>.nc` too.
    """
    workers = Workers(protocol.study, folder, jobs)
    rows = validate(
        protocol.model,
        protocol.definition,
        protocol.contestants,
        protocol.sets["validation"],
        workers,
    )
    tested = {key: protocol.sets[key] for key in ("test", "outside") if protocol.sets[key]}
    found = test(protocol.model, rows, tested, workers)
    timed = timed_rows(protocol, rows, found, folder)
    studies, keys = folder / "studies", sorted(workers.asked)
    parts = [layout_digest(), protocol.definition.model_dump_json(), *keys]
    return stored(
        studies / f"{protocol.study}.nc",
        "cells",
        hashlib.sha256("\n".join(parts).encode()).hexdigest()[:20],
        lambda: protocol_dataset(protocol, rows, found, timed),
        [studies / f"timing-{protocol.study}.nc", *(result_path(folder, key) for key in keys)],
        file_as_stored(protocol.path, folder),
    )


def validate(
    model: Model,
    definition: ProtocolFile,
    contestants: Sequence[Contestant],
    validation: tuple[Scenario, ...],
    workers: Workers,
) -> list[Row]:
    """Fit every candidate on its training, simulate the validation set, choose.

    Of a full-order contestant every candidate becomes a row.
    """
    experiments = [
        [c.experiment(model, i, validation) for i in range(len(c.candidates))] for c in contestants
    ]
    workers([[experiment] for candidates in experiments for experiment in candidates])
    rows: list[Row] = []
    for contestant, candidates in zip(contestants, experiments, strict=True):
        results = tuple(
            validation_of(workers.result(experiment), definition.bounds, model.evaluations)
            for experiment in candidates
        )
        every = contestant.role == FULL_ORDER
        chosen = range(len(candidates)) if every else [choose(results)]
        rows += [Row(contestant, candidate, results) for candidate in chosen]
    return rows


def test(
    model: Model, rows: Sequence[Row], sets: dict[str, tuple[Scenario, ...]], workers: Workers
) -> dict[str, list[xr.Dataset]]:
    """Results of the chosen candidates: set -> one dataset for each row."""
    experiments = [
        [row.contestant.experiment(model, row.candidate, scenarios) for scenarios in sets.values()]
        for row in rows
    ]
    workers(experiments)
    return {
        name: [workers.result(group[index]) for group in experiments]
        for index, name in enumerate(sets)
    }


def timed_rows(
    protocol: Protocol, rows: Sequence[Row], tested: dict[str, list[xr.Dataset]], folder: Path
) -> xr.Dataset:
    """Stored timing of the rows on the test set, measured first if missing or out of date.

    A run whose result in the test set is a failure is not timed.
    """
    experiments = {
        row.label: row.contestant.experiment(protocol.model, row.candidate, protocol.sets["test"])
        for row in rows
    }
    finished = np.array([np.isin(found["status"].values, FINISHED) for found in tested["test"]])
    content = [[label, experiment.key] for label, experiment in experiments.items()]
    return timing.stored_timing(
        folder,
        f"timing-{protocol.study}",
        [content, timing.PROTOCOL_ROUNDS],
        lambda: timing.timed_tests(experiments, finished),
    )
