"""Regenerates the figures, and the table of claims, of `paper.typ` from stored results.

Usage: python paper/regenerate.py [--results DIR] [--only NAME ...]

Nothing is computed: a figure whose datasets the results folder lacks stays as it is, and the
command says so.  Two regenerations from the same results give byte-identical files.
"""

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import xarray as xr
from claims import claim_rows, claims, stored_results
from drawings.catalogue import FIGURES, Entry

from vehiclemor import VehiclemorError
from vehiclemor.files import write_text
from vehiclemor.report.figures import theme

PAPER = Path(__file__).parent
STYLE = str(PAPER / "figures.mplstyle")
CLAIMS = PAPER / "claims.json"
BENCHMARKS = "peers", "steps"
SCRIPTS = "other_steering", "mesh_sizes"


def stored(results: Path, name: str) -> Any:
    """A dataset of the results folder, or what a script or benchmark has written there."""
    if name in BENCHMARKS:
        return json.loads((results / f"{name}.json").read_text(encoding="utf-8"))
    if name in SCRIPTS:
        return xr.load_dataset(results / f"{name}.nc")
    return xr.load_dataset(results / "studies" / f"{name}.nc")


def draw(entry: Entry, results: Path, path: Path) -> Path:
    """Draw one figure as SVG, glyphs as paths."""
    data = {name: stored(results, name) for name in entry.studies}
    with theme.styled(STYLE):
        figure = entry.draw(*([data] if data else []), **entry.options)
        return theme.save_figure(figure, path)


def judged_claims(results: Path) -> Iterator[dict[str, Any]]:
    """Every claim of the paper that can be measured, with bound, both variants and verdicts."""
    known, measured = claims(), claim_rows(stored_results(results))
    for claim, group in groupby(measured, key=lambda row: row["id"]):
        rows = list(group)
        yield {
            "id": claim,
            "section": known[claim].section,
            "statement": known[claim].statement,
            "measure": rows[0]["measure"],
            "bound": float(rows[0]["bound"]),
            "rows": [
                {
                    "variant": row["variant"],
                    "value": float(f"{row['reproduced']:.4g}"),
                    "verdict": row["verdict"],
                    "reason": row["reason"],
                }
                for row in rows
                if np.isfinite(row["reproduced"])
            ],
        }


def regenerate(results: Path, folder: Path, only: Sequence[str] = ()) -> list[Path]:
    """All figures, or some, into a folder, and the table of claims; the files written."""
    written: list[Path] = []
    for name in only or FIGURES:
        try:
            written.append(draw(FIGURES[name], results, folder / f"{name}.svg"))
        except FileNotFoundError as error:
            print(f"{name}.svg stays as it is: {error.filename} is missing", file=sys.stderr)
    if not only:
        try:
            text = json.dumps([*judged_claims(results)], indent=1, ensure_ascii=False) + "\n"
        except FileNotFoundError as error:
            print(f"claims.json stays as it is: {error.filename} is missing", file=sys.stderr)
        else:
            written.append(write_text(CLAIMS, text))
    return written


def main() -> int:
    """Regenerate figures and claims; wrong input is one line and exit status 2."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--results", type=Path, default=Path("results"), help="results folder")
    parser.add_argument("--only", nargs="+", choices=list(FIGURES), default=[], metavar="NAME")
    arguments = parser.parse_args()
    matplotlib.use("Agg")
    try:
        for path in regenerate(arguments.results, PAPER / "figures", arguments.only):
            print(path)
    except VehiclemorError as error:
        print(f"regenerate: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
