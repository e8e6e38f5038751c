"""Tables of the comparison, costs, errors, equation order and operations: CSV, Markdown, LaTeX."""

from pathlib import Path

import pandas as pd

from vehiclemor.files import write_text
from vehiclemor.reduction.methods import pod
from vehiclemor.registry import component, names
from vehiclemor.report.comparison.paper import paper_comparison
from vehiclemor.report.costs import cost_table
from vehiclemor.report.errors import error_table, quantity_table, settings_table
from vehiclemor.report.shown import tables_file
from vehiclemor.report.spectrum import spectrum_table
from vehiclemor.simulation.build import build

LATEX_SPECIAL = {"\\": r"\textbackslash{}"} | {c: f"\\{c}" for c in "&%$#_{}"} | {"^": r"\^{}"}


def regenerate_tables(results: Path, out: Path, jobs: int = 1) -> list[Path]:
    """Write every table of every registered model in three formats; the files written."""
    tables = {"comparison": paper_comparison(results, jobs)}
    for model in names("model"):
        tables |= {f"{name}-{model}": t for name, t in model_tables(model, results, jobs).items()}
    for study, outputs in tables_file().settings.items():
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
    """Tables that every model has: costs, errors, spectrum, operations."""
    tables = {
        "costs": cost_table(model, results),
        "errors": error_table(model, results, jobs),
        "operations": operation_table(model),
    }
    if pod.METHOD.accepts(build(model))[0]:
        tables["spectrum"] = spectrum_table(model)
    if component("model", model).speeds:
        tables["quantities"] = quantity_table(model, results, jobs)
    return tables


def operation_table(model: str) -> pd.DataFrame:
    """Exact operation counts of a model's generated kernels."""
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
