"""Running studies, and how far they are: what is missing is computed, stored at once, combined."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable
from contextlib import nullcontext
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import NamedTuple

import xarray as xr

from vehiclemor.arguments import MOST_JOBS, count
from vehiclemor.exceptions import FileError, InputError
from vehiclemor.progress import tell, telling
from vehiclemor.simulation.trajectory import FINISHED
from vehiclemor.study.plans.grid import Grid, expand
from vehiclemor.study.plans.loading import content_hash, studies_and_files
from vehiclemor.study.plans.protocol import Protocol, load_protocol
from vehiclemor.study.plans.protocol_run import run_protocol
from vehiclemor.study.plans.results import combined, grid_digest
from vehiclemor.study.plans.size import run_size
from vehiclemor.study.plans.study_file import MOST_SEED, StudyFile
from vehiclemor.study.store import combined_path, read_run, result_path, run_path, stored
from vehiclemor.study.workers import Engine, Workers, cluster

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
    with cluster(scheduler) if scheduler else nullcontext() as elsewhere:
        return {plan.study: plan.run(folder, jobs, elsewhere) for plan in plans}


class Plan(NamedTuple):
    """A study with all names resolved: how it is run, and which runs are known before that.

    `later` says what follows from these, of a protocol from its validation.
    """

    study: str
    definition: StudyFile
    run: Callable[[Path, int, Engine | None], xr.Dataset]
    keys: Callable[[], Collection[str]]
    later: str = ""


def _plans(study: str, seed: int | None) -> list[Plan]:
    """All members of a study or collection."""
    if seed is not None:
        count("seed", seed, least=0, most=MOST_SEED)
    files = studies_and_files(study)
    if seed is not None and not any(definition.drawn for _, definition in files.values()):
        raise InputError(f"seed: {study} samples no test runs")
    return [_plan(name, *found, seed) for name, found in files.items()]


def _plan(name: str, path: Path, definition: StudyFile, seed: int | None) -> Plan:
    if definition.size:
        return Plan(name, definition, lambda folder, *_: run_size(name, definition, folder), tuple)
    if definition.bounds:
        protocol = load_protocol(str(path), seed if definition.drawn else None, name)
        run = partial(run_protocol, protocol)
        return Plan(protocol.study, definition, run, partial(_validation_keys, protocol), LATER)
    large = definition.points >= LARGE
    text = f"{name}: checking {definition.points} grid points"
    with telling(text) if large else nullcontext():
        grid = expand(name, definition)
    return Plan(name, definition, partial(_run_grid, grid), grid.experiments.keys)


def _validation_keys(protocol: Protocol) -> set[str]:
    validation = protocol.sets["validation"]
    groups = [entry.experiments(protocol.model, validation) for entry in protocol.entries]
    return {experiment.key for group in groups for experiment in group}


def _run_grid(grid: Grid, folder: Path, jobs: int, elsewhere: Engine | None) -> xr.Dataset:
    workers, keys = Workers(grid.name, folder, jobs, elsewhere), list(grid.experiments)

    def make() -> xr.Dataset:
        workers([[experiment] for experiment in grid.experiments.values()])
        return combined(grid, folder)

    found = stored(
        combined_path(folder, grid.name),
        "cells",
        grid_digest(grid),
        make,
        lambda: (run_path(folder, key) for key in keys),
        content_hash(grid.definition),
    )
    tell(grid.name, len(keys), len(keys))
    return found


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
        result = result_path(folder, plan.study, content_hash(plan.definition))
        if plan.definition.size:
            found[plan.study] = StudyStatus(1, done=int(result is not None), result=result)
            continue
        keys = plan.keys()
        status = StudyStatus(len(keys), result=result, later=plan.later)
        found[plan.study] = _status(keys, folder, status)
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
