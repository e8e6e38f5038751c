"""Running studies: what is missing is computed, stored at once, and combined at the end."""

from __future__ import annotations

from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from vehiclemor.arguments import count, within
from vehiclemor.errors import InputError
from vehiclemor.progress import telling
from vehiclemor.study.cluster import LOCAL, reached
from vehiclemor.study.plans.grid import Grid, expand
from vehiclemor.study.plans.grid_results import cells_digest, grid_dataset
from vehiclemor.study.plans.protocol import load_protocol
from vehiclemor.study.plans.protocol_run import run_protocol
from vehiclemor.study.plans.study_file import StudyFile, file_as_stored, studies_and_files
from vehiclemor.study.store import result_path, stored
from vehiclemor.study.workers import Workers

if TYPE_CHECKING:
    import xarray as xr

MOST_JOBS = 1024
# Points of a grid that take their time before the first is computed.
LARGE = 10_000


def run_studies(
    study: str, folder: Path, jobs: int = 1, scheduler: str = ""
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
        Address of a dask scheduler whose workers compute, or `local` for one that is started here.

    Returns
    -------
    dict
        Study name -> combined dataset, stored as `studies/<name>.nc` too; of a protocol the name
        is `predictive-<protocol>`.
    """
    within("jobs", count("jobs", jobs), (1, MOST_JOBS))
    if jobs > 1 and scheduler not in ("", LOCAL):
        raise InputError("jobs: a scheduler at an address has its own workers")
    files = studies_and_files(study)
    protocols = [load_protocol(name) for _, d in files.values() for name in d.protocols]
    grids = [(path, _expanded(n, d)) for n, (path, d) in files.items() if not d.protocols]
    with reached(scheduler, jobs) if scheduler else nullcontext() as elsewhere:
        results = {p.study: run_protocol(p, folder, jobs, elsewhere) for p in protocols}
        for path, grid in grids:
            cells = grid.unique
            workers = Workers(grid.name, folder, jobs, elsewhere)
            workers([[cell] for cell in cells.values()])
            results[grid.name] = stored(
                folder / "studies" / f"{grid.name}.nc",
                "cells",
                cells_digest(grid),
                partial(grid_dataset, grid, folder),
                [result_path(folder, key) for key in cells],
                file_as_stored(path, folder),
            )
    return results


def _expanded(name: str, definition: StudyFile) -> Grid:
    large = definition.points >= LARGE
    with telling(f"{name}: a grid of {definition.points} points") if large else nullcontext():
        grid = expand(name, definition)
        # Made here: the keys take most of the time.
        assert grid.unique
        return grid
