"""`vehiclemor convert`: the result of a study in another format."""

from pathlib import Path

from vehiclemor import api
from vehiclemor.report.study_formats import Format


def convert(study: str, *, to: Format, out: Path | None = None, results: Path = api.RESULTS) -> int:
    """Write the stored result of a study in another format.

    Parameters
    ----------
    study
        Name or file of a study that has been run, or a netCDF file of its result.
    to
        zarr: the whole dataset; parquet, csv: a table with a row for each point of the grid.
    out
        New file or folder; under the study's name here by default.
    results
        Results folder.
    """
    from vehiclemor.report.study_formats import convert as convert_study

    print(f"written: {convert_study(study, to, out, results)}")
    return 0
