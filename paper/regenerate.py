"""Regenerates all figures and tables of the paper from stored results.

Usage: python paper/regenerate.py [--results DIR] [--out DIR] [--jobs N]

Studies and timings that the results folder lacks are run first.  Two regenerations from the same
results give byte-identical files.
"""

import argparse
import sys
from pathlib import Path

import pandas as pd

import vehiclemor as vm
from vehiclemor import VehiclemorError
from vehiclemor.files import write_text
from vehiclemor.reduction.methods import pod
from vehiclemor.registry import names
from vehiclemor.report.comparison import cost_table, paper_comparison, study_comparison
from vehiclemor.report.default_studies import nominal, of_paper, perturbed
from vehiclemor.report.printing import Format, table
from vehiclemor.report.spectrum import spectrum_table

# Ending of a table -> its format.
TABLES: dict[str, Format] = {"csv": "csv", "md": "markdown", "tex": "latex"}


def regenerate_all(results: Path, out: Path, jobs: int = 1) -> list[Path]:
    """All figures into `out`/figures and all tables into `out`/tables."""
    written = regenerate_tables(results, out / "tables", jobs)
    return vm.figures((), out / "figures", results, jobs) + written


def regenerate_tables(results: Path, out: Path, jobs: int = 1) -> list[Path]:
    """Write every table of every registered model in three formats; the files written."""
    tables = {"comparison": paper_comparison(results, jobs)}
    for model in names("model"):
        tables |= {f"{name}-{model}": t for name, t in model_tables(model, results, jobs).items()}
    return [
        write_text(out / f"{name}.{suffix}", table(rows, to=to))
        for name, rows in tables.items()
        for suffix, to in TABLES.items()
    ]


def model_tables(model: str, results: Path, jobs: int = 1) -> dict[str, pd.DataFrame]:
    """Tables that every model has: costs, errors, spectrum, operations.

    Errors are those of the paper's studies; of another model of its nominal and perturbed runs.
    """
    studies = (
        ("paper",) if of_paper(model) else (nominal(model, results), perturbed(model, results))
    )
    errors = pd.concat([study_comparison(study, results, jobs) for study in studies])
    tables = {
        "costs": cost_table(model, results),
        "errors": errors[errors["model"] == model],
        "operations": operation_table(model),
    }
    if pod.METHOD.accepts(vm.model(model))[0]:
        tables["spectrum"] = spectrum_table(model)
    return tables


def operation_table(model: str) -> pd.DataFrame:
    """Exact operation counts of a model's generated kernels."""
    counts = vm.model(model).operation_counts
    return pd.DataFrame([{"kernel": name, **count} for name, count in counts.items()])


def main() -> int:
    """Regenerate everything; wrong input is one line and exit status 2."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--results", type=Path, default=Path("results"), help="results folder")
    parser.add_argument("--out", type=Path, default=Path("results"), help="folder for the files")
    parser.add_argument("--jobs", type=int, default=1, help="processes for missing studies")
    arguments = parser.parse_args()
    try:
        for path in regenerate_all(arguments.results, arguments.out, arguments.jobs):
            print(path)
    except VehiclemorError as error:
        print(f"regenerate: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
