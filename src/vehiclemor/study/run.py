"""Running studies, and how far they are: what is missing is computed, stored at once, combined."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Collection
from contextlib import nullcontext
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import xarray as xr

from vehiclemor.arguments import MOST_JOBS, count
from vehiclemor.exceptions import FileError, InputError
from vehiclemor.progress import tell
from vehiclemor.simulation.trajectory import FINISHED
from vehiclemor.study.plans.grid import Grid, expand
from vehiclemor.study.plans.loading import content_hash, studies_and_files
from vehiclemor.study.plans.protocol import load_protocol
from vehiclemor.study.plans.protocol_run import run_protocol, validation_keys
from vehiclemor.study.plans.results import combined, grid_digest
from vehiclemor.study.plans.study_file import MOST_SEED, ProtocolFile, StudyFile
from vehiclemor.study.store import combined_path, read_run, result_path, run_path, stored
from vehiclemor.study.workers import Engine, Workers, cluster

LATER = "then the chosen ones are tested"
# What differs from run to run of one reason.
NUMBER = re.compile(r"-?\d[\d.e+-]*")


@dataclass(frozen=True)
class Plan:
    """What a study runs, all names resolved.

    `run` takes the results folder, a number of jobs, and what runs them elsewhere; `keys` gives the
    keys of the runs that come first, after which a protocol does what `later` says.
    """

    name: str
    definition: StudyFile
    run: Callable[[Path, int, Engine | None], xr.Dataset]
    keys: Callable[[], Collection[str]]
    later: str = ""


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
    with cluster(scheduler) if scheduler else nullcontext() as elsewhere:
        return {plan.name: plan.run(folder, jobs, elsewhere) for plan in plans}


def _plans(study: str, seed: int | None) -> list[Plan]:
    """Plan of a study, or of every study of a collection."""
    if seed is not None:
        count("seed", seed, least=0, most=MOST_SEED)
    files = studies_and_files(study)
    if seed is not None and not any(_samples(definition) for _, definition in files.values()):
        raise InputError(f"seed: {study} samples no test runs")
    return [_plan(name, path, definition, seed) for name, (path, definition) in files.items()]


def _samples(definition: StudyFile) -> bool:
    return isinstance(definition, ProtocolFile) and definition.drawn is not None


def _plan(name: str, path: Path, definition: StudyFile, seed: int | None) -> Plan:
    if isinstance(definition, ProtocolFile):
        own_seed = seed if definition.drawn else None
        protocol = load_protocol(str(path), own_seed, name)
        keys = partial(validation_keys, protocol)
        return Plan(protocol.study, definition, partial(run_protocol, protocol), keys, LATER)
    grid = expand(name, definition, path.parent)
    return Plan(name, definition, partial(run_grid, grid), grid.experiments.keys)


def run_grid(
    grid: Grid, folder: Path, jobs: int = 1, elsewhere: Engine | None = None
) -> xr.Dataset:
    """Run a grid; what an earlier run has finished is not computed again."""
    keys = grid.experiments.keys()
    workers = Workers(grid.name, folder, jobs, elsewhere)

    def run_and_combine() -> xr.Dataset:
        workers([[experiment] for experiment in grid.experiments.values()])
        return combined(grid, folder)

    dataset = stored(
        combined_path(folder, grid.name),
        "cells",
        grid_digest(grid),
        run_and_combine,
        lambda: (run_path(folder, key) for key in keys),
        content_hash(grid.definition),
    )
    tell(grid.name, len(keys), len(keys))
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
    return {plan.name: _status(plan, folder) for plan in _plans(study, seed)}


def _status(plan: Plan, folder: Path) -> StudyStatus:
    result = result_path(folder, plan.name, content_hash(plan.definition))
    keys = plan.keys()
    status = StudyStatus(len(keys), result=result, later=plan.later)
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
        status.warned += run.warned
    return status
