"""Running studies: what is missing is computed, stored at once, and combined at the end."""

from __future__ import annotations

import logging
from contextlib import nullcontext
from functools import partial
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

from vehiclemor.arguments import MOST_JOBS, count
from vehiclemor.errors import InputError
from vehiclemor.progress import tell, telling
from vehiclemor.study.cluster import reached
from vehiclemor.study.plans.grid import Grid, expand
from vehiclemor.study.plans.loading import content_hash, studies_and_files
from vehiclemor.study.plans.protocol import load_protocol
from vehiclemor.study.plans.protocol_run import run_protocol
from vehiclemor.study.plans.results import cells_digest, combined
from vehiclemor.study.plans.study_file import MOST_SEED, StudyFile
from vehiclemor.study.store import cell_path, combined_path, stored
from vehiclemor.study.workers import Workers

if TYPE_CHECKING:
    import xarray as xr

_LOG = logging.getLogger("vehiclemor")
# A grid of so many points is told of before it is expanded; and so many experiments are made and
# given to workers at a time.
LARGE, AT_ONCE = 10_000, 5_000


def run_studies(
    study: str, folder: Path, jobs: int = 1, scheduler: str = "", seed: int | None = None
) -> dict[str, xr.Dataset]:
    """Run a study, or all studies of a collection, and combine the results.

    Parameters
    ----------
    study
        Name of a study or collection, or path of a TOML file.
    folder
        Results folder; cells that it holds already are not computed again.
    jobs
        Number of processes.
    scheduler
        Address of a dask scheduler whose workers compute.
    seed
        Of the drawn test runs of protocols, for an audit; by default that of their files.

    Returns
    -------
    dict
        Study name -> combined dataset, stored too, see `combined_path`.
    """
    count("jobs", jobs, most=MOST_JOBS)
    if seed is not None:
        count("seed", seed, least=0, most=MOST_SEED)
    if jobs > 1 and scheduler:
        raise InputError("jobs: a scheduler has its own workers")
    files = studies_and_files(study)
    protocols = [
        load_protocol(str(path), seed if found.drawn else None, name)
        for name, (path, found) in files.items()
        if found.bounds
    ]
    if seed is not None and not any(protocol.definition.drawn for protocol in protocols):
        raise InputError(f"seed: {study} draws no test runs")
    grids = [_expanded(name, found) for name, (_, found) in files.items() if not found.bounds]
    with reached(scheduler) if scheduler else nullcontext() as elsewhere:
        results = {p.study: run_protocol(p, folder, jobs, elsewhere) for p in protocols}
        for grid in grids:
            workers = Workers(grid.name, folder, jobs, elsewhere, set(grid.unique))
            results[grid.name] = stored(
                combined_path(folder, grid.name),
                "cells",
                cells_digest(grid),
                partial(_combined, grid, workers),
                lambda grid=grid: (cell_path(folder, key) for key in grid.unique),
                content_hash(grid.definition),
            )
            tell(grid.name, len(grid.unique), len(grid.unique))
    return results


def _combined(grid: Grid, workers: Workers) -> xr.Dataset:
    experiments = iter(grid.unique.values())
    while part := [[cell] for cell in islice(experiments, AT_ONCE)]:
        workers(part)
    return combined(grid, workers.folder)


def _expanded(name: str, definition: StudyFile) -> Grid:
    if definition.points < LARGE:
        return expand(name, definition)
    _LOG.info("%s: %d grid points", name, definition.points)
    with telling(f"{name}: checking all of them"):
        grid = expand(name, definition)
    _LOG.info("%s: %d cells; an interrupted run is resumed", name, len(grid.unique))
    return grid
