"""Tables of the comparison, costs, errors, equation order and operations: CSV, Markdown, LaTeX."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import TYPE_CHECKING

from vehiclemor.files import write_text
from vehiclemor.models.report import tabled_outputs
from vehiclemor.registry import component, names
from vehiclemor.report.comparison.paper import paper_comparison
from vehiclemor.report.costs import cost_table
from vehiclemor.report.default_studies import nominal, perturbed
from vehiclemor.report.predictive.paper_terms import paper_terms_rows
from vehiclemor.simulation.build import build
from vehiclemor.simulation.trajectory import ALGEBRAIC_COUNTS, DYNAMIC_COUNTS
from vehiclemor.study.run import run_studies

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

LATEX_SPECIAL = {"\\": r"\textbackslash{}"} | {c: f"\\{c}" for c in "&%$#_{}"} | {"^": r"\^{}"}


def regenerate_tables(results: Path, out: Path, jobs: int = 1) -> list[Path]:
    """Write every table of every registered model in three formats.

    Returns
    -------
    list of Path
        Files written.
    """
    tables = {"comparison": paper_comparison(results, jobs)}
    for model in names("model"):
        tables |= {f"{name}-{model}": t for name, t in model_tables(model, results, jobs).items()}
    for study, outputs in settings_studies().items():
        tables[Path(study).stem] = settings_table(study, outputs, results, jobs)
    written: list[Path] = []
    for name, table in tables.items():
        for suffix, text in (
            ("csv", table.to_csv(index=False, lineterminator="\n")),
            ("md", markdown(table)),
            ("tex", latex(table)),
        ):
            written.append(write_text(out / f"{name}.{suffix}", text))
    return written


def model_tables(model: str, results: Path, jobs: int = 1) -> dict[str, pd.DataFrame]:
    """Tables that every model has: costs, errors, paper's terms, operations, quantities."""
    import pandas as pd

    tables = {
        "costs": cost_table(model, results),
        "errors": error_table(model, results, jobs),
        "paper-terms": pd.DataFrame(paper_terms_rows([model], results)),
        "operations": operation_table(model),
    }
    if component("model", model).speeds:
        tables["quantities"] = quantity_table(model, results, jobs)
    return tables


def settings_studies() -> dict[str, tuple[str, ...]]:
    """Studies over all settings of control-period POD -> outputs whose errors are listed."""
    reports = [component("model", model).report for model in names("model")]
    return {r.settings_study: r.settings_outputs for r in reports if r.settings_study}


def error_table(model: str, results: Path, jobs: int = 1) -> pd.DataFrame:
    """RMS errors, floors, counts and status of every cell of a model's studies.

    These are the paper's, or of a model that the paper does not have its nominal and perturbed
    runs with every method.
    """
    import pandas as pd

    outputs = tabled_outputs(component("model", model))
    datasets = run_studies("paper", results, jobs)
    if not any(dataset.attrs["model"] == model for dataset in datasets.values()):
        studies = nominal(model, results), perturbed(model, results)
        datasets = {k: v for study in studies for k, v in run_studies(study, results, jobs).items()}
    parts = [
        _flat(dataset, outputs).assign(study=name)
        for name, dataset in datasets.items()
        if dataset.attrs["model"] == model
    ]
    table = pd.concat(parts, ignore_index=True)
    first = ["study", "method", "start"]
    return table.reindex(columns=[*first, *(c for c in table.columns if c not in first)])


def settings_table(
    study: str, outputs: tuple[str, ...], results: Path, jobs: int = 1
) -> pd.DataFrame:
    """Control-period POD on a vehicle with every combination of its settings.

    Returns
    -------
    pandas.DataFrame
        Errors and floors of a few outputs, evaluations, largest growth rate of a reduced Jacobian,
        status and reason of each combination.
    """
    dataset = next(iter(run_studies(study, results, jobs).values()))
    return _flat(dataset, outputs)


def quantity_table(model: str, results: Path, jobs: int = 1) -> pd.DataFrame:
    """Largest RMS errors of a vehicle's nominal runs: positions, speeds, outputs, constraints.

    Returns
    -------
    pandas.DataFrame
        For each method, start, group of quantities and unit: the largest RMS error, and of which
        quantity it is.  For constraints it is the RMS of the violation itself.
    """
    import pandas as pd

    study = component("model", model).report.study or nominal(model, results)
    dataset = next(iter(run_studies(study, results, jobs).values()))
    rows: list[dict[str, object]] = []
    for label, start in itertools.product(dataset["method"].values, dataset["start"].values):
        point = dataset.sel({"method": label, "start": start}).squeeze(drop=True)
        groups = {
            "coordinate": point["rms_coordinate_error"].to_series(),
            "speed": point["rms_speed_error"].to_series(),
            "output": point["rms_error"].to_series(),
        }
        units = {key: point[f"{key}_unit"].to_series() for key in groups}
        drifts = [str(o) for o in point["output"].values if str(o).endswith("_drift")]
        if drifts:
            squares = point["outputs"].sel(output=drifts) ** 2
            groups["constraint"] = (squares.mean("time", skipna=False) ** 0.5).to_series()
            units["constraint"] = units["output"].loc[drifts]
            groups["output"] = groups["output"].drop(drifts)
        place = {"method": label, "start": start, "status": str(point["status"].item())}
        for group, errors in groups.items():
            for unit, part in errors.groupby(units[group].loc[errors.index]):
                worst = part.idxmax() if part.notna().all() else ""
                entry = {"group": group, "unit": unit, "quantity": worst, "rms": part.max()}
                rows.append(place | entry)
    return pd.DataFrame(rows)


def _flat(dataset: xr.Dataset, outputs: tuple[str, ...]) -> pd.DataFrame:
    """One row for each cell of a study: its place in the grid, errors, counts, status."""
    grid = list(dataset["status"].dims)
    kept = ["effective_rank", *(DYNAMIC_COUNTS | ALGEBRAIC_COUNTS), "growth_rate"]
    scalars = [name for name in kept if name in dataset]
    table = dataset[[*scalars, "status", "message"]].to_dataframe().reset_index()
    for output in outputs:
        for name, short in (("rms_error", "rms"), ("floor_rms_error", "floor")):
            values = dataset[name].sel(output=output).transpose(*grid)
            table[f"{short}_{output}"] = values.to_series().to_numpy()
    columns = [*grid, *(c for c in table.columns if c.startswith(("rms_", "floor_"))), *scalars]
    return table.reindex(columns=[*columns, "status", "message"])


def operation_table(model: str) -> pd.DataFrame:
    """Exact operation counts of a model's generated kernels."""
    import pandas as pd

    counts = build(model).operation_counts
    return pd.DataFrame([{"kernel": name, **count} for name, count in counts.items()])


def _text(value: object) -> str:
    if isinstance(value, float):
        return "" if value != value else f"{value:.4g}"
    return str(value)


def markdown(table: pd.DataFrame) -> str:
    """The table as Markdown."""
    lines = ["| " + " | ".join(str(c) for c in table.columns) + " |"]
    lines.append("|" + "---|" * len(table.columns))
    lines += [
        "| " + " | ".join(_text(v).replace("|", "\\|") for v in row) + " |"
        for row in table.itertuples(index=False)
    ]
    return "\n".join(lines) + "\n"


def latex(table: pd.DataFrame) -> str:
    """The table as a LaTeX tabular (needs booktabs)."""

    def escaped(value: object) -> str:
        return "".join(LATEX_SPECIAL.get(character, character) for character in _text(value))

    lines = [rf"\begin{{tabular}}{{{'l' * len(table.columns)}}}", r"\toprule"]
    lines.append(" & ".join(escaped(c) for c in table.columns) + r" \\")
    lines.append(r"\midrule")
    lines += [" & ".join(escaped(v) for v in row) + r" \\" for row in table.itertuples(index=False)]
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}"]) + "\n"
