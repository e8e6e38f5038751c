"""Comparisons: with the paper, on unseen inputs, of every model, of any study."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from vehiclemor.arguments import count, file_path
from vehiclemor.errors import InputError
from vehiclemor.registry import names, unknown
from vehiclemor.resources import data_names

if TYPE_CHECKING:
    import pandas as pd

PAPER, PREDICTIVE = "paper", "predictive"


def compare(
    what: str = PAPER, out: str | Path = "results", jobs: int = 1, seed: int | None = None
) -> pd.DataFrame:
    """A comparison as a table; studies and timings that are missing are run first.

    Parameters
    ----------
    what
        `paper`: published beside reproduced.  `predictive`: reduced models on inputs that they have
        not seen, beside full-order integrators.  The name of a model: every method that fits it,
        nominal, perturbed and on unseen inputs, with costs.  A study, collection or protocol, by
        name or TOML file: errors of every method over the grid, or on the protocol's inputs.
    out
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
        described at `comparison.rows.Row`, those of the others at `predictive_comparison`,
        `model_comparison` and `study_comparison` in `vehiclemor.report`.

    Raises
    ------
    InputError
        If there is no such comparison.
    """
    folder, jobs = file_path("out", out), count("jobs", jobs)
    if seed is not None and (what == PAPER or what in names("model")):
        raise InputError(f"seed: comparison {what!r} draws no test runs of its own")
    if what == PAPER:
        return paper_comparison(folder, jobs)
    if what == PREDICTIVE:
        from vehiclemor.report.predictive.rows import predictive_comparison

        return predictive_comparison(folder, jobs, seed=seed)
    if what in names("model"):
        return model_comparison(what, folder, jobs)
    if isinstance(what, str) and (what in data_names("studies") or what.endswith(".toml")):
        return study_comparison(what, folder, jobs, seed)
    known = [PAPER, PREDICTIVE, *names("model"), *data_names("studies"), "FILE.toml"]
    raise unknown("comparison", what, known)


def paper_comparison(folder: Path, jobs: int = 1) -> pd.DataFrame:
    """Every number and claim of the paper, with verdict and reason.

    Returns
    -------
    pandas.DataFrame
        One row for each published number or claim, start and variant of the method, with the
        columns of `rows.Row`.
    """
    import pandas as pd

    from vehiclemor.report.comparison import rows as of
    from vehiclemor.report.comparison.times import (
        AGREE_AND_SAVE,
        SIX_SLOWER,
        agreement_rows,
        slower_row,
        time_rows,
    )
    from vehiclemor.report.costs import cost_table
    from vehiclemor.report.default_studies import of_paper
    from vehiclemor.report.published import load_published
    from vehiclemor.study.run import run_studies

    results, published = run_studies("paper", folder, jobs), load_published()
    numbers = [n for n in published.numbers.values() if n.kind in ("rms_error", "time_reduction")]
    models = [m for m in dict.fromkeys(n.model for n in numbers) if m in names("model")]
    costs = {model: cost_table(model, folder) for model in models}
    errors: list[of.Row] = []
    times: list[of.Row] = []
    rest: list[of.Row] = []
    for number in numbers:
        if number.model not in costs:
            rest.append(of.not_comparable(number, "this model is not in the suite yet"))
        elif number.kind == "rms_error":
            errors += of.error_rows(number, results[of_paper(number.model)])
        else:
            times += time_rows(number, costs[number.model])
    for name, claim in published.claims.items():
        if name == SIX_SLOWER:
            rest.append(slower_row(claim, costs["double_wishbone"], few=3, many=6))
        elif name == AGREE_AND_SAVE:
            rest += agreement_rows(claim, errors, times)
        elif name in of.OF_DESIGN:
            rest += of.design_rows(claim)
        elif claim.model is None or claim.model in costs:
            rest += of.claim_rows(claim, results)
    rows = pd.DataFrame([*errors, *times, *rest], columns=list(of.COLUMNS))
    place = {model: number for number, model in enumerate(models)}
    return rows.sort_values("model", key=lambda c: c.map(place), kind="stable", ignore_index=True)


def model_comparison(name: str, folder: Path, jobs: int = 1) -> pd.DataFrame:
    """Every registered method that fits, on one model; what is missing is run first.

    Returns
    -------
    pandas.DataFrame
        `kind` tells what a row is.  `nominal`, `perturbed`: one run of a method, as in
        `frames.study_tables`.  `cost`, `spectrum`: as in `cost_table`, `spectrum_table`.  The
        others are those of `predictive_comparison`.
    """
    import pandas as pd

    from vehiclemor.reduction.methods import pod
    from vehiclemor.report.costs import cost_table
    from vehiclemor.report.default_studies import nominal, perturbed, unseen
    from vehiclemor.report.frames import study_tables
    from vehiclemor.report.predictive.rows import predictive_comparison
    from vehiclemor.report.spectrum import spectrum_table
    from vehiclemor.simulation.build import build

    studies = {"nominal": nominal(name, folder), "perturbed": perturbed(name, folder)}
    parts = [study_tables(name, [s], folder, jobs).assign(kind=k) for k, s in studies.items()]
    parts.append(cost_table(name, folder).assign(kind="cost"))
    if pod.METHOD.accepts(build(name))[0]:
        parts.append(spectrum_table(name).assign(kind="spectrum"))
    parts.append(predictive_comparison(folder, jobs, study=unseen(name, folder)))
    return pd.concat(parts, ignore_index=True).assign(model=name)


def study_comparison(
    study: str, folder: Path, jobs: int = 1, seed: int | None = None
) -> pd.DataFrame:
    """A study, all members of a collection, or a protocol; what is missing is run first.

    Returns
    -------
    pandas.DataFrame
        `study` and `kind` tell what a row is.  `errors`: an output of one method from one start
        over a study's grid, see `frames.grid_rows`.  The others are those of
        `predictive_comparison`.
    """
    import pandas as pd

    from vehiclemor.report.frames import grid_rows
    from vehiclemor.report.predictive.rows import protocol_rows
    from vehiclemor.study.run import run_studies

    rows: list[dict[str, Any]] = []
    for dataset in run_studies(study, folder, jobs, seed=seed).values():
        rows += protocol_rows(dataset) if "scenario_set" in dataset.coords else grid_rows(dataset)
    return pd.DataFrame(rows)
