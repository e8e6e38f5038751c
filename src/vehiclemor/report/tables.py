"""Tables of the comparison, costs, errors, equation order and operations: CSV, Markdown, LaTeX."""

from pathlib import Path

import pandas as pd

from vehiclemor.files import write_text
from vehiclemor.reduction.methods import pod
from vehiclemor.registry import component, names
from vehiclemor.report.comparison.kinds import paper_comparison
from vehiclemor.report.costs import cost_table
from vehiclemor.report.frames import error_table, quantity_table, settings_table
from vehiclemor.report.printing import Format, table
from vehiclemor.report.shown import tables_file
from vehiclemor.report.spectrum import spectrum_table
from vehiclemor.simulation.build import build

FORMATS: dict[str, Format] = {"csv": "csv", "md": "markdown", "tex": "latex"}


def regenerate_tables(results: Path, out: Path, jobs: int = 1) -> list[Path]:
    """Write every table of every registered model in three formats; the files written."""
    tables = {"comparison": paper_comparison(results, jobs)}
    for model in names("model"):
        tables |= {f"{name}-{model}": t for name, t in model_tables(model, results, jobs).items()}
    for study, outputs in tables_file().settings.items():
        tables[Path(study).stem] = settings_table(study, outputs, results, jobs)
    written: list[Path] = []
    for name, rows in tables.items():
        for suffix, to in FORMATS.items():
            written.append(write_text(out / f"{name}.{suffix}", table(rows, to=to)))
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
