"""Comparisons: with the paper, on unseen inputs, of every model, of any study."""

from pathlib import Path
from typing import Any

import pandas as pd

from vehiclemor.arguments import count, file_path
from vehiclemor.errors import InputError
from vehiclemor.reduction.methods import pod
from vehiclemor.registry import names, unknown
from vehiclemor.report.comparison.rows import (
    COLUMNS,
    OF_DESIGN,
    Row,
    claim_rows,
    design_rows,
    error_rows,
)
from vehiclemor.report.comparison.times import (
    AGREE_AND_SAVE,
    SIX_SLOWER,
    agreement_rows,
    slower_row,
    time_rows,
)
from vehiclemor.report.costs import cost_table
from vehiclemor.report.default_studies import nominal, of_paper, perturbed, unseen
from vehiclemor.report.frames import grid_rows, study_tables
from vehiclemor.report.predictive.rows import protocol_rows
from vehiclemor.report.published import load_published
from vehiclemor.report.spectrum import spectrum_table
from vehiclemor.resources import data_names
from vehiclemor.simulation.build import build
from vehiclemor.study.run import run_studies

PAPER = "paper"


def compare(
    what: str = PAPER, results: str | Path = "results", jobs: int = 1, seed: int | None = None
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
        Draws fresh test runs for an audit: of `predictive`, or of a protocol.

    Returns
    -------
    pandas.DataFrame
        Of `paper` the columns id, model, item, variant, start, published, bound, reproduced, unit,
        floor, replay, within, verdict (`met`, `missed`, `not_comparable`, or `ours`: from a start
        that the paper doesn't have), measure, reason, threshold_source, signal_rms, strongest;
        described at `rows.Row` in `vehiclemor.report.comparison`, those of the others at
        `kinds.model_comparison` and `kinds.study_comparison`.

    Raises
    ------
    InputError
        If there is no such comparison.
    """
    folder, jobs = file_path("results", results), count("jobs", jobs)
    if seed is not None and (what == PAPER or what in names("model")):
        raise InputError(f"seed: comparison {what!r} draws no test runs of its own")
    if what == PAPER:
        return paper_comparison(folder, jobs)
    if what in names("model"):
        return model_comparison(what, folder, jobs)
    if isinstance(what, str) and (what in data_names("studies") or what.endswith(".toml")):
        return study_comparison(what, folder, jobs, seed)
    known = [PAPER, *names("model"), *data_names("studies"), "FILE.toml"]
    raise unknown("comparison", what, known)


def paper_comparison(folder: Path, jobs: int = 1) -> pd.DataFrame:
    """Every number and claim of the paper, with verdict and reason.

    Returns
    -------
    pandas.DataFrame
        One row for each published number or claim, start and variant of the method, with the
        columns of `rows.Row`.
    """
    results, published = run_studies("paper", folder, jobs), load_published()
    numbers = [n for n in published.numbers.values() if n.kind in ("rms_error", "time_reduction")]
    costs = {m: cost_table(m, folder) for m in dict.fromkeys(n.model for n in numbers)}
    errors: list[Row] = []
    times: list[Row] = []
    rest: list[Row] = []
    for number in numbers:
        if number.kind == "rms_error":
            errors += error_rows(number, results[of_paper(number.model)])
        else:
            times += time_rows(number, costs[number.model])
    for name, claim in published.claims.items():
        if name == SIX_SLOWER:
            rest.append(slower_row(claim, costs["double_wishbone"], few=3, many=6))
        elif name == AGREE_AND_SAVE:
            rest += agreement_rows(claim, errors, times)
        elif name in OF_DESIGN:
            rest += design_rows(claim)
        else:
            rest += claim_rows(claim, results)
    rows = pd.DataFrame([*errors, *times, *rest], columns=list(COLUMNS))
    place = {model: number for number, model in enumerate(costs)}
    return rows.sort_values("model", key=lambda c: c.map(place), kind="stable", ignore_index=True)


def model_comparison(name: str, folder: Path, jobs: int = 1) -> pd.DataFrame:
    """Every registered method that fits, on one model; what is missing is run first.

    Returns
    -------
    pandas.DataFrame
        `kind` tells what a row is.  `nominal`, `perturbed`: one run of a method, as in
        `frames.study_tables`.  `cost`, `spectrum`: as in `cost_table`, `spectrum_table`.  The
        others are those of `study_comparison`, of the model's protocol.
    """
    studies = {"nominal": nominal(name, folder), "perturbed": perturbed(name, folder)}
    parts = [study_tables(name, [s], folder, jobs).assign(kind=k) for k, s in studies.items()]
    parts.append(cost_table(name, folder).assign(kind="cost"))
    if pod.METHOD.accepts(build(name))[0]:
        parts.append(spectrum_table(name).assign(kind="spectrum"))
    parts.append(study_comparison(unseen(name, folder), folder, jobs))
    return pd.concat(parts, ignore_index=True).assign(model=name)


def study_comparison(
    study: str, folder: Path, jobs: int = 1, seed: int | None = None
) -> pd.DataFrame:
    """A study, all members of a collection, or a protocol; what is missing is run first.

    Returns
    -------
    pandas.DataFrame
        `study` and `kind` tell what a row is.  `errors`: an output of one method from one start
        over a study's grid, see `frames.grid_rows`.  `method`: one contestant of a protocol on what
        is judged, see `predictive.rows.method_rows`.  `target`: what the contender that validation
        has chosen must reach, with `id`, `bound`, `measured`, `unit`, `verdict`, `reason` and
        `threshold_source`.  Errors `worst_<measure>_<output>` are in SI units.
    """
    rows: list[dict[str, Any]] = []
    for dataset in run_studies(study, folder, jobs, seed=seed).values():
        rows += protocol_rows(dataset) if "scenario_set" in dataset.coords else grid_rows(dataset)
    return pd.DataFrame(rows)
