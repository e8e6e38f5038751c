"""Comparisons: with the paper, of every model, of any study; costs, and handling tests."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from vehiclemor.arguments import file_path
from vehiclemor.exceptions import InputError
from vehiclemor.files import data_names
from vehiclemor.handling.metrics import RACK, TESTS, declared, metrics, test_of
from vehiclemor.inputs.maneuver import registered
from vehiclemor.reduction.reduced_model import ReducedOrderModel
from vehiclemor.registry import component, names, unknown
from vehiclemor.report.default_studies import nominal, perturbed, unseen
from vehiclemor.report.labels import of_kind, timing_cases
from vehiclemor.report.published import TIMING, number_rows, printed_errors_and_savings
from vehiclemor.report.results import frame, grid_rows, result_kind
from vehiclemor.report.unseen import protocol_rows
from vehiclemor.simulation.build import build
from vehiclemor.simulation.trajectory import Trajectory
from vehiclemor.study.experiment import complete_settings, make_experiment
from vehiclemor.study.plans.loading import is_study
from vehiclemor.study.run import run_studies
from vehiclemor.study.scenario import Scenario
from vehiclemor.study.timing import timed_starts

PAPER = "paper"
# The paper says nothing of another start.
PUBLISHED_START = "equilibrium"
# Hz: frequencies of a response that are printed.
PRINTED = (0.5, 1.0)
Row = dict[str, Any]


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


# Handling tests, full and reduced models side by side.


def maneuvers_of(full: ReducedOrderModel, reduced: Iterable[ReducedOrderModel]) -> list[str]:
    """Registered maneuvers with numbers, whose inputs all models have, in the order of the tests.

    The full model has its optional inputs too.  `InputError` if there are none.
    """
    definition = full.model.definition
    every = (*definition.inputs, *definition.optional_inputs)
    shared = {quantity.name for quantity in every}.intersection(*(r.inputs for r in reduced))
    known = {*names("maneuver")}
    wanted = [name for test in TESTS for name in (test, RACK + test) if name in known]
    fitting = [name for name in wanted if shared.issuperset(registered(name).inputs)]
    if not fitting:
        raise InputError(f"{definition.name} is no vehicle of the tests: {', '.join(TESTS)}")
    return fitting


def handling_rows(
    models: Mapping[str, ReducedOrderModel], maneuvers: Iterable[str], amplitude: float
) -> list[dict[str, Any]]:
    """A row for each number, with a column for each model by its name.

    The first model is the full one: all runs start from its state, and by default all maneuvers are
    taken whose inputs all models have.
    """
    first, *reduced = models.values()
    start, speed = first.model.start(), first.parameters.get("initial_speed", np.nan)
    chosen = list(maneuvers) or maneuvers_of(first, reduced)
    standards = {name: declared().standards[test_of(name)] for name in chosen}
    rows: list[dict[str, Any]] = []
    for name, standard in standards.items():
        maneuver = registered(name).perturbed(amplitude=amplitude)
        runs = {key: model.simulate(maneuver, start) for key, model in models.items()}
        remarks = [f"{key}: {run.message}" for key, run in runs.items() if run.message]
        test = "; ".join([f"{name} ({standard}), {speed:.4g} m/s", *remarks])
        values = {key: _values(run) for key, run in runs.items() if run.finished}
        # Names and units, in the order of the first run that has come to its end.
        for number, unit in next(iter(values.values()), [("no numbers", "")]):
            columns = {key: values.get(key, {}).get((number, unit), np.nan) for key in models}
            rows.append({"test": test, "number": number, "unit": unit} | columns)
    return rows


def _values(run: Trajectory) -> dict[tuple[str, str], float]:
    """Name, with its frequency if there is one, and unit of a number -> value."""
    values: dict[tuple[str, str], float] = {}
    for key, number in metrics(run).drop_vars("speed").data_vars.items():
        name, unit = str(key).replace("_", " "), str(number.attrs["units"])
        if not number.dims:
            values[name, unit] = float(number)
            continue
        for hertz in PRINTED:
            at = number.sel(frequency=hertz, method="nearest")
            values[f"{name} at {hertz:g} Hz", unit] = float(at)
    return values
