"""Which figures there are: of `figures.toml`, of every model, of any study; and their files."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

import xarray as xr
from matplotlib.figure import Figure
from pydantic import Field

from vehiclemor.arguments import MOST_JOBS, count, file_path, quoted
from vehiclemor.exceptions import InputError
from vehiclemor.failure import attempt_apart
from vehiclemor.files import make_folder, write_text
from vehiclemor.registry import component, names, unknown
from vehiclemor.report import default_studies
from vehiclemor.report.figures import errors, pareto, result_plot, runs, size, theme
from vehiclemor.report.result_selection import drawn
from vehiclemor.resources import data_folder, data_names
from vehiclemor.study.plans.loading import studies_and_files
from vehiclemor.study.plans.study_file import StudyFile
from vehiclemor.study.run import run_studies
from vehiclemor.toml_files import FileSchema, read_toml


def figure_result(results: theme.Results, *, kind: str) -> Figure:
    """The picture of a study: at its nominal or first point, errors over the whole grid."""
    (dataset,) = results.values()
    shown, point = drawn(dataset, kind, {})
    if point:
        shown = shown.assign_attrs(title=f"{shown.attrs['title']}\nat {point}")
    return result_plot.figure_of(shown, kind)


# What `draw` of an entry names.
DRAWINGS: dict[str, Callable[..., Figure]] = {
    "histories": runs.figure_histories,
    "paths": runs.figure_paths,
    "errors": errors.figure_errors,
    "pareto": pareto.figure_pareto,
    "result": figure_result,
    "size": size.figure_size,
}
# Figures that every model has, of all registered methods: study, what is drawn of it.
OF_A_MODEL: Mapping[str, tuple[Callable[[str, Path], str], str]] = {
    "histories": (default_studies.nominal, "histories"),
    "errors": (default_studies.nominal, "errors"),
    "map": (default_studies.perturbed, "errors"),
    "pareto": (default_studies.unseen, "pareto"),
}


class Entry(FileSchema):
    """One figure, by its name for `vehiclemor figures --only`.

    `draw` is a key of `DRAWINGS`, with its `options`; `studies` are names or paths of study files,
    and `datasets` names of what they give where those are not the studies' own.  By `default` the
    paper's are drawn, and what belongs to them.
    """

    name: str
    drawing: str = Field(alias="draw")
    studies: list[str]
    datasets: list[str] = Field(default_factory=list)
    caption: str
    default: bool = True
    options: dict[str, object] = Field(default_factory=dict)

    @property
    def names(self) -> list[str]:
        """Names of the studies' datasets."""
        return self.datasets or [Path(study).stem for study in self.studies]

    def draw(self, results: theme.Results) -> Figure:
        """Draw it from the combined datasets by study; what it does not show is left out."""
        shown = {name: results[name] for name in self.names}
        return DRAWINGS[self.drawing](shown, **self.options)


class FigureFile(FileSchema):
    """Schema of `data/figures/figures.toml`."""

    parameters: str
    figures: list[Entry]


_FILE = read_toml(data_folder() / "figures" / "figures.toml", FigureFile)
PARAMETERS = _FILE.parameters
FIGURES: Mapping[str, Entry] = {entry.name: entry for entry in _FILE.figures}


def find(name: str, results: Path) -> list[Entry]:
    """The figure of a name such as `6`, or `histories-<model>`, or all figures of a study.

    Studies of a model that declares none are written to the results folder.
    """
    if name in FIGURES:
        return [FIGURES[name]]
    if name.endswith(".toml") or name in data_names("studies"):
        members = studies_and_files(name).items()
        return [entry for member, found in members for entry in _of_a_study(member, *found)]
    kind, _, model = name.partition("-")
    if kind not in OF_A_MODEL or model not in names("model"):
        known = [f"{kind}-{model}" for kind in OF_A_MODEL for model in names("model")]
        raise unknown("figure", name, [*FIGURES, *known, *data_names("studies"), "FILE.toml"])
    study, drawn = OF_A_MODEL[kind]
    (entry,) = (e for e in find(study(model, results), results) if e.name.endswith(f"-{drawn}"))
    return [entry.model_copy(update={"name": name})]


def _of_a_study(name: str, path: Path, study: StudyFile) -> list[Entry]:
    """What a study lets be drawn: of a protocol the errors over the times."""
    kinds = {"errors": "errors over what is varied"}
    if study.keep == "trajectories":
        kinds["histories"] = "outputs and errors over the time"
        if {output.name for output in component("model", study.model).outputs} >= set(runs.PATH):
            kinds["paths"] = "paths in the plane"
    if study.size:
        kinds = {"size": "times over the number of coordinates"}
    elif study.bounds:
        kinds = {"pareto": "worst error on unseen inputs over the time of a call"}
    return [
        Entry(
            name=f"{name}-{kind}",
            draw=kind if study.bounds or study.size else "result",
            studies=[path.stem if data_folder() in path.parents else str(path)],
            datasets=[name],
            caption=f"{study.title}: {content}.",
            options={} if study.bounds or study.size else {"kind": kind},
        )
        for kind, content in kinds.items()
    ]


def figures(
    only: Sequence[str] = (),
    out: str | Path | None = None,
    results: str | Path = "results",
    jobs: int = 1,
    *,
    style: str = "",
    dpi: int | None = None,
    failed: dict[str, str] | None = None,
) -> list[Path]:
    """Draw figures of the paper or of any study; studies that are missing are run first.

    Parameters
    ----------
    only
        Figure names such as `6`, or `histories-`, `errors-`, `map-` or `pareto-` and the name of a
        model, or studies and protocols by name or TOML file; by default the paper's and an index of
        captions.
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
    only = [only] if isinstance(only, str) else only
    if not (isinstance(only, Sequence) and all(isinstance(name, str) for name in only)):
        raise InputError(f"only is {quoted(only)}, not a list of names of figures")
    # What is wrong is named before anything is computed.
    theme.styled(style, dpi)
    jobs = count("jobs", jobs, most=MOST_JOBS)
    wanted = only or [name for name, entry in FIGURES.items() if entry.default]
    chosen = {entry.name: entry for name in wanted for entry in find(name, folder)}
    make_folder(target)
    data: dict[str, xr.Dataset] = {}
    for entry in chosen.values():
        for study in entry.studies:
            if not data.keys() >= set(entry.names):
                data |= run_studies(study, folder, jobs)
    written: list[Path] = []
    wrong: dict[str, str] = {}
    index = ["# Figures", "", PARAMETERS, ""]
    for name, entry in chosen.items():
        stem = name if name.startswith("figure") else f"figure-{name}"
        files = [target / f"{stem}.{suffix}" for suffix in theme.FORMATS]
        with theme.styled(style, dpi):
            caption = attempt_apart(name, wrong, partial(_draw, entry, data, files))
        index += [f"- {stem}: {text}" for text in caption]
        written += files if caption else []
    if not only:
        written.append(write_text(target / "figures.md", "\n".join(index) + "\n"))
    if failed is not None:
        failed.update(wrong)
    elif wrong:
        raise InputError("; ".join(f"figure {name}: {why}" for name, why in wrong.items()))
    return written


def _draw(entry: Entry, data: theme.Results, files: list[Path]) -> str:
    """Draw a figure of datasets; its caption and where it is from."""
    figure = entry.draw(data)
    for path in files:
        theme.save_figure(figure, path)
    hashes = sorted({str(data[name].attrs["kernel_hash"]) for name in entry.names})
    return f"{entry.caption} Studies: {', '.join(entry.names)}; kernels {', '.join(hashes)}."
