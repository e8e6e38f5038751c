"""Which figures there are, of every model and of any study; and their files."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

from matplotlib.figure import Figure

from vehiclemor.arguments import MOST_JOBS, count, file_path, study_names
from vehiclemor.exceptions import InputError
from vehiclemor.failure import attempt_apart
from vehiclemor.files import data_names, make_folder
from vehiclemor.registry import names, unknown
from vehiclemor.report import default_studies
from vehiclemor.report.figures import theme
from vehiclemor.report.figures.result_plot import draw, pictures_of
from vehiclemor.study.plans.loading import is_study, refuse_doubles
from vehiclemor.study.run import run_studies

# Figures that every model has, of all registered methods: study, what is drawn of it.
OF_A_MODEL: Mapping[str, tuple[Callable[[str, Path], str], str]] = {
    "histories": (default_studies.nominal, "histories"),
    "errors": (default_studies.nominal, "errors"),
    "map": (default_studies.perturbed, "errors"),
    "pareto": (default_studies.unseen, "pareto"),
}


class Request(NamedTuple):
    """Figures of a study or collection (name or path): all kinds, or one under another name."""

    study: str
    kind: str = ""
    name: str = ""


def find(name: str, results: Path) -> Request:
    """What a name such as `histories-<model>`, or that of a study, asks for.

    Studies of a model that declares none are written to the results folder.
    """
    if is_study(name):
        return Request(name)
    kind, _, model = name.partition("-")
    if kind not in OF_A_MODEL or model not in names("model"):
        known = [f"{kind}-{model}" for kind in OF_A_MODEL for model in names("model")]
        raise unknown("figure", name, [*known, *data_names("studies"), "FILE.toml"])
    study, picture = OF_A_MODEL[kind]
    return Request(study(model, results), picture, name)


def figures(
    only: str | Path | Sequence[str | Path] = (),
    out: str | Path | None = None,
    results: str | Path = "results",
    jobs: int = 1,
    *,
    style: str = "",
    dpi: int | None = None,
    failed: dict[str, str] | None = None,
) -> list[Path]:
    """Draw the figures of any study; studies that are missing are run first.

    Parameters
    ----------
    only
        Studies, collections and protocols by name or TOML file, of which is drawn what they vary;
        or `histories-`, `errors-`, `map-` or `pareto-` and the name of a model.  By default the
        studies of the paper.
    out
        Folder of the figures; `figures` in the results folder by default.
    results
        Results folder.
    jobs
        Number of processes for missing studies.
    style, dpi
        Name or file of a Matplotlib style on top of the package's, and dots an inch of PNG files.
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
    # What is wrong is named before anything is computed.
    theme.styled(style, dpi)
    jobs = count("jobs", jobs, most=MOST_JOBS)
    wanted = only or ["paper"]
    refuse_doubles(name for name in wanted if is_study(name))
    requests = [find(name, folder) for name in wanted]
    make_folder(target)
    drawings: dict[str, Callable[[], Figure]] = {}
    for request in requests:
        for study, dataset in run_studies(request.study, folder, jobs).items():
            for kind in [request.kind] if request.kind else pictures_of(dataset):
                name = request.name or f"{study}-{kind}"
                drawings[name] = partial(draw, dataset, kind)
    written: list[Path] = []
    wrong: dict[str, str] = {}
    for name, drawing in drawings.items():
        stem = name if name.startswith("figure") else f"figure-{name}"
        files = [target / f"{stem}.{suffix}" for suffix in theme.FORMATS]
        with theme.styled(style, dpi):
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
