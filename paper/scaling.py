"""Measures studies of many cells: cells a second and overhead a cell, by joblib and by dask.

Usage: python paper/scaling.py [--results DIR] [--share 1.0]

Writes DIR/scaling.nc, named values with units, which `paper/facts.py` writes into the texts, and
prints them.  Wall clock of whole runs, from reading the study to the combined dataset, the start of
processes included: it wants an idle machine of two cores, and some minutes.  A smaller share makes
grids with as much fewer cells, to try it.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from named_values import Values, measured_values

from vehiclemor.study.cell_file import ENDING
from vehiclemor.study.cluster import LOCAL, reached
from vehiclemor.study.experiment import Experiment
from vehiclemor.study.plans.grid import expand
from vehiclemor.study.plans.study_file import load_studies
from vehiclemor.study.run import run_studies
from vehiclemor.study.workers import Done, evaluated_by_workers

if TYPE_CHECKING:
    import xarray as xr

FILE, TITLE = "scaling.nc", "Studies of many cells"
HEAD = """
title = "for the measurement of many cells"
model = "{model}"
training = "nominal"
keep = "metrics"

[grid]
frequency_factor = {{ first = 0.8, last = 1.2, count = {count} }}
amplitude_factor = {{ first = 0.8, last = 1.1, count = 50 }}
rank = {ranks}
"""
METHOD = '\n[[methods]]\nmethod = "{}"\n'
# Short name -> model, ranks, methods: at each of the frequencies (of all of them) and 50 amplitudes
# one cell of a method without a rank, and one for each rank.
STUDIES = {
    "suspension": ("double_wishbone", [2, 3, 4], ("full_order", "pod"), 50),
    "vehicle": ("independent_suspension_vehicle", [3], ("full_order", "pod"), 10),
}
ENGINES: dict[str, dict[str, Any]] = {
    "one": {},
    "joblib": {"jobs": 2},
    "dask": {"jobs": 2, "scheduler": LOCAL},
}


def nothing(experiments: Sequence[Experiment], _: object) -> Done:
    """Do nothing with some cells, in a process of joblib."""
    return [experiment.key for experiment in experiments], ""


def nothing_sent(experiments: Sequence[Experiment], place: object) -> tuple[Done, dict]:
    """Do nothing with some cells, on a worker of dask."""
    return nothing(experiments, place), {}


def study(short: str, share: float, folder: Path) -> Path:
    """File of a study."""
    model, ranks, methods, count = STUDIES[short]
    path = folder / f"{short}.toml"
    head = HEAD.format(model=model, ranks=ranks, count=max(round(share * count), 2))
    path.write_text(head + "".join(METHOD.format(method) for method in methods))
    return path


def whole_runs(share: float, folder: Path) -> Values:
    """Runs of each study by each engine; what they compile is compiled before."""
    values: Values = {}
    for short in STUDIES:
        path = study(short, share, folder)
        run_studies(str(study(short, 0.0, folder / "small")), folder / "warm")
        for engine, options in ENGINES.items():
            began = time.perf_counter()
            (found,) = run_studies(str(path), folder / f"{short} {engine}", **options).values()
            seconds = time.perf_counter() - began
            cells = len(list((folder / f"{short} {engine}" / "cells").rglob(f"*{ENDING}")))
            assert set(found["status"].values.ravel()) == {"ok"}
            values[f"{short} cells, 1"] = cells
            values[f"{short} {engine} rate, 1/s"] = cells / seconds
            values[f"{short} {engine} cell, ms"] = 1e3 * seconds / cells
        for engine in ("joblib", "dask"):
            rates = [values[f"{short} {name} rate, 1/s"] for name in (engine, "one")]
            values[f"{short} {engine} gain, 1"] = rates[0] / rates[1]
    return values


def overheads(share: float, folder: Path) -> Values:
    """What an engine takes for a cell in which nothing is done: made, sent, told of."""
    (definition,) = load_studies(str(study("suspension", share, folder))).values()
    cells = [[cell] for cell in expand("suspension", definition).unique.values()]

    def spent(engine: Callable[..., Any], work: Callable[..., Any]) -> float:
        least = float("inf")
        # The first of these starts the processes.
        for _ in range(3):
            began = time.perf_counter()
            number = sum(len(done) for done, _ in engine(cells, folder, work=work))
            assert number == len(cells)
            least = min(least, 1e3 * (time.perf_counter() - began) / number)
        return least

    values = {"joblib overhead, ms": spent(partial(evaluated_by_workers, jobs=2), nothing)}
    with reached(LOCAL, 2) as elsewhere:
        values["dask overhead, ms"] = spent(elsewhere, nothing_sent)
    return values


def measured(folder: Path, anew: bool = False, share: float = 1.0) -> xr.Dataset:
    """What the results folder holds; measured where it lacks it, or once more."""
    with tempfile.TemporaryDirectory() as scratch:
        (Path(scratch) / "small").mkdir()
        parts = [partial(part, share, Path(scratch)) for part in (overheads, whole_runs)]
        return measured_values(folder / FILE, TITLE, parts, anew)


def main() -> None:
    """Measure, write and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--results", type=Path, default=Path("results"), help="results folder")
    parser.add_argument("--share", type=float, default=1.0, help="of the cells")
    chosen = parser.parse_args()
    found = measured(chosen.results, anew=True, share=chosen.share)
    for value in found["value"]:
        print(f"{value['name'].item():32} {value.item():10.4g} {value['output_unit'].item()}")


if __name__ == "__main__":
    sys.exit(main())
