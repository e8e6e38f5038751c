"""Comparisons: with the paper, of every model, of any study; costs.

A model is compared by studies of its declaration: nominal, perturbed and unseen inputs, every
method.  What the package has is taken; else a study file is written beside the results, so that it
runs, resumes and can be read and changed like any other.
"""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from vehiclemor.arguments import MOST_JOBS, count, file_path
from vehiclemor.exceptions import InputError
from vehiclemor.files import data_names
from vehiclemor.registry import component, names, unknown
from vehiclemor.report.labels import REDUCED, default_rank, of_kind, tabled_outputs, timing_cases
from vehiclemor.report.published import (
    INDISTINGUISHABLE,
    TIMING,
    number_rows,
    printed_errors_and_savings,
    rms_numbers,
)
from vehiclemor.report.results import frame, grid_rows, result_kind
from vehiclemor.report.unseen import protocol_rows
from vehiclemor.simulation.build import build
from vehiclemor.simulation.model import Model
from vehiclemor.study.experiment import complete_settings, default_settings, make_experiment
from vehiclemor.study.plans.loading import is_study, write_study
from vehiclemor.study.plans.protocol import PREFIX, protocol_names
from vehiclemor.study.plans.study_file import schema_of
from vehiclemor.study.run import run_studies
from vehiclemor.study.scenario import Scenario
from vehiclemor.study.timing import timed_starts

PAPER = "paper"
# The paper says nothing of another start.
PUBLISHED_START = "equilibrium"
Row = dict[str, Any]
# Perturbations of the nominal run; and tolerances of the full order in a protocol.
FACTORS = (0.8, 0.9, 1.0, 1.1, 1.2)
TOLERANCES = (1e-3, 1e-4, 1e-6, 1e-8)
# Method and preset of the first rows.
FIRST = (("full_order", "recommended"), ("full_order", "strongest"), ("replay", "recommended"))
# Of a protocol; every other method is a contender.
ROLES = {"full_order": "full order", "replay": "baseline"}
# Points [frequency factor, amplitude factor] of the sets of a protocol.
POINTS = {
    "training": [[1.0, 1.0], [0.7, 0.6]],
    "validation": [[1.2, 0.8], [0.8, -0.9]],
    "test": [[0.9, 1.0], [1.3, 1.0], [1.0, 0.5], [1.0, -1.0], [1.0, 0.0]],
    "outside": [[1.0, 1.2], [1.6, 1.0]],
}


def compare(
    what: str | Path = PAPER,
    results: str | Path = "results",
    jobs: int = 1,
    seed: int | None = None,
) -> pd.DataFrame:
    """A comparison as a table; studies and timings that are missing are run first.

    Parameters
    ----------
    what
        `paper`: published beside reproduced.  `predictive`: reduced models on inputs that they have
        not seen, beside full-order integrators.  The name of a model: every method that fits it,
        nominal, perturbed and on unseen inputs, with costs.  A study, collection or protocol, by
        name or TOML file: errors of every method over the grid, or on the protocol's inputs.
    results
        Results folder.
    jobs
        Number of processes.
    seed
        Samples fresh test runs for an audit: of `predictive`, or of a protocol.

    Returns
    -------
    pandas.DataFrame
        Of `paper` a row for each published number and variant of the method (`default`, `literal`:
        the paper's words): its id, model, item, the published number, a `verdict` (`met`, `missed`,
        `not_comparable`), the columns of `published.Finding`, and `replay`, the same number
        of the training-trajectory baseline.  The others are described at `model_comparison` and
        `study_comparison` in `vehiclemor.report.comparison`.
    """
    what, folder = str(file_path("what", what)), file_path("results", results)
    count("jobs", jobs, most=MOST_JOBS)
    if seed is not None and (what == PAPER or what in names("model")):
        raise InputError(f"seed: comparison {what!r} samples no test runs of its own")
    if what == PAPER:
        return paper_comparison(folder, jobs)
    if what in names("model"):
        return model_comparison(what, folder, jobs)
    if is_study(what):
        return study_comparison(what, folder, jobs, seed)
    known = [PAPER, *names("model"), *data_names("studies"), "FILE.toml"]
    raise unknown("comparison", what, known)


def paper_comparison(folder: Path, jobs: int = 1) -> pd.DataFrame:
    """Every number of the paper, by model, with verdict and reason; see `compare`."""
    results = dict(run_studies(PAPER, folder, jobs))
    results |= {timing: timing_of(model, folder) for model, timing in TIMING.items()}
    results = {name: at_published_start(dataset) for name, dataset in results.items()}
    models = [*dict.fromkeys(number.model for number in printed_errors_and_savings())]
    return pd.DataFrame(sorted(number_rows(results), key=lambda row: models.index(row["model"])))


def at_published_start(dataset: xr.Dataset) -> xr.Dataset:
    """A study or timing from the start that what is published is judged by."""
    if PUBLISHED_START in dataset.indexes.get("start", ()):
        return dataset.sel(start=PUBLISHED_START)
    return dataset


def model_comparison(name: str, folder: Path, jobs: int = 1) -> pd.DataFrame:
    """Every registered method that fits, on one model; what is missing is run first.

    `kind` tells what a row is: `cost` as in `cost_table`; the others as in `study_comparison`, of
    the model's nominal and perturbed runs and of its protocol.
    """
    studies = nominal(name, folder), perturbed(name, folder)
    parts = [study_comparison(study, folder, jobs) for study in studies]
    parts.append(cost_table(name, folder).assign(kind="cost"))
    parts.append(study_comparison(unseen(name, folder), folder, jobs))
    return pd.concat(parts, ignore_index=True).assign(model=name)


def study_comparison(
    study: str, folder: Path, jobs: int = 1, seed: int | None = None
) -> pd.DataFrame:
    """A study, all members of a collection, or a protocol; what is missing is run first.

    `kind` tells what a row is.  `errors`: an output of one method from one start over a study's
    grid, see `results.grid_rows`.  `method`, `target`, `bound`: a method of a protocol, and what
    the one that validation has chosen must and does reach, see `unseen`.  Errors are in SI units.
    """
    results = run_studies(study, folder, jobs, seed=seed).values()
    return pd.DataFrame([row for dataset in results for row in result_rows(dataset)])


def result_rows(dataset: xr.Dataset) -> Sequence[Row]:
    """Rows of one study, by what it is."""
    is_protocol = result_kind(dataset) == "protocol"
    return protocol_rows(dataset) if is_protocol else grid_rows(dataset)


# Costs.


def timing_of(model: str, folder: Path) -> xr.Dataset:
    """Stored timing of the cases of a model, measured first if it is missing."""
    built, cases = build(model), timing_cases(component("model", model))
    settings = {c.id: complete_settings(built, c.method, c.settings, c.preset) for c in cases}
    experiments: dict[str, dict[str, Any]] = {}
    for start in built.starts:
        # Trained on the run that is timed.
        run = (Scenario.of(built.definition.maneuver, (1.0, 1.0), start),)
        experiments[start] = {
            case.id: make_experiment(built, case.method, settings[case.id], run, run, "metrics")
            for case in cases
        }
    data = timed_starts(experiments, folder / "studies" / f"timing-{model}.nc")
    return data.assign_coords(label=("case", [case.label for case in cases]))


def cost_table(model: str, folder: Path) -> pd.DataFrame:
    """Cost of every timing case of a model on its nominal maneuver, from every start.

    Speed-ups are against the paper's kind of baseline, and against the fastest full-order solver;
    `break_even` is the number of runs after which a reduced model has paid for its training
    (missing where it never does).
    """
    runs: Any = frame(timing_of(model, folder))
    seconds, offline = runs["seconds"], runs["offline_seconds"]
    spread = runs["seconds_upper"] - runs["seconds_lower"]
    errors = [name for name in runs if name.startswith("rms_error.")]
    renamed = {"effective_rank": "rank"} | {n: n.replace("rms_error.", "rms_") for n in errors}
    counts = of_kind(component("model", model).kind).counts
    derived = {
        "us_per_run": 1e6 * seconds,
        "quartile_spread": (spread / seconds).where(seconds > 0.0, 0.0),
        "offline_us": 1e6 * offline,
        "break_even": break_even(runs, "speed_up"),
        "break_even_strongest": break_even(runs, "speed_up_strongest"),
    }
    columns = ["start", "case", "label", "status", "rank", "us_per_run", *counts]
    columns += ["tolerance", "quartile_spread", "speed_up", "speed_up_strongest"]
    columns += [*(renamed[name] for name in errors)]
    columns += ["offline_us", "break_even", "break_even_strongest"]
    return runs.assign(**derived).rename(columns=renamed)[columns]


def break_even(runs: Any, speed_up: str) -> Any:
    """Runs that earn the training, by a column of speed-ups; missing where none saves time."""
    # A run that has failed saves nothing.
    saved = (runs["seconds"] * (runs[speed_up] - 1.0)).where(runs["status"] == "ok", 0.0)
    offline = runs["offline_seconds"]
    return (offline / saved).where((saved > 0.0) & (offline > 0.0))


# Studies of a model.


def nominal(name: str, results: Path) -> str:
    """Study of the nominal run, that the methods are trained on."""
    return _study(name, "nominal", results, {"start": list(build(name).starts)})


def perturbed(name: str, results: Path) -> str:
    """Study over perturbations of both factors, trained on the nominal input."""
    factors = list(FACTORS)
    grid = {"frequency_factor": factors, "amplitude_factor": factors}
    further = {"training": "nominal", "keep": "metrics", "grid": grid}
    return _study(name, "perturbed", results, further)


def unseen(name: str, results: Path) -> str:
    """Study of inputs that no method has seen: the package's protocol, or one by default."""
    if name in protocol_names():
        return protocol_names()[name]
    model = build(name)
    entries = [entry for entry in _entries(model) if entry["preset"] != "literal"]
    for entry in entries:
        entry["role"] = ROLES.get(entry["method"], "contender")
        entry["label"] = entry["label"].removeprefix("full_order_").replace("_", " ")
        if entry["label"] == "full order":
            entry["candidates"] = [{"tolerance": value} for value in TOLERANCES]
    inputs = {"maneuver": model.definition.maneuver, "start": list(model.starts)}
    content = {
        "title": f"{name}: inputs that a reduced model has not seen",
        "model": name,
        "bounds": {o: {"measure": "rms", "bound": bound} for o, bound in bounds(model).items()},
        "methods": entries,
        **{purpose: [inputs | {"points": points}] for purpose, points in POINTS.items()},
    }
    return _written(results, f"{PREFIX}{name}", content)


def _entries(model: Model) -> list[dict[str, Any]]:
    """Every registered method that accepts the model, at a rank that the model is large enough for.

    A broken plug-in is named by `vehiclemor list`, and harmless here.
    """
    known: dict[str, Any] = {}
    for name in names("method"):
        with suppress(InputError):
            known[name] = component("method", name)
    every = dict.fromkeys([*FIRST, *REDUCED, *((name, "recommended") for name in known)])
    return [
        {"method": name, "preset": preset, "settings": smaller_rank(model, name)}
        | {"label": name if preset == "recommended" else f"{name}_{preset}"}
        for name, preset in every
        if name in known
        and known[name].accepts(model)[0]
        and preset in known[name].presets_of(model.kind)
    ]


def bounds(model: Model) -> dict[str, float]:
    """Largest RMS errors that count as good: published, or a share of the range."""
    if published := rms_numbers(model.name):
        return {output: number.value for output, number in published.items()}
    outputs = model.simulate(component("maneuver", model.definition.maneuver)).outputs
    ranges = dict(zip(model.outputs, np.ptp(outputs, axis=0), strict=True))
    shown = [output for output in tabled_outputs(model.definition) if ranges[output] > 0.0]
    return {output: INDISTINGUISHABLE * float(ranges[output]) for output in shown}


def _study(name: str, kind: str, results: Path, further: dict[str, Any]) -> str:
    """Path of a study file of every method."""
    head = {"title": f"{name}: {kind} input, every method", "model": name}
    return _written(results, f"{name}-{kind}", head | {"methods": _entries(build(name))} | further)


def _written(results: Path, study: str, content: dict[str, Any]) -> str:
    path = results / "studies" / f"{study}.toml"
    return str(write_study(schema_of(content).model_validate(content), path))


def smaller_rank(model: Model, method: str) -> dict[str, int]:
    """The rank of a default row, for a method whose own default the model is too small for."""
    rank = default_rank(len(model.coordinates))
    own = default_settings(model, method).get("rank")
    return {"rank": rank} if isinstance(own, int) and own > rank else {}
