"""One model, whatever it declares: errors of every method, costs, unseen inputs."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from vehiclemor.reduction.methods import pod
from vehiclemor.registry import component
from vehiclemor.report.costs import LEGEND as COSTS
from vehiclemor.report.costs import cost_table, costs_text
from vehiclemor.report.default_studies import nominal, perturbed, unseen
from vehiclemor.report.errors import study_tables
from vehiclemor.report.labels import label_of
from vehiclemor.report.predictive.rows import predictive_comparison
from vehiclemor.report.predictive.text import predictive_text
from vehiclemor.report.printing import Footnotes, Line, power, table_text, wrapped
from vehiclemor.report.shown import main_outputs
from vehiclemor.report.spectrum import spectrum_table, spectrum_text
from vehiclemor.simulation.build import build

LEGEND = (
    "RMS errors, SI units; nom.: in the nominal run, on which the methods are trained (replay is "
    "exact there); pert.: the largest over perturbations of frequency and amplitude by up to 20 %, "
    "with the training unchanged, from the model's first start; failed: in some of them; "
    "-: exactly zero, or none"
)


def model_comparison(name: str, folder: Path, jobs: int = 1) -> pd.DataFrame:
    """Every registered method that fits, on one model; what is missing is run first.

    Returns
    -------
    pandas.DataFrame
        `kind` tells what a row is.  `nominal`, `perturbed`: one run of a method, as in
        `errors.study_tables`.  `cost`, `spectrum`: as in `cost_table`, `spectrum_table`.  The
        others are those of `predictive_comparison`.
    """
    studies = {"nominal": nominal(name, folder), "perturbed": perturbed(name, folder)}
    parts = [study_tables(name, [s], folder, jobs).assign(kind=k) for k, s in studies.items()]
    parts.append(cost_table(name, folder).assign(kind="cost"))
    if pod.METHOD.accepts(build(name))[0]:
        parts.append(spectrum_table(name).assign(kind="spectrum"))
    parts.append(predictive_comparison(folder, jobs, study=unseen(name, folder)))
    return pd.concat(parts, ignore_index=True).assign(model=name)


def _largest(rows: Sequence[Mapping[str, Any]], column: str) -> str:
    """The largest error; a run that has failed leaves none, and then there is no largest one."""
    if any(row["status"] != "ok" for row in rows):
        return "failed"
    return power(max((row[column] for row in rows), default=math.nan))


def model_text(name: str, rows: pd.DataFrame, folder: Path) -> str:
    """The comparison of a model as text."""
    shown = main_outputs(component("model", name))
    columns = {f"rms_{output}": label_of(output).short for output in shown}
    records, notes = rows.to_dict("records"), Footnotes()
    nominal_runs = [row for row in records if row["kind"] == "nominal"]
    lines: list[Line] = []
    for start in dict.fromkeys(row["start"] for row in nominal_runs):
        heading = f"start {start}"
        for row in [row for row in nominal_runs if row["start"] == start]:
            same = [
                r
                for r in records
                if r["kind"] == "perturbed"
                and (r["label"], r["start"]) == (row["label"], row["start"])
            ]
            told = notes.marks("" if row["status"] == "ok" else row["message"])
            cells = [f"{row['label']} {told}".rstrip(), str(int(row["effective_rank"]))]
            cells += [cell for c in columns for cell in (power(row[c]), _largest(same, c))]
            lines.append(Line(cells, heading=heading))
            heading = ""
    heads = ["method", "rank"]
    heads += [f"{short} {kind}" for short in columns.values() for kind in ("nom.", "pert.")]
    title = "\n".join([name, wrapped(f"{LEGEND}."), table_text(heads, lines), notes.text()])
    rest = rows.loc[~rows["kind"].isin(["nominal", "perturbed", "cost", "spectrum"])]
    modes = [row for row in records if row["kind"] == "spectrum"]
    costs = f"{wrapped(f'{COSTS}.')}\n{costs_text(name, folder)}"
    found = [spectrum_text(modes)] if modes else []
    return "\n\n".join([title.rstrip(), costs, *found, predictive_text(rest)])
