"""The pictures of any result: histories, paths or errors of one run, or of a study."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import xarray as xr
from matplotlib.figure import Figure

from vehiclemor.arguments import MOST_JOBS, count, file_path, study_names
from vehiclemor.exceptions import InputError
from vehiclemor.failure import attempt_apart
from vehiclemor.files import make_folder
from vehiclemor.report.figures import runs, theme
from vehiclemor.report.figures.errors import figure_errors, figure_pareto
from vehiclemor.report.results import KINDS, result_kind, select_point
from vehiclemor.study.plans.loading import refuse_doubles
from vehiclemor.study.run import run_studies


class Picture(NamedTuple):
    """A kind of picture: what stands above it on a page, and what draws it."""

    caption: str
    draw: Callable[[xr.Dataset], Figure]


# Those of `labels.Kind` are of a run or a point of a grid, the others of a study as it is.
PICTURES = {
    "histories": Picture(
        "Outputs over the time, differences from full order below", runs.figure_histories
    ),
    "paths": Picture("Paths in the plane, distances from full order below", runs.figure_paths),
    "errors": Picture("RMS errors", figure_errors),
    "pareto": Picture("Worst error over bound, over time", figure_pareto),
}


def pictures_of(dataset: xr.Dataset) -> list[str]:
    """Kinds of pictures that the result of a study has the data for."""
    if result_kind(dataset) == "protocol":
        return ["pareto"]
    kinds = ["errors"]
    if dataset.sizes.get("time"):
        kinds.append("histories")
        if set(runs.PATH) <= set(dataset["output"].values):
            kinds.append("paths")
    return kinds


def draw(dataset: xr.Dataset, kind: str) -> Figure:
    """A picture of a study: at its nominal or first point, or of the study as it is."""
    if kind in KINDS:
        point, _ = select_point(dataset, kind, {})
        return plot_result(point, None, kind)
    return PICTURES[kind].draw(dataset)


def plot_result(dataset: xr.Dataset, path: Path | None = None, kind: str = "histories") -> Figure:
    """Draw a result: full order and reduced models together, differences below.

    It is one run as `vehiclemor.simulate` returns it, or a study at one point of its grid, where
    the methods are left; errors are drawn over the axes of the grid too.  A picture is written to a
    `path` (PDF, SVG or PNG), if there is one.
    """
    match result_kind(dataset):
        case "protocol":
            text = "a protocol has no grid to draw over; vehiclemor figures --only draws it"
            raise InputError(text)
        case "other":
            raise InputError("neither a run nor a study of runs: nothing to draw over time or grid")
    dataset = by_method(dataset)
    with theme.styled():
        figure = PICTURES[kind].draw(dataset)
        lines = filter(None, (_title(dataset), figure.get_suptitle()))
        figure.suptitle("\n".join(lines), fontsize="medium", wrap=True)
        theme.tell_empty(figure)
        if path is not None:
            theme.save_figure(figure, path)
    return figure


def by_method(dataset: xr.Dataset) -> xr.Dataset:
    """A result on the dimension `label`, which that of one run does not have."""
    if "label" not in dataset.coords:
        method = dataset.attrs.get("method") or runs.configuration(dataset).get("method", "run")
        dataset = dataset.assign_coords(label=method)
    return dataset if "label" in dataset.dims else dataset.expand_dims("label")


def _title(dataset: xr.Dataset) -> str:
    """Title of the result; of one run with its input."""
    title = str(dataset.attrs.get("title", runs.model_name(dataset)))
    for test in runs.configuration(dataset).get("test") or []:
        changed = [k for k in ("frequency", "amplitude") if test[k] != 1.0]
        factors = "".join(f", {key} {test[key]:g}" for key in changed)
        return f"{title}: {test['maneuver']}{factors}, from {test['start']}"
    return title


def figures(
    only: str | Path | Sequence[str | Path] = (),
    out: str | Path | None = None,
    results: str | Path = "results",
    jobs: int = 1,
    *,
    failed: dict[str, str] | None = None,
) -> list[Path]:
    """Draw the figures of any study; studies that are missing are run first.

    Parameters
    ----------
    only
        Studies, collections and protocols by name or TOML file, of which is drawn what they vary.
        By default the studies of the paper.
    out
        Folder of the figures; `figures` in the results folder by default.
    results
        Results folder.
    jobs
        Number of processes for missing studies.
    failed
        Is given the figures that can't be drawn, and why: they raise no error then.

    Returns
    -------
    list of Path
        Files written.

    Raises
    ------
    VehiclemorError
        If a name or file is wrong; at last if a figure can't be drawn, when all others are written.
    """
    folder = file_path("results", results)
    target = folder / "figures" if out is None else file_path("out", out)
    only = study_names("only", only)
    jobs = count("jobs", jobs, most=MOST_JOBS)
    wanted = only or ["paper"]
    # What is wrong is named before anything is computed.
    refuse_doubles(wanted)
    make_folder(target)
    drawings: dict[str, Callable[[], Figure]] = {}
    for name in wanted:
        for study, dataset in run_studies(name, folder, jobs).items():
            for kind in pictures_of(dataset):
                drawings[f"{study}-{kind}"] = partial(draw, dataset, kind)
    written: list[Path] = []
    wrong: dict[str, str] = {}
    for name, drawing in drawings.items():
        stem = name if name.startswith("figure") else f"figure-{name}"
        files = [target / f"{stem}.{suffix}" for suffix in theme.FORMATS]
        with theme.styled():
            save = partial(_save, drawing, files)
            written += [file for group in attempt_apart(name, wrong, save) for file in group]
    if failed is not None:
        failed.update(wrong)
    elif wrong:
        raise InputError("; ".join(f"figure {name}: {why}" for name, why in wrong.items()))
    return written


def _save(drawing: Callable[[], Figure], files: list[Path]) -> list[Path]:
    figure = drawing()
    return [theme.save_figure(figure, path) for path in files]
