"""Combined datasets in other formats: Zarr as they are, Parquet and CSV as a row for each cell."""

from __future__ import annotations

import itertools
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from vehiclemor.arguments import file_path
from vehiclemor.errors import FileError, InputError
from vehiclemor.files import write_folder, write_text, write_whole
from vehiclemor.registry import choice
from vehiclemor.report.result_selection import stored_result

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

Format = Literal["zarr", "parquet", "csv"]
FORMATS: tuple[str, ...] = get_args(Format)
# Package that writes a format, of the extra `convert`.
ENGINES = {"zarr": "zarr", "parquet": "pyarrow"}


def convert(
    study: str | Path,
    to: Format,
    out: str | Path | None = None,
    results: str | Path = "results",
) -> Path:
    """Write the stored result of a study in another format.

    Parameters
    ----------
    study
        Name or file of a study that has been run, or a netCDF file of its result.
    to
        `zarr`: the whole dataset.  `parquet`, `csv`: a table with a row for each point of the grid,
        without histories; the columns of an output's errors are `rms_error.toe` and so on.  What
        columns mean and their units stand beside it in `NAME.columns.csv`.
    out
        New file or folder; under the study's name here by default.
    results
        Results folder.

    Raises
    ------
    VehiclemorError
        If there is no such result, a package is missing, or something is there already.
    """
    choice("format", to, FORMATS)
    engine = ENGINES.get(to)
    if engine and not find_spec(engine):
        raise InputError(f"{to} needs the package {engine}: pip install 'vehiclemor[convert]'")
    name = str(file_path("study", study))
    path = Path(f"{Path(name).stem}.{to}") if out is None else file_path("out", out)
    if not path.name:
        raise InputError(f"out: {path} is a folder, not a new file")
    columns = path.with_suffix(".columns.csv")
    if path.exists():
        raise FileError(f"{path}: exists already; move it away")
    if not path.parent.is_dir():
        raise FileError(f"{path}: there is no such folder")
    dataset = stored_result(name, file_path("results", results))
    if "status" not in dataset:
        raise InputError(f"{name}: not the result of a study")
    if to == "zarr":
        _write_zarr(dataset, path)
        return path
    described = _columns(dataset).to_csv(index=False)
    # Those of another format of the same result are the same.
    if columns.exists() and columns.read_bytes() != described.encode():
        raise FileError(f"{columns}: exists already; move it away")
    write_text(columns, described)
    rows = table(dataset)
    write = rows.to_csv if to == "csv" else rows.to_parquet
    return write_whole(path, partial(write, index=False))


def table(dataset: xr.Dataset) -> pd.DataFrame:
    """A row for each point of a grid, in order."""
    import pandas as pd
    import xarray as xr

    columns: dict[str, np.ndarray] = {}
    like = dataset["status"]
    grid = [str(dimension) for dimension in like.dims]
    kept = {name: rest for name, rest in _rest(dataset).items() if rest is not None}
    for name, rest in sorted(kept.items(), key=lambda item: item[0] not in dataset.coords):
        whole = xr.broadcast(dataset[name], like)[0].transpose(*grid, *rest)
        values = whole.values.reshape(like.size, -1)
        for number, column in enumerate(_names(dataset, name, rest)):
            columns[column] = values[:, number]
    return pd.DataFrame(columns)


def _rest(dataset: xr.Dataset) -> dict[str, list[str] | None]:
    """Variable -> its dimensions beyond the grid's; None of a history."""
    grid = set(dataset["status"].dims)
    found: dict[str, list[str] | None] = {}
    for name, variable in dataset.variables.items():
        rest = [str(d) for d in variable.dims if d not in grid]
        inside = name not in dataset.coords or (not rest and bool(variable.dims))
        if inside:
            history = {"time", "input"} & set(rest)
            found[str(name)] = None if history else rest
    return found


def _names(dataset: xr.Dataset, name: str, rest: list[str]) -> list[str]:
    """Names of the columns of a variable."""
    labels = itertools.product(*(dataset[d].values.astype(str).tolist() for d in rest))
    return [".".join((name, *label)) for label in labels]


def _columns(dataset: xr.Dataset) -> pd.DataFrame:
    """Meaning and unit of every column."""
    import pandas as pd

    rows: list[dict[str, str]] = []
    for name, rest in _rest(dataset).items():
        if rest is None:
            continue
        attributes, names = dataset[name].attrs, _names(dataset, name, rest)
        units = [attributes.get("units", "")] * len(names)
        # Of outputs that do not share one unit each has its own.
        if "units" not in attributes and len(rest) == 1 and f"{rest[0]}_unit" in dataset.coords:
            units = dataset[f"{rest[0]}_unit"].values.tolist()
        meaning = str(attributes.get("long_name", ""))
        rows += [
            {"column": column, "unit": unit, "meaning": meaning}
            for column, unit in zip(names, units, strict=True)
        ]
    return pd.DataFrame(rows)


def _write_zarr(dataset: xr.Dataset, path: Path) -> None:
    # Texts of any length, as those of other chunks may be longer.
    texts = {n: v.astype(object) for n, v in dataset.variables.items() if v.dtype.kind == "U"}
    written = dataset.assign(texts).drop_encoding()
    write_folder(path, lambda place: written.to_zarr(place, mode="w", consolidated=False))  # type: ignore[call-overload]
