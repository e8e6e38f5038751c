"""Figures of any study, and their files."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from matplotlib.figure import Figure

from vehiclemor.arguments import MOST_JOBS, count, file_path, study_names
from vehiclemor.exceptions import InputError
from vehiclemor.failure import attempt_apart
from vehiclemor.files import make_folder
from vehiclemor.report.figures import theme
from vehiclemor.report.figures.result_plot import draw, pictures_of
from vehiclemor.study.plans.loading import refuse_doubles
from vehiclemor.study.run import run_studies


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
