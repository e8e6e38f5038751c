"""`vehiclemor plot`: a picture of a result that was stored."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from vehiclemor import api
from vehiclemor.cli.key_values import key_values
from vehiclemor.cli.output_file import picture_file
from vehiclemor.report.printing import wrapped


def plot(
    result: str,
    *,
    kind: Literal["histories", "paths", "errors"] = "histories",
    select: Annotated[tuple[str, ...], Parameter(negative="", show_default=False)] = (),
    out: Path | None = None,
    results: Path = api.RESULTS,
) -> int:
    """Draw a stored result: histories of the outputs, paths, or errors.

    Parameters
    ----------
    result
        A netCDF file that simulate has written, or a study that has been run.
    kind
        What is drawn.
    select
        dimension=value of the study's grid; may be given several times.  Where none is given,
        factors are 1, other values are the first, errors are over all and methods all drawn.
    out
        Picture (PNG, SVG or PDF); RESULT-KIND.png here by default.
    results
        Results folder in which studies are looked for.
    """
    picture = picture_file("--out", [] if out is None else [out], f"{Path(result).stem}-{kind}")
    from vehiclemor.report.figures.result_plot import plot_result
    from vehiclemor.report.result_selection import drawn, stored_result

    chosen = key_values("--select", select)
    dataset, point = drawn(stored_result(result, results), kind, chosen)
    plot_result(dataset, picture, kind)
    if point:
        print(wrapped(f"at {point}; --select dimension=value draws another point", 0, 2))
    print(f"written: {picture}")
    return 0
