"""Which comparisons there are: with the paper, on unseen inputs, of every model, of any study."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from vehiclemor.arguments import count, file_path
from vehiclemor.errors import InputError
from vehiclemor.registry import names, unknown
from vehiclemor.resources import data_names

if TYPE_CHECKING:
    import pandas as pd


def compare(
    what: str = "paper", out: str | Path = "results", jobs: int = 1, seed: int | None = None
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
        that the paper doesn't have), measure, reason, threshold_source; described at
        `comparison.rows.Row`, those of the others at `predictive_comparison`,
        `model_comparison` and `study_comparison` in `vehiclemor.report`.

    Raises
    ------
    InputError
        If there is no such comparison.
    """
    folder, jobs = file_path("out", out), count("jobs", jobs)
    if seed is not None and (what == "paper" or what in names("model")):
        raise InputError(f"seed: comparison {what!r} draws no test runs of its own")
    if what == "paper":
        from vehiclemor.report.comparison.paper import paper_comparison

        return paper_comparison(folder, jobs)
    if what == "predictive":
        from vehiclemor.report.predictive.rows import predictive_comparison

        return predictive_comparison(folder, jobs, seed=seed)
    if what in names("model"):
        from vehiclemor.report.comparison.model import model_comparison

        return model_comparison(what, folder, jobs)
    if isinstance(what, str) and (what in data_names("studies") or what.endswith(".toml")):
        from vehiclemor.report.comparison.study import study_comparison

        return study_comparison(what, folder, jobs, seed)
    known = ["paper", "predictive", *names("model"), *data_names("studies"), "FILE.toml"]
    raise unknown("comparison", what, known)


def comparison_text(what: str, rows: pd.DataFrame, folder: Path) -> str:
    """A comparison as text, with the costs of its models."""
    if what == "paper":
        from vehiclemor.report.comparison.text import paper_text

        return paper_text(rows, folder)
    if what == "predictive":
        from vehiclemor.report.predictive.text import predictive_text

        return predictive_text(rows)
    if what in names("model"):
        from vehiclemor.report.comparison.model import model_text

        return model_text(what, rows, folder)
    from vehiclemor.report.comparison.study import study_text

    return study_text(rows)
