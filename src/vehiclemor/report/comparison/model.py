"""One model, whatever it declares: errors of every method, costs, unseen inputs, paper's terms."""

from pathlib import Path

import pandas as pd

from vehiclemor.registry import component
from vehiclemor.report.costs import cost_table, costs_text
from vehiclemor.report.default_studies import nominal, perturbed, unseen
from vehiclemor.report.errors import study_tables
from vehiclemor.report.labels import label_of
from vehiclemor.report.predictive.paper_terms import paper_terms_rows
from vehiclemor.report.predictive.rows import predictive_comparison
from vehiclemor.report.predictive.text import predictive_text
from vehiclemor.report.printing import Line, power, table_text, wrapped

LEGEND = (
    "RMS errors in the nominal run, on which the methods are trained (replay is exact there), and "
    "the largest over perturbations of frequency and amplitude by up to 20 %, with the training "
    "unchanged; SI units"
)


def model_comparison(name: str, folder: Path, jobs: int = 1) -> pd.DataFrame:
    """Every registered method that fits, on one model; what is missing is run first.

    Returns
    -------
    pandas.DataFrame
        `kind` tells what a row is.  `nominal`, `perturbed`: one run of a method, as in
        `errors.study_tables`.  `cost`: as in `cost_table`.  The others are those of
        `predictive_comparison`.
    """
    studies = {"nominal": nominal(name, folder), "perturbed": perturbed(name, folder)}
    parts = [study_tables(name, [s], folder, jobs).assign(kind=k) for k, s in studies.items()]
    parts.append(cost_table(name, folder).assign(kind="cost"))
    parts.append(predictive_comparison(folder, jobs, study=unseen(name, folder)))
    parts.append(pd.DataFrame(paper_terms_rows([name], folder)))
    return pd.concat(parts, ignore_index=True).assign(model=name)


def model_text(name: str, rows: pd.DataFrame, folder: Path) -> str:
    """The comparison of a model as text."""
    columns = {
        f"rms_{o}": label_of(o).short for o in component("model", name).shown.printed_outputs
    }
    records = rows.to_dict("records")
    printed: list[Line] = []
    for row in records:
        if row["kind"] != "nominal":
            continue
        # A run that has failed leaves no error, and then there is no largest one.
        same = [r for r in records if r["kind"] == "perturbed" and r["method"] == row["method"]]
        moved = {c: max((r[c] for r in same), key=lambda e: (e != e, e)) for c in columns}
        cells = [f"{row['method']}, {row['start']}", str(int(row["effective_rank"]))]
        cells += [power(errors[column]) for column in columns for errors in (row, moved)]
        printed.append(Line(cells, "" if row["status"] == "ok" else row["message"]))
    heads = ["method, start", "rank"]
    heads += [f"{short} {kind}" for short in columns.values() for kind in ("nominal", "perturbed")]
    title = f"{name}\n{wrapped(LEGEND)}\n{table_text(heads, printed)}"
    rest = rows.loc[~rows["kind"].isin(["nominal", "perturbed", "cost"])]
    return "\n\n".join([title, costs_text(name, folder), predictive_text(rest)])
