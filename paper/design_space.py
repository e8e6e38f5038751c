"""Measures reduced models of a box of cars on a Latin hypercube of its cars.

Usage: python paper/design_space.py [--cars N] [--jobs N] [--results DIR] [--figures DIR]
[--kept FILE] [MODEL ...]

Each vehicle is fitted once for the box of its protocol over cars; then every car drives the nominal
lane change, on which all bases are trained, and another one.  Writes DIR/design_space-MODEL.nc and
a figure, and a table, which it prints and keeps in data/design_space.json, for the handbook and
`vehiclemor compare`: errors in parts of the protocol's bounds, misses, silent misses (those of
which the model says nothing), warnings, and the CPU time of a car and its run.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.figure import Figure

import vehiclemor as vm
from vehiclemor.files import make_folder, write_text
from vehiclemor.metrics import max_abs, rms
from vehiclemor.online.rom import ReducedOrderModel
from vehiclemor.registry import component
from vehiclemor.report.design_studies import FULL, KEPT, design_space
from vehiclemor.report.figures.lines import FULL as FULL_LINE
from vehiclemor.report.figures.lines import legend_outside, panels, styles
from vehiclemor.report.figures.saving import save_figure, styled
from vehiclemor.report.labels import method_text
from vehiclemor.resources import data_folder
from vehiclemor.study.netcdf_file import write_dataset
from vehiclemor.study.plans.protocol import Protocol, load_protocol
from vehiclemor.study.plans.protocol_file import Bound
from vehiclemor.study.provenance import attributes

SEED = 1000
# Cars that a process gets at a time.
AT_ONCE = 25
# Frequency and amplitude factors of the runs; bases are trained on the first.
RUNS = {"trained input": (1.0, 1.0), "other input": (1.3, -1.2)}
FITS: dict[str, dict[str, Any]] = {
    FULL: {"method": "full_order", "solver": "ros34pw2", "tolerance": 3e-4, "cars": ()},
    "replay": {"method": "replay"},
    "POD, nominal basis": {"method": "pod", "cars": ()},
    "POD, concatenated basis": {"method": "pod"},
    "POD, interpolated bases": {"method": "pod", "bases": "interpolated"},
}
# As many modes of all cars together as keep the bounds: those that the vehicles have themselves.
WHOLE: dict[str, dict[str, Any]] = {
    "independent_suspension_vehicle": {"method": "pod", "rank": 13, "snapshots": 20},
    "high_fidelity_vehicle": {
        "method": "pod",
        "formulation": "coordinates",
        "rank": 14,
        "snapshots": 14,
    },
}
REFITTED = "POD, refitted"
MANIFOLD = "nonlinearity = 'rich', terms = 32"
BEST: dict[str, dict[str, Any]] = {
    "independent_suspension_vehicle": {
        "method": "guarded",
        "training": "protocol",
        "fast_settings": MANIFOLD,
        "tolerance": 2e-3,
        "safe_solver": "exponential_adams",
        "safe_tolerance": 1e-7,
    },
    "high_fidelity_vehicle": {
        "method": "guarded",
        "training": "protocol",
        "fast": "two_track",
        "tolerance": 1e-3,
        "safe_solver": "exponential_adams",
        "safe_tolerance": 1e-7,
    },
}


def fits(protocol: Protocol) -> dict[str, ReducedOrderModel]:
    """One reduced model for all cars by each method."""
    found, model, box = {}, protocol.model, protocol.definition.cars
    best, whole = BEST[model.name], WHOLE[model.name]
    label = f"POD, concatenated basis, r = {whole['rank']}"
    further: dict[str, dict[str, Any]] = {label: whole, best["method"]: best}
    for label, given in (FITS | further).items():
        began = time.perf_counter()
        found[label] = vm.reduce(model, **{"training": "nominal", "cars": box} | given)
        print(f"{label}: fitted in {time.perf_counter() - began:.1f} s", flush=True)
    return found


def score(error: np.ndarray, outputs: list[str], bounds: Mapping[str, Bound]) -> np.ndarray:
    """Errors (outputs,) of a run (samples, outputs) in parts of their bounds."""
    size = {"max": max_abs(error), "rms": rms(error)}
    parts = [size[b.measure][outputs.index(output)] / b.bound for output, b in bounds.items()]
    return np.array(parts)


class Found(NamedTuple):
    """What is measured of some cars.

    Attributes
    ----------
    scores
        Errors (rows, cars, runs, outputs) in parts of their bounds; infinite if a run has failed.
    warned
        Whether a run (rows, cars, runs) says that it may be wrong.
    made, seconds
        CPU time (rows, cars) of making a car and (rows, cars, runs) of a run in s.
    """

    scores: np.ndarray
    warned: np.ndarray
    made: np.ndarray
    seconds: np.ndarray


def of_cars(
    protocol: Protocol, reduced: Mapping[str, ReducedOrderModel], values: np.ndarray
) -> Found:
    """Errors, warnings and times of all methods on cars by their parameters (cars, varied)."""
    model, definition = protocol.model, protocol.definition
    base = component("maneuver", model.definition.maneuver)
    maneuvers = [base.perturbed(*factors) for factors in RUNS.values()]
    labels = [*reduced, REFITTED]
    shape = (len(labels), len(values), len(RUNS))
    scores, warned = np.full((*shape, len(definition.bounds)), np.inf), np.zeros(shape, dtype=bool)
    made, seconds = np.zeros(shape[:2]), np.zeros(shape)
    for number, row in enumerate(values.tolist()):
        changed = dict(zip(definition.cars, row, strict=True))
        car = vm.model(model.name, parameters=changed)
        full = [car.simulate(maneuver) for maneuver in maneuvers]
        for place, label in enumerate(labels):
            began = time.thread_time()
            if label == REFITTED:
                own = vm.reduce(car, "pod", training="nominal")
            else:
                own = reduced[label].for_parameters(changed)
            # Some of a car is made by its first run.
            own.simulate(maneuvers[0])
            made[place, number] = time.thread_time() - began
            for k, (maneuver, true) in enumerate(zip(maneuvers, full, strict=True)):
                began = time.thread_time()
                run = own.simulate(maneuver)
                seconds[place, number, k] = time.thread_time() - began
                told = run.trust is not None and bool(run.trust.reason)
                warned[place, number, k] = run.status != "ok" or told
                if run.finished:
                    error = run.outputs - true.outputs
                    scores[place, number, k] = score(error, list(car.outputs), definition.bounds)
            made[place, number] -= seconds[place, number, 0]
    return Found(scores, warned, made, seconds)


def measured(protocol: Protocol, count: int, jobs: int) -> xr.Dataset:
    """Errors, warnings and times of all methods on a Latin hypercube of cars."""
    from joblib import Parallel, delayed
    from scipy.stats import qmc

    model, definition = protocol.model, protocol.definition
    low, high = np.transpose(list(definition.cars.values()))
    places = qmc.LatinHypercube(len(low), rng=SEED).random(count)
    values = low + places * (high - low)
    reduced = fits(protocol)
    parts = np.array_split(values, -(-count // AT_ONCE))
    done = Parallel(n_jobs=jobs, verbose=1)(delayed(of_cars)(protocol, reduced, p) for p in parts)
    scores, warned, made, seconds = (np.concatenate(of, axis=1) for of in zip(*done, strict=True))
    found = {
        "score": (("row", "car", "run", "output"), scores),
        "warned": (("row", "car", "run"), warned),
        "seconds_to_make": (("row", "car"), made),
        "seconds": (("row", "car", "run"), seconds),
        "parameters": (("car", "parameter"), values),
    }
    axes = {
        "row": [*reduced, REFITTED],
        "run": list(RUNS),
        "output": list(definition.bounds),
        "parameter": list(definition.cars),
    }
    title = f"{model.name}: reduced models on {count} cars"
    return xr.Dataset(found, axes, attributes(title, model.kernel_hash, model=model.name))


def table(data: xr.Dataset) -> pd.DataFrame:
    """One line for each method and run."""
    lines = []
    for run in data["run"].values:
        for row in data["row"].values:
            part = data.sel(row=row, run=run)
            worst = part["score"].max("output").values
            missed, warned = worst > 1.0, part["warned"].values
            lines.append(
                {
                    "run": run,
                    "method": row,
                    "median score": np.median(worst),
                    "95 %": np.quantile(worst, 0.95, method="higher"),
                    "worst": worst.max(),
                    "missed, %": 100.0 * missed.mean(),
                    "silent, %": 100.0 * (missed & ~warned).mean(),
                    "warned, %": 100.0 * warned.mean(),
                    "ms a car": 1e3 * float(part["seconds_to_make"].median()),
                    "ms a run": 1e3 * float(part["seconds"].median()),
                }
            )
    return pd.DataFrame(lines).set_index(["run", "method"])


def keep(data: xr.Dataset, path: Path) -> None:
    """Put the table of a model into the file of all."""
    made = {name: str(data.attrs[name]) for name in ("kernel_hash", "versions", "machine")}
    rows = table(data).reset_index().to_dict("records")
    found = {"made": made, "cars": data.sizes["car"], "rows": rows}
    content = design_space(path) | {str(data.attrs["model"]): found}
    write_text(path, json.dumps(content, indent=1) + "\n")


def figure(data: xr.Dataset) -> Figure:
    """Share of the cars whose largest error, in parts of its bound, is above a value."""
    drawn, axes = panels(1, len(data["run"]), (6.7, 3.4), sharey=True, sharex=True)
    drawn.set_layout_engine("constrained")
    share = 100.0 * (1.0 - np.arange(data.sizes["car"]) / data.sizes["car"])
    lines = styles(str(row) for row in data["row"].values if row != FULL) | {FULL: FULL_LINE}
    for axis, run in zip(axes.flat, data["run"].values, strict=True):
        for row, style in lines.items():
            worst = np.sort(data["score"].sel(row=row, run=run).max("output").values)
            axis.semilogx(worst, share, label=method_text(row), **style)
        axis.axvline(1.0, color="black", linewidth=0.8)
        axis.set_title(str(run))
        axis.set_xlabel("largest error / its bound")
    axes[0, 0].set_ylabel("cars above (%)")
    legend_outside(drawn, axes.flat, columns=3)
    return drawn


def main() -> None:
    """Measure, write and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("models", nargs="*", default=list(BEST), metavar="MODEL")
    parser.add_argument("--cars", type=int, default=1000, help="cars of the Latin hypercube")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--results", type=Path, default=Path("results"), help="results folder")
    parser.add_argument("--figures", type=Path, default=Path("paper/figures"), help="of figures")
    kept = data_folder() / KEPT
    parser.add_argument("--kept", type=Path, default=kept, metavar="FILE", help="of tables")
    given = parser.parse_args()
    make_folder(given.results)
    make_folder(given.figures)
    for model in given.models:
        data = measured(load_protocol(f"cars-{model}"), given.cars, given.jobs)
        write_dataset(data, given.results / f"design_space-{model}.nc")
        keep(data, given.kept)
        with styled():
            save_figure(figure(data), given.figures / f"design-space-{model}.png")
        print(f"\n{data.attrs['title']}\n{table(data).round(3).to_string()}\n", flush=True)


if __name__ == "__main__":
    main()
