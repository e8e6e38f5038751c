"""Which comparisons there are: with the paper, on unseen inputs, of every model, of any study."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from vehiclemor.registry import names, unknown
from vehiclemor.resources import data_names

if TYPE_CHECKING:
    import pandas as pd


def comparison(what: str, folder: Path, jobs: int = 1) -> pd.DataFrame:
    """A comparison as a table; studies and timings that are missing are run first.

    Parameters
    ----------
    what
        `paper`, `predictive`, the name of a model, or a study by its name or TOML file.

    Raises
    ------
    InputError
        If there is no such comparison.
    """
    if what == "paper":
        from vehiclemor.report.comparison.paper import paper_comparison

        return paper_comparison(folder, jobs)
    if what == "predictive":
        from vehiclemor.report.predictive.rows import predictive_comparison

        return predictive_comparison(folder, jobs)
    if what in names("model"):
        from vehiclemor.report.comparison.model import model_comparison

        return model_comparison(what, folder, jobs)
    if what in data_names("studies") or what.endswith(".toml"):
        from vehiclemor.report.comparison.study import study_comparison

        return study_comparison(what, folder, jobs)
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
