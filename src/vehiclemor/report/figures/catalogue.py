"""Which figures there are: those of `figures.toml`, of every registered model, of any study."""

from collections.abc import Callable, Mapping
from pathlib import Path

from matplotlib.figure import Figure
from pydantic import Field

from vehiclemor.registry import component, names, unknown
from vehiclemor.report import default_studies
from vehiclemor.report.figures import errors, paper, pareto, result_plot, runs, schematics
from vehiclemor.report.figures.theme import Results
from vehiclemor.resources import data_folder, data_names
from vehiclemor.study.plans.loading import studies_and_files
from vehiclemor.study.plans.study_file import StudyFile
from vehiclemor.toml_files import FileSchema, read_toml

# What `draw` of an entry names.
DRAWINGS: dict[str, Callable[..., Figure]] = {
    "schematic": schematics.figure_schematic,
    "histories": runs.figure_histories,
    "paths": runs.figure_paths,
    "errors": errors.figure_errors,
    "spread": paper.figure_spread,
    "spectrum": paper.figure_spectrum,
    "unseen inputs": paper.figure_unseen,
    "equation order": paper.figure_equation_order,
    "pareto": pareto.figure_pareto,
    "result": result_plot.figure_result,
}
# Figures that every model has, of all registered methods: study, what is drawn of it.
OF_A_MODEL: Mapping[str, tuple[Callable[[str, Path], str], str]] = {
    "histories": (default_studies.nominal, "histories"),
    "errors": (default_studies.nominal, "errors"),
    "map": (default_studies.perturbed, "errors"),
    "pareto": (default_studies.unseen, "pareto"),
}


class Entry(FileSchema):
    """One figure.

    Attributes
    ----------
    name
        As given to `vehiclemor figures --only`.
    drawing
        Key of `DRAWINGS`; `options` are its arguments.
    studies
        Studies whose combined datasets it shows: names, or paths of study files.
    caption
        What it shows.
    datasets
        Names of the studies' datasets where those are not the studies' own.
    default
        Whether it is drawn where no figure is asked for: the paper's are, and what belongs to them.
    """

    name: str
    drawing: str = Field(alias="draw")
    studies: list[str] = Field(default_factory=list)
    datasets: list[str] = Field(default_factory=list)
    caption: str
    default: bool = True
    options: dict[str, object] = Field(default_factory=dict)

    @property
    def names(self) -> list[str]:
        """Names of the studies' datasets."""
        return self.datasets or [Path(study).stem for study in self.studies]

    def draw(self, results: Results) -> Figure:
        """Draw it from the combined datasets by study; what it does not show is left out."""
        shown = {name: results[name] for name in self.names}
        return DRAWINGS[self.drawing](*([shown] if shown else []), **self.options)


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

    Raises
    ------
    InputError
        If there is no such figure.
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
    if study.bounds:
        kinds = {"pareto": "worst error on unseen inputs over the time of a call"}
    return [
        Entry(
            name=f"{name}-{kind}",
            draw="pareto" if study.bounds else "result",
            studies=[path.stem if data_folder() in path.parents else str(path)],
            datasets=[name],
            caption=f"{study.title}: {words}.",
            options={} if study.bounds else {"kind": kind},
        )
        for kind, words in kinds.items()
    ]
