"""Which comparisons there are: with the paper, on unseen inputs, and of every model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from vehiclemor.registry import names, unknown

if TYPE_CHECKING:
    import pandas as pd


def comparison(what: str, folder: Path, jobs: int = 1) -> pd.DataFrame:
    """A comparison as a table; studies and timings that are missing are run first.

    Parameters
    ----------
    what
        `paper`, `predictive`, or the name of a model.

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
    raise unknown("comparison", what, ["paper", "predictive", *names("model")])


def comparison_text(what: str, rows: pd.DataFrame, folder: Path) -> str:
    """A comparison as text, with the costs of its models."""
    if what == "paper":
        from vehiclemor.report.comparison.text import paper_text

        return paper_text(rows, folder)
    if what == "predictive":
        from vehiclemor.report.predictive.text import predictive_text

        return predictive_text(rows)
    from vehiclemor.report.comparison.model import model_text

    return model_text(what, rows, folder)
