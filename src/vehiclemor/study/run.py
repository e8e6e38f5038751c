"""Running studies, and how far they are: what is missing is computed, stored at once, combined."""

from __future__ import annotations

import re
from collections import Counter
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path

import xarray as xr

from vehiclemor.arguments import MOST_JOBS, count
from vehiclemor.exceptions import FileError, InputError
from vehiclemor.progress import tell
from vehiclemor.simulation.trajectory import FINISHED
from vehiclemor.study.plans.grid import Grid, expand
from vehiclemor.study.plans.loading import content_hash, studies_and_files
from vehiclemor.study.plans.protocol import Protocol, load_protocol
from vehiclemor.study.plans.protocol_run import run_protocol, validation_runs
from vehiclemor.study.plans.results import combined, stored_study
from vehiclemor.study.plans.study_file import MOST_SEED, GridFile
from vehiclemor.study.store import read_run, result_path
from vehiclemor.study.workers import Workers, cluster

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
        for name, plan in plans.items():
            workers = Workers(name, folder, jobs, elsewhere)
            of_grid = isinstance(plan, Grid)
            results[name] = run_grid(plan, workers) if of_grid else run_protocol(plan, workers)
    return results


def _plans(study: str, seed: int | None) -> dict[str, Grid | Protocol]:
    """What a study, or every study of a collection, runs, by the name of its results."""
    files = studies_and_files(study)
    if seed is not None:
        count("seed", seed, least=0, most=MOST_SEED)
        if not any(getattr(definition, "drawn", None) for _, definition in files.values()):
            raise InputError(f"seed: {study} samples no test runs")
    plans: dict[str, Grid | Protocol] = {}
    for name, (path, definition) in files.items():
        if isinstance(definition, GridFile):
            plans[name] = expand(name, definition, path.parent)
        else:
            protocol = load_protocol(str(path), seed if definition.drawn else None, name)
            plans[protocol.study] = protocol
    return plans


def run_grid(grid: Grid, workers: Workers) -> xr.Dataset:
    """Run a grid; what an earlier run has finished is not computed again."""

    def run_and_combine() -> xr.Dataset:
        workers([[experiment] for experiment in grid.experiments.values()])
        return combined(grid, workers.folder)

    keys = grid.keys.ravel().tolist()
    dataset = stored_study(workers, grid.definition, keys, run_and_combine)
    tell(grid.name, len(grid.experiments), len(grid.experiments))
    return dataset


@dataclass
class StudyStatus:
    """How far a study is.

    Of its `runs` so many are `done`; a failure of the equations is one of them.  `ends` counts
    (status, message) of the finished ones and of bugs, which are tried again; messages that differ
    in numbers are one.  Of those that are ok so many are `warned`: not to be trusted.  `result` is
    the file of the combined dataset, if there is one, and `later` what a protocol does after these
    runs, which depends on how they end.
    """

    runs: int
    done: int = 0
    ends: Counter[tuple[str, str]] = field(default_factory=Counter)
    warned: int = 0
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
    return {name: _status(name, plan, folder) for name, plan in _plans(study, seed).items()}


def _status(name: str, plan: Grid | Protocol, folder: Path) -> StudyStatus:
    result = result_path(folder, name, content_hash(plan.definition))
    if isinstance(plan, Grid):
        keys, later = plan.experiments.keys(), ""
    else:
        groups = validation_runs(plan)
        keys, later = {run.key for group in groups for run in group}, LATER
    status = StudyStatus(len(keys), result=result, later=later)
    examples: dict[tuple[str, str], tuple[str, str]] = {}
    for key in keys:
        try:
            run = read_run(folder, key)
        except FileError:
            # Missing, or quarantined by the next call.
            continue
        for (end, message), runs in run.ends.items():
            alike = end, NUMBER.sub("#", message)
            status.ends[examples.setdefault(alike, (end, message))] += runs
        status.done += not run.broken
        status.warned += run.warned
    return status
