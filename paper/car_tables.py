"""Tables of the handbook over many cars: a line for whatever was measured.

Each is Markdown, and empty where nothing is stored.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
from fragments import ROOT

from vehiclemor.report.design_studies import design_space
from vehiclemor.report.predictive.rows import draws_of, method_rows, protocol_of
from vehiclemor.report.printing import fixed, short
from vehiclemor.report.tables import markdown
from vehiclemor.study.netcdf_file import read_dataset
from vehiclemor.study.plans.protocol import load_protocol

OF_CARS = "predictive-cars-"
FIGURES = ROOT / "paper" / "figures"
# Column of a contestant -> heading, and how its numbers are printed.
DRAWN: dict[str, tuple[str, Callable[[Any], str]]] = {
    "method": ("", str),
    "misses": ("missed", str),
    "silent": ("silent", str),
    "flagged": ("warned", str),
    "score": ("worst score", short),
    "ratio_equal": ("x whole calls", fixed),
}


def latin_hypercube(folder: Path) -> str:
    """What `design_space.py` has kept of each model, with its figure."""
    del folder
    parts = []
    for model, kept in design_space().items():
        title = _title(load_protocol(f"cars-{model}").definition.title)
        rows = pd.DataFrame(kept["rows"])
        numbers = rows.select_dtypes("number").columns
        rows[numbers] = rows[numbers].map(_number)
        parts.append(f"{title}, {kept['cars']} cars:\n\n{markdown(rows)}")
        name = f"design-space-{model}.png"
        if (FIGURES / name).exists():
            text = f"{title}: share of the cars whose largest error is above a part of its bound"
            parts.append(f"![{text}](../figures/{name})\n")
    return "\n".join(parts)


def drawn(folder: Path) -> str:
    """Draws over cars and inputs whose results are stored."""
    parts = []
    for part in contestants(folder):
        first = part.iloc[0]
        columns = {
            heading: [printed(value) for value in part[name]]
            for name, (heading, printed) in DRAWN.items()
        }
        names = zip(columns[""], part["winner"], strict=True)
        columns[""] = [f"{name}*" if winner else name for name, winner in names]
        table = markdown(pd.DataFrame(columns))
        when = first["drawn_on"][:10]
        parts.append(f"{_title(first['title'])}, {first['runs']} runs drawn on {when}:\n\n{table}")
    return "\n".join(parts)


def contestants(folder: Path) -> list[pd.DataFrame]:
    """Of each stored protocol over cars whose runs were drawn: its contestants."""
    found = []
    for path in sorted((folder / "studies").glob(f"{OF_CARS}*.nc")):
        dataset = read_dataset(path, "source", "vehiclemor")
        if (dataset["scenario_set"] == "drawn").any():
            rows = method_rows(dataset, protocol_of(dataset), draws_of(dataset, folder))
            head = {name: dataset.attrs[name] for name in ("title", "drawn_on")}
            found.append(pd.DataFrame(rows).assign(**head))
    return found


def _number(value: float) -> str:
    if value >= 100.0:
        return f"{value:.0f}"
    return f"{value:.3g}" if value >= 10.0 else short(value)


def _title(protocol: str) -> str:
    return protocol.partition(":")[0]


# Name of a table in a page -> what makes it.
TABLES = {"latin-hypercube": latin_hypercube, "drawn-cars": drawn}
