"""Tables of the comparison, costs, errors, equation order and operations: CSV, Markdown, LaTeX."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from vehiclemor.report.compare import comparison
from vehiclemor.report.costs import cost_table
from vehiclemor.report.regenerate import write_text
from vehiclemor.simulation.model import build
from vehiclemor.study.run import run_studies

if TYPE_CHECKING:
    import pandas as pd

MODEL = "double_wishbone"
OUTPUTS = ("spindle_y", "second_euler_angle")
LATEX_SPECIAL = {"\\": r"\textbackslash{}"} | {c: f"\\{c}" for c in "&%$#_{}"} | {"^": r"\^{}"}


def regenerate_tables(results: Path, out: Path, jobs: int = 1) -> list[Path]:
    """Write every table in three formats.

    Returns
    -------
    list of Path
        Files written.
    """
    tables = {
        "comparison": comparison("paper", results, jobs),
        "costs": cost_table(MODEL, results),
        "errors": error_table(results, jobs),
        "operations": operation_table(),
    }
    written = []
    for name, table in tables.items():
        for suffix, text in (
            ("csv", table.to_csv(index=False, lineterminator="\n")),
            ("md", markdown(table)),
            ("tex", latex(table)),
        ):
            written.append(write_text(out / f"{name}.{suffix}", text))
    return written


def error_table(results: Path, jobs: int = 1) -> pd.DataFrame:
    """RMS errors, floors, counts and status of every cell of the paper's studies."""
    import pandas as pd

    from vehiclemor.study.combine import flattened

    cells = flattened(run_studies("paper", results, jobs))
    columns: dict[str, object] = {"study": cells["study"].values}
    for name in ("frequency_factor", "amplitude_factor", "control_period", "equation_seed"):
        columns[name] = cells[name].values
    columns |= {"rounding_seed": cells["rounding_seed"].values, "method": cells["method"].values}
    columns |= {"rank": cells["rank"].values, "effective_rank": cells["effective_rank"].values}
    for output in OUTPUTS:
        columns[f"rms_{output}"] = cells["rms_error"].sel(output=output).values
        columns[f"floor_{output}"] = cells["floor_rms_error"].sel(output=output).values
    for name in ("iterations", "residual_evaluations", "status", "message"):
        columns[name] = cells[name].values
    return pd.DataFrame(columns)


def operation_table() -> pd.DataFrame:
    """Exact operation counts of the generated kernels."""
    import pandas as pd

    counts = build(MODEL).operation_counts
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
