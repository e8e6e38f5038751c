"""Tables of the comparison, costs, errors, equation order and operations: CSV, Markdown, LaTeX."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import TYPE_CHECKING

from vehiclemor.files import write_text
from vehiclemor.report.compare import NOMINAL, comparison
from vehiclemor.report.costs import cost_table
from vehiclemor.simulation.build import build
from vehiclemor.simulation.trajectory import ALGEBRAIC_COUNTS, DYNAMIC_COUNTS
from vehiclemor.study.run import run_studies

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

# Model -> outputs whose errors are listed.
OUTPUTS = {
    "double_wishbone": ("spindle_y", "second_euler_angle"),
    "independent_suspension_vehicle": (
        "pitch",
        "yaw",
        "roll",
        "lateral_position",
        "vertical_speed",
    ),
    "high_fidelity_vehicle": (
        "lateral_speed",
        "vertical_speed",
        "lateral_position",
        "yaw",
        "roll",
        "position_drift",
        "velocity_drift",
    ),
}
# Name of a table -> its study over all settings, and outputs whose errors are listed.
SETTINGS = {
    "vehicle-settings": ("pitch", "yaw"),
    "high-fidelity-settings": ("lateral_speed", "vertical_speed", "position_drift"),
}
LATEX_SPECIAL = {"\\": r"\textbackslash{}"} | {c: f"\\{c}" for c in "&%$#_{}"} | {"^": r"\^{}"}


def regenerate_tables(results: Path, out: Path, jobs: int = 1) -> list[Path]:
    """Write every table in three formats.

    Returns
    -------
    list of Path
        Files written.
    """
    tables = {"comparison": comparison(results, jobs)}
    for model in OUTPUTS:
        tables[f"costs-{model}"] = cost_table(model, results)
        tables[f"errors-{model}"] = error_table(model, results, jobs)
        tables[f"operations-{model}"] = operation_table(model)
    for study in SETTINGS:
        tables[Path(study).stem] = settings_table(study, results, jobs)
    for model in ("independent_suspension_vehicle", "high_fidelity_vehicle"):
        tables[f"quantities-{model}"] = quantity_table(model, results, jobs)
    written = []
    for name, table in tables.items():
        for suffix, text in (
            ("csv", table.to_csv(index=False, lineterminator="\n")),
            ("md", markdown(table)),
            ("tex", latex(table)),
        ):
            written.append(write_text(out / f"{name}.{suffix}", text))
    return written


def error_table(model: str, results: Path, jobs: int = 1) -> pd.DataFrame:
    """RMS errors, floors, counts and status of every cell of the paper's studies of a model."""
    import pandas as pd

    parts = []
    for name, dataset in run_studies("paper", results, jobs).items():
        if dataset.attrs["model"] == model:
            parts.append(_flat(dataset, OUTPUTS[model]).assign(study=name))
    table = pd.concat(parts, ignore_index=True)
    first = ["study", "method", "start"]
    return table.reindex(columns=[*first, *(c for c in table.columns if c not in first)])


def settings_table(study: str, results: Path, jobs: int = 1) -> pd.DataFrame:
    """Control-period POD on a vehicle with every combination of its settings.

    Returns
    -------
    pandas.DataFrame
        Errors and floors of a few outputs, evaluations, largest growth rate of a reduced Jacobian,
        status and reason of each combination.
    """
    dataset = next(iter(run_studies(study, results, jobs).values()))
    return _flat(dataset, SETTINGS[study])


def quantity_table(model: str, results: Path, jobs: int = 1) -> pd.DataFrame:
    """Largest RMS errors of a vehicle's nominal runs: positions, speeds, outputs, constraints.

    Returns
    -------
    pandas.DataFrame
        For each method, start, group of quantities and unit: the largest RMS error, and of which
        quantity it is.  For constraints it is the RMS of the violation itself.
    """
    import pandas as pd

    name = NOMINAL[model]
    dataset = run_studies(name, results, jobs)[name]
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
