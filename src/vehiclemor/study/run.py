"""Running studies, and how far they are: what is missing is computed, stored at once, combined."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable
from contextlib import nullcontext
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import xarray as xr

from vehiclemor.arguments import MOST_JOBS, count
from vehiclemor.exceptions import FileError, InputError
from vehiclemor.progress import announced, tell
from vehiclemor.simulation.trajectory import FINISHED
from vehiclemor.study.plans.grid import Grid, expand
from vehiclemor.study.plans.loading import content_hash, studies_and_files
from vehiclemor.study.plans.protocol import Protocol, load_protocol
from vehiclemor.study.plans.protocol_run import run_protocol
from vehiclemor.study.plans.results import combined, grid_digest
from vehiclemor.study.plans.size import run_size
from vehiclemor.study.plans.study_file import MOST_SEED, StudyFile
from vehiclemor.study.store import combined_path, read_run, result_path, run_path, stored
from vehiclemor.study.workers import Workers, cluster

# Grids of so many points are announced before they are expanded.
LARGE = 10_000
LATER = "then the chosen ones are tested"
# What differs from run to run of one reason.
NUMBER = re.compile(r"-?\d[\d.e+-]*")


def run_studies(
    study: str, folder: Path, jobs: int = 1, scheduler: str = "", seed: int | None = None
) -> dict[str, xr.Dataset]:
    """Run a study, or all studies of a collection: name -> combined dataset, stored too.

    Runs that the results `folder` holds already are not computed again.  The arguments are those of
    `vehiclemor.run_study`; the file of a dataset is `combined_path`.
    """
    count("jobs", jobs, most=MOST_JOBS)
    if jobs > 1 and scheduler:
        raise InputError("jobs: a scheduler has its own workers")
    plans = _plans(study, seed)
    results: dict[str, xr.Dataset] = {}
    with cluster(scheduler) if scheduler else nullcontext() as elsewhere:
        for plan in plans:
            if isinstance(plan, Protocol):
                results[plan.study] = run_protocol(plan, folder, jobs, elsewhere)
                continue
            if isinstance(plan, tuple):
                results[plan[0]] = run_size(*plan, folder)
                continue
            keys = list(plan.experiments)
            workers = Workers(plan.name, folder, jobs, elsewhere)
            results[plan.name] = stored(
                combined_path(folder, plan.name),
                "cells",
                grid_digest(plan),
                partial(_combined, plan, workers),
                partial(map, partial(run_path, folder), keys),
                content_hash(plan.definition),
            )
            tell(plan.name, len(keys), len(keys))
    return results


def _plans(study: str, seed: int | None) -> list[Grid | Protocol | tuple[str, StudyFile]]:
    """Grids, protocols and size studies of a study or collection, all names resolved."""
    if seed is not None:
        count("seed", seed, least=0, most=MOST_SEED)
    files = studies_and_files(study)
    if seed is not None and not any(definition.drawn for _, definition in files.values()):
        raise InputError(f"seed: {study} samples no test runs")
    plans: list[Grid | Protocol | tuple[str, StudyFile]] = []
    for name, (path, definition) in files.items():
        if definition.size:
            plans.append((name, definition))
        elif definition.bounds:
            plans.append(load_protocol(str(path), seed if definition.drawn else None, name))
        else:
            large = definition.points >= LARGE
            text = f"{name}: checking {definition.points} grid points"
            with announced(text) if large else nullcontext():
                plans.append(expand(name, definition))
    return plans


def _combined(grid: Grid, workers: Workers) -> xr.Dataset:
    workers([[experiment] for experiment in grid.experiments.values()])
    return combined(grid, workers.folder)


@dataclass
class StudyStatus:
    """How far a study is.

    Of its `runs` so many are `done`; a failure of the equations is one of them.  `ends` counts
    (status, message) of the finished ones and of bugs, which are tried again; messages that differ
    in numbers are one.  `result` is the file of the combined dataset, if there is one, and `later`
    what a protocol does after these runs, which depends on how they end.
    """

    runs: int
    done: int = 0
    ends: Counter[tuple[str, str]] = field(default_factory=Counter)
    result: Path | None = None
    later: str = ""

    @property
    def to_do(self) -> int:
        """Runs that the next call computes."""
        return self.runs - self.done

    @property
    def failed(self) -> Counter[tuple[str, str]]:
        """(status, message) -> runs that have failed."""
        return Counter({end: n for end, n in self.ends.items() if end[0] not in FINISHED})


def status_of(study: str, folder: Path, seed: int | None = None) -> dict[str, StudyStatus]:
    """How far a study, or every one of a collection, is, by name; nothing is computed.

    Of a protocol, whose later runs follow from the first, it is that of its validation.
    """
    if folder.exists() and not folder.is_dir():
        raise FileError(f"{folder}: not a folder")
    found: dict[str, StudyStatus] = {}
    for plan in _plans(study, seed):
        if isinstance(plan, tuple):
            name, definition = plan
            result = result_path(folder, name, content_hash(definition))
            found[name] = StudyStatus(1, done=int(result is not None), result=result)
            continue
        if isinstance(plan, Protocol):
            validation, name, later = plan.sets["validation"], plan.study, LATER
            groups = [entry.experiments(plan.model, validation) for entry in plan.entries]
            keys = {experiment.key for group in groups for experiment in group}
        else:
            name, later, keys = plan.name, "", plan.experiments.keys()
        result = result_path(folder, name, content_hash(plan.definition))
        found[name] = _status(keys, folder, StudyStatus(len(keys), result=result, later=later))
    return found


def _status(keys: Iterable[str], folder: Path, status: StudyStatus) -> StudyStatus:
    examples: dict[tuple[str, str], tuple[str, str]] = {}
    for key in keys:
        try:
            run = read_run(folder, key)
        except FileError:
            # Missing, or quarantined by the next call.
            continue
        for (name, message), runs in run.ends.items():
            alike = name, NUMBER.sub("#", message)
            status.ends[examples.setdefault(alike, (name, message))] += runs
        status.done += not run.broken
    return status
