"""Leaderboard: every contestant of every stored protocol, by one rule."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from pydantic import ValidationError

from vehiclemor.arguments import file_path
from vehiclemor.errors import FileError, InputError
from vehiclemor.report.predictive.rows import STUDY, draws_of, method_rows, protocol_of
from vehiclemor.report.printing import Line, fixed, short, table_text, terms, wrapped
from vehiclemor.study.netcdf_file import read_dataset
from vehiclemor.study.plans.protocol import FULL_ORDER

Row = dict[str, Any]
RULE = "fewest silent misses first, then fewest misses, then the largest speed-up of whole calls"
LEGEND = {
    "miss": "runs outside of a bound, or not finished; sil.: of these with the status ok; flag: "
    "runs of which the model says that it has left what it knows",
    "score": "largest error as a multiple of its bound",
    "us": "CPU time of a whole call, all outputs delivered; loop: of its compiled loop; x, xl: "
    "times faster than the strongest full order at the same score, in calls and loops; off.: "
    "offline, s",
    "*": "chosen by validation; (b): baseline; (f): the fastest full order within the bounds, its "
    "other rows: --json",
}
OVERALL = {
    "method": "over all protocols, by its best row in each, ranked by the same rule with shares of "
    "the runs; x: geometric mean over the protocols where a full order is as accurate"
}


def leaderboard(out: str | Path = "results") -> pd.DataFrame:
    """Every contestant of every protocol whose results are stored, by one rule; nothing is run.

    Parameters
    ----------
    out
        Results folder.

    Returns
    -------
    pandas.DataFrame
        Protocol by protocol the rows of `predictive.rows.method_rows`, with the `study`, its
        `title`, the date `drawn_on`, whether its runs were drawn under a seal (`sealed`), and the
        `place` by the rule.  `attrs["left_out"]`: files that can't be read -> why.

    Raises
    ------
    InputError
        If the folder holds no protocol's results.
    """
    folder = file_path("out", out)
    files = sorted((folder / "studies").glob(f"{STUDY}-*.nc"))
    if not files:
        raise InputError(f"{folder}: no results of protocols; vehiclemor run predictive makes some")
    rows: list[Row] = []
    left_out: dict[str, str] = {}
    for path in files:
        try:
            dataset = read_dataset(path, "source", "vehiclemor")
            rows += [{**row, "study": path.stem} for row in _rows_of(dataset, folder)]
        except FileError as error:
            left_out[str(path)] = str(error).removeprefix(f"{path}: ")
        except KeyError as error:
            left_out[str(path)] = f"stored by other source: lacks {error}"
        except ValidationError:
            left_out[str(path)] = "holds no protocol of this version"
    table = pd.DataFrame(rows)
    table.attrs["left_out"] = left_out
    return table


def _rows_of(dataset: xr.Dataset, folder: Path) -> list[Row]:
    rows = method_rows(dataset, protocol_of(dataset), draws_of(dataset, folder))
    head: Row = {name: str(dataset.attrs[name]) for name in ("title", "drawn_on")}
    head["sealed"] = bool((dataset["scenario_set"] == "drawn").any())
    return [{**head, "place": n, **row} for n, row in enumerate(sorted(rows, key=rank), 1)]


def rank(row: Row) -> tuple[float, float, float]:
    """Smaller is better: silent misses, misses, and speed-up, the largest first."""
    faster = row["ratio_equal"]
    return row["silent"], row["misses"], -faster if faster == faster else math.inf


def leaderboard_text(rows: Sequence[Row]) -> str:
    """A table over all protocols, then one for each."""
    studies = list(dict.fromkeys(row["study"] for row in rows))
    parts = [wrapped(f"Leaderboard: {RULE}."), terms(LEGEND)]
    if len(studies) > 1:
        parts += [f"{terms(OVERALL)}\n{_overall(rows)}"]
    return "\n\n".join([*parts, *(_board([r for r in rows if r["study"] == s]) for s in studies)])


def _overall(rows: Sequence[Row]) -> str:
    """Registered methods over all protocols: sums of the best row of each."""
    lines = []
    for method in dict.fromkeys(row["component"] for row in rows if row["role"] != FULL_ORDER):
        best: dict[str, Row] = {}
        for row in sorted((r for r in rows if r["component"] == method), key=rank):
            if row["role"] != FULL_ORDER:
                best.setdefault(row["study"], row)
        names = ("silent", "misses", "runs")
        silent, misses, runs = (sum(row[name] for row in best.values()) for name in names)
        known = [r["ratio_equal"] for r in best.values() if r["ratio_equal"] > 0.0]
        faster = float(np.exp(np.mean(np.log(known)))) if known else math.nan
        worst = max(row["score"] for row in best.values())
        counts = [str(n) for n in (len(best), runs, misses, silent)]
        order = silent / runs, misses / runs, -faster if known else math.inf
        lines.append((order, Line([method, *counts, short(worst), fixed(faster)])))
    heads = ["method", "protocols", "runs", "miss", "sil.", "score", "x"]
    return table_text(heads, [line for _, line in sorted(lines, key=lambda pair: pair[0])])


def _board(rows: Sequence[Row]) -> str:
    first = rows[0]
    sealed = f"drawn {first['drawn_on'][:10]}" if first["sealed"] else "listed"
    name = first["study"].removeprefix(f"{STUDY}-")
    of_model = "" if name == first["model"] else f"{first['model']}, "
    title = f"{name} ({of_model}{first['runs']} runs {sealed}): {first['title']}"
    full = [row for row in rows if row["role"] == FULL_ORDER and row["within_bounds"]]
    fastest = min(full, key=lambda row: row["seconds"], default=None)
    shown = [row for row in rows if row["role"] != FULL_ORDER or row is fastest]
    heads = ["", "miss", "sil.", "flag", "score", "us", "loop", "x", "xl", "off."]
    table = table_text(heads, [Line(_cells(n, row)) for n, row in enumerate(shown, 1)])
    return f"{wrapped(title, 0, 2)}\n{table}"


def _cells(number: int, row: Row) -> list[str]:
    mark = {FULL_ORDER: " (f)", "baseline": " (b)"}.get(row["role"], " *" if row["winner"] else "")
    cells = [f"{number:2} {row['method']}{mark}"]
    cells += [f"{row[name]}" for name in ("misses", "silent", "flagged")] + [short(row["score"])]
    cells += [fixed(1e6 * row.get(name, math.nan), 0) for name in ("seconds", "loop_seconds")]
    cells += [fixed(row[name]) for name in ("ratio_equal", "ratio_equal_loop")]
    return [*cells, short(row["offline_seconds"]) if row["offline_seconds"] else "-"]
