"""Which figures there are, of every model and of any study; and their files."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import xarray as xr
from matplotlib.figure import Figure

from vehiclemor.arguments import MOST_JOBS, count, file_path, study_names
from vehiclemor.exceptions import InputError
from vehiclemor.failure import attempt_apart
from vehiclemor.files import make_folder
from vehiclemor.registry import component, names, unknown
from vehiclemor.report import default_studies
from vehiclemor.report.figures import result_plot, runs, theme
from vehiclemor.report.result_selection import KINDS, select_point
from vehiclemor.resources import data_folder, data_names
from vehiclemor.study.plans.loading import is_study, refuse_doubles, studies_and_files
from vehiclemor.study.plans.study_file import GridFile, ProtocolFile, StudyFile
from vehiclemor.study.run import run_studies

# Figures that every model has, of all registered methods: study, what is drawn of it.
OF_A_MODEL: Mapping[str, tuple[Callable[[str, Path], str], str]] = {
    "histories": (default_studies.nominal, "histories"),
    "errors": (default_studies.nominal, "errors"),
    "map": (default_studies.perturbed, "errors"),
    "pareto": (default_studies.unseen, "pareto"),
}


class Entry(NamedTuple):
    """One figure: its name, what is drawn, of which study (name or path), and of which result."""

    name: str
    kind: str
    study: str
    result: str

    def draw(self, dataset: xr.Dataset) -> Figure:
        """Draw a study at its nominal or first point, its errors over the whole grid."""
        if self.kind not in KINDS:
            return result_plot.PICTURES[self.kind].draw(dataset)
        return result_plot.figure_of(select_point(dataset, self.kind, {})[0], self.kind)


def find(name: str, results: Path) -> list[Entry]:
    """The figure of a name such as `histories-<model>`, or all figures of a study or collection.

    Studies of a model that declares none are written to the results folder.
    """
    if is_study(name):
        members = studies_and_files(name).items()
        return [entry for member, found in members for entry in _of_a_study(member, *found)]
    kind, _, model = name.partition("-")
    if kind not in OF_A_MODEL or model not in names("model"):
        known = [f"{kind}-{model}" for kind in OF_A_MODEL for model in names("model")]
        raise unknown("figure", name, [*known, *data_names("studies"), "FILE.toml"])
    study, drawing = OF_A_MODEL[kind]
    (entry,) = (entry for entry in find(study(model, results), results) if entry.kind == drawing)
    return [entry._replace(name=name)]


def _of_a_study(name: str, path: Path, study: StudyFile) -> list[Entry]:
    """What a study lets be drawn: of a protocol the errors over the times."""
    if isinstance(study, GridFile):
        kinds = ["errors"]
        if study.keep == "trajectories":
            kinds.append("histories")
            outputs = {output.name for output in component("model", study.model).outputs}
            if outputs >= set(runs.PATH):
                kinds.append("paths")
    else:
        kinds = ["pareto" if isinstance(study, ProtocolFile) else "size"]
    of = path.stem if data_folder() in path.parents else str(path)
    return [Entry(f"{name}-{kind}", kind, of, name) for kind in kinds]


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
    chosen = {entry.name: entry for name in wanted for entry in find(name, folder)}
    make_folder(target)
    data: dict[str, xr.Dataset] = {}
    for entry in chosen.values():
        if entry.result not in data:
            (data[entry.result],) = run_studies(entry.study, folder, jobs).values()
    written: list[Path] = []
    wrong: dict[str, str] = {}
    for name, entry in chosen.items():
        stem = name if name.startswith("figure") else f"figure-{name}"
        files = [target / f"{stem}.{suffix}" for suffix in theme.FORMATS]
        with theme.styled(style, dpi):
            draw = partial(_draw, entry, data[entry.result], files)
            written += [file for found in attempt_apart(name, wrong, draw) for file in found]
    if failed is not None:
        failed.update(wrong)
    elif wrong:
        raise InputError("; ".join(f"figure {name}: {why}" for name, why in wrong.items()))
    return written


def _draw(entry: Entry, dataset: xr.Dataset, files: list[Path]) -> list[Path]:
    figure = entry.draw(dataset)
    return [theme.save_figure(figure, path) for path in files]
