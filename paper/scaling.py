"""Measures studies of many cells: cells a second and overhead a cell, by joblib and by dask.

Usage: python paper/scaling.py [--results DIR] [--share 1.0]

Writes DIR/scaling.nc, named values with units, which `paper/facts.py` writes into the texts, and
prints them.  Wall clock of whole runs, from reading the study to the combined dataset, by processes
that have begun; what it takes to begin them is told apart.  It wants an idle machine of two cores,
and some minutes.  A smaller share makes grids with as much fewer cells, to try it.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
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
frequency_factor = {{ first = 0.8, last = 1.2, count = {frequencies} }}
amplitude_factor = {{ first = 0.8, last = 1.1, count = {amplitudes} }}
rank = {ranks}

[[methods]]
method = "full_order"

[[methods]]
method = "pod"
"""
# Short name -> model, ranks and frequencies; at each frequency and each of so many amplitudes there
# is one cell of the full order, and one for each rank.
STUDIES = {
    "suspension": ("double_wishbone", [2, 3, 4], 50),
    "vehicle": ("independent_suspension_vehicle", [3], 10),
}
AMPLITUDES, JOBS = 50, 2


def nothing(experiments: Sequence[Experiment], _: object) -> Done:
    """Do nothing with some cells, in a process of joblib."""
    return [experiment.key for experiment in experiments], ""


def nothing_sent(experiments: Sequence[Experiment], place: object) -> tuple[Done, dict]:
    """Do nothing with some cells, on a worker of dask."""
    return nothing(experiments, place), {}


def study(short: str, share: float, folder: Path) -> Path:
    """File of a study; with no share of the cells it has a few."""
    model, ranks, frequencies = STUDIES[short]
    path = folder / f"{short}-{share}.toml"
    text = HEAD.format(
        model=model,
        ranks=ranks,
        frequencies=max(round(share * frequencies), 2),
        amplitudes=AMPLITUDES if share else 2,
    )
    path.write_text(text)
    return path


@contextmanager
def options(engine: str) -> Iterator[dict[str, Any]]:
    """What a run is told of an engine, while its processes live."""
    if engine == "dask":
        from distributed import LocalCluster

        cluster: Any = LocalCluster(n_workers=JOBS, threads_per_worker=1, silence_logs=40)
        with cluster:
            yield {"scheduler": cluster.scheduler_address}
    else:
        yield {"jobs": JOBS if engine == "joblib" else 1}


def seconds_of(path: Path, folder: Path, how: dict[str, Any]) -> float:
    """Wall clock of a study that runs into a new folder."""
    began = time.perf_counter()
    (found,) = run_studies(str(path), folder, **how).values()
    assert set(found["status"].values.ravel()) == {"ok"}
    return time.perf_counter() - began


def whole_runs(share: float, folder: Path) -> Values:
    """Runs of each study by each engine; what they compile is compiled before."""
    values: Values = {}
    for short in STUDIES:
        few, path = study(short, 0.0, folder), study(short, share, folder)
        seconds_of(few, folder / f"{short} before", {})
        for engine in ("one", "joblib", "dask"):
            out, name = folder / f"{short} {engine}", f"{short} {engine}"
            began = time.perf_counter()
            with options(engine) as how:
                seconds_of(few, folder / f"{short} {engine} few", how)
                start = time.perf_counter() - began
                seconds = seconds_of(path, out, how)
            cells = sum(1 for _ in (out / "cells").rglob(f"*{ENDING}"))
            values[f"{short} cells, 1"] = cells
            values |= {f"{name} start, s": start, f"{name} rate, 1/s": cells / seconds}
            gain = values[f"{name} rate, 1/s"] / values[f"{short} one rate, 1/s"]
            values[f"{name} gain, 1"] = gain
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

    values = {"joblib overhead, ms": spent(partial(evaluated_by_workers, jobs=JOBS), nothing)}
    with reached(LOCAL, JOBS) as elsewhere:
        values["dask overhead, ms"] = spent(elsewhere, nothing_sent)
    return values


def measured(folder: Path, anew: bool = False, share: float = 1.0) -> xr.Dataset:
    """What the results folder holds; measured where it lacks it, or once more."""
    with tempfile.TemporaryDirectory() as scratch:
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
    main()
