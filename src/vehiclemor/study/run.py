"""Running studies: what is missing is computed, stored at once, and combined at the end."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from vehiclemor.errors import InputError
from vehiclemor.study.cells import Cell, Grid, expand
from vehiclemor.study.combine import cells_digest, combined
from vehiclemor.study.definition import load_studies
from vehiclemor.study.execution import compute_cell
from vehiclemor.study.predictive import run_protocols
from vehiclemor.study.store import cell_path, prepare_folder, read_dataset, write_dataset

if TYPE_CHECKING:
    import xarray as xr

Progress = Callable[[str, int, int], None]


def run_studies(
    study: str, folder: Path, jobs: int = 1, progress: Progress | None = None
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
    progress
        Called with (study, finished cells, all cells).

    Returns
    -------
    dict
        Study name -> combined dataset, stored as `studies/<name>.nc` too; of a protocol the name
        is `predictive-<protocol>`.
    """
    if jobs < 1:
        raise InputError(f"jobs is {jobs}; it must be at least 1")
    definitions = load_studies(study)
    protocols = [name for d in definitions.values() for name in d.protocols]
    grids = [expand(name, d) for name, d in definitions.items() if not d.protocols]
    prepare_folder(folder)
    results: dict[str, xr.Dataset] = {}
    if protocols:
        results |= run_protocols(protocols, folder, jobs, progress)
    for grid in grids:
        _compute_missing(grid, folder, jobs, progress)
        results[grid.name] = _combine_and_store(grid, folder)
    return results


def _compute_missing(grid: Grid, folder: Path, jobs: int, progress: Progress | None) -> None:
    cells = grid.unique
    missing = [cell for cell in cells.values() if not cell_path(folder, cell.key).exists()]
    done = len(cells) - len(missing)
    if progress:
        progress(grid.name, done, len(cells))
    for _ in _executed(missing, folder, jobs):
        done += 1
        if progress:
            progress(grid.name, done, len(cells))


def _executed(cells: list[Cell], folder: Path, jobs: int) -> Iterator[None]:
    # Starting processes costs seconds: a handful of cells is quicker without.
    if jobs == 1 or len(cells) < 4 * jobs:
        for cell in cells:
            yield compute_and_store(cell, folder)
        return
    from joblib import Parallel, delayed

    # One cell of each method first, so that its loops are compiled once and not in every process.
    first = {cell.method: cell for cell in reversed(cells)}.values()
    for cell in first:
        yield compute_and_store(cell, folder)
    done = {cell.key for cell in first}
    pool = Parallel(n_jobs=jobs, return_as="generator_unordered")
    yield from pool(
        delayed(compute_and_store)(cell, folder) for cell in cells if cell.key not in done
    )


def compute_and_store(cell: Cell, folder: Path) -> None:
    """Compute one cell and move its complete file into place."""
    write_dataset(compute_cell(cell), cell_path(folder, cell.key))


def _combine_and_store(grid: Grid, folder: Path) -> xr.Dataset:
    path = folder / "studies" / f"{grid.name}.nc"
    if path.exists():
        stored = read_dataset(path, "source", "vehiclemor")
        if stored.attrs.get("cells") == cells_digest(grid) and _newer_than_cells(
            path, grid, folder
        ):
            return stored
    dataset = combined(grid, folder)
    write_dataset(dataset, path)
    return dataset


def _newer_than_cells(path: Path, grid: Grid, folder: Path) -> bool:
    written = path.stat().st_mtime_ns
    return all(cell_path(folder, key).stat().st_mtime_ns < written for key in grid.unique)
