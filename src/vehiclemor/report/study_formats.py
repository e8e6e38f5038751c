"""Combined datasets in other formats: Zarr as they are, Parquet and CSV as their frames."""

import os
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Literal, get_args

from vehiclemor.arguments import file_path
from vehiclemor.exceptions import FileError, InputError
from vehiclemor.files import begins_with, replaceable, write_text, write_whole
from vehiclemor.registry import choice

Format = Literal["zarr", "parquet", "csv"]
FORMATS: tuple[str, ...] = get_args(Format)
# Package that writes a format, of the extra `convert`.
ENGINES = {"zarr": "zarr", "parquet": "pyarrow"}


def convert(
    study: str | Path, to: Format, out: str | Path | None = None, results: str | Path = "results"
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
    from vehiclemor.report.frames import column_meanings, frame
    from vehiclemor.report.result_selection import stored_result

    choice("format", to, FORMATS)
    engine = ENGINES.get(to)
    if engine and not find_spec(engine):
        raise InputError(f"{to} needs the package {engine}: pip install 'vehiclemor[convert]'")
    name = str(file_path("study", study))
    path = Path(f"{Path(name).stem}.{to}") if out is None else file_path("out", out)
    if os.path.lexists(path):
        raise FileError(f"{path}: exists already; move it away")
    columns = path.with_suffix(".columns.csv")
    if not path.parent.is_dir():
        raise FileError(f"{path}: there is no such folder")
    dataset = stored_result(name, file_path("results", results))
    if "status" not in dataset:
        raise InputError(f"{name}: not the result of a study")
    if to == "zarr":
        # Texts of any length, as those of other chunks may be longer.
        texts = {n: v.astype(object) for n, v in dataset.variables.items() if v.dtype.kind == "U"}
        written = dataset.assign(texts).drop_encoding()
        return write_whole(path, partial(written.to_zarr, mode="w", consolidated=False))
    described = column_meanings(dataset).to_csv(index=False)
    # Those of another format of the same result are the same.
    replaceable(columns, "table of the same columns", begins_with(described.encode()))
    write_text(columns, described)
    rows = frame(dataset)
    write = rows.to_csv if to == "csv" else rows.to_parquet
    return write_whole(path, partial(write, index=False))
