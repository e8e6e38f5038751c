"""Which figures there are: those of `figures.toml`, and a set for every registered model."""

from collections.abc import Callable, Mapping
from pathlib import Path

from matplotlib.figure import Figure
from pydantic import Field

from vehiclemor.registry import component, names, unknown
from vehiclemor.report import default_studies
from vehiclemor.report.figures import (
    equation_order,
    error_map,
    high_fidelity_schematic,
    histories,
    pareto,
    paths,
    perturbations,
    result_plot,
    spectrum,
    spread,
    suspension_schematic,
    unseen,
    vehicle_schematic,
)
from vehiclemor.report.figures.curves import PATH
from vehiclemor.report.figures.lines import Results
from vehiclemor.report.shown import main_outputs
from vehiclemor.resources import data_folder, data_names
from vehiclemor.study.plans.loading import studies_and_files
from vehiclemor.study.plans.study_file import StudyFile
from vehiclemor.toml_files import FileSchema, read_toml

# What `draw` of an entry names.
DRAWINGS: dict[str, Callable[..., Figure]] = {
    "suspension schematic": suspension_schematic.figure_suspension,
    "vehicle schematic": vehicle_schematic.figure_vehicle,
    "high-fidelity schematic": high_fidelity_schematic.figure_vehicle,
    "paths": paths.figure_paths,
    "replayed paths": paths.figure_replayed_paths,
    "histories": histories.figure_histories,
    "error curves": perturbations.figure_error_curves,
    "error map": error_map.figure_error_map,
    "spread": spread.figure_spread,
    "spectrum": spectrum.figure_spectrum,
    "unseen inputs": unseen.figure_unseen,
    "equation order": equation_order.figure_equation_order,
    "pareto": pareto.figure_pareto,
    "result": result_plot.figure_result,
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


MOST_OUTPUTS = 4
# Kind -> drawing, what its panels show, study, caption.
OF_A_MODEL: Mapping[str, tuple[str, str, Callable[[str, Path], str], str]] = {
    "histories": ("histories", "history", default_studies.nominal, "nominal run, as trained"),
    "errors": ("histories", "largest error", default_studies.nominal, "errors of the nominal run"),
    "map": ("error map", "", default_studies.perturbed, "errors at perturbed, untrained inputs"),
    "pareto": ("pareto", "", default_studies.unseen, "error on unseen inputs over time"),
}


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
        return [
            e
            for study, found in studies_and_files(name).items()
            for e in _of_a_study(study, *found)
        ]
    kind, _, model = name.partition("-")
    if kind not in OF_A_MODEL or model not in names("model"):
        known = [f"{kind}-{model}" for kind in OF_A_MODEL for model in names("model")]
        raise unknown("figure", name, [*FIGURES, *known, *data_names("studies"), "FILE.toml"])
    return [_of_a_model(kind, model, results)]


def _of_a_study(name: str, path: Path, study: StudyFile) -> list[Entry]:
    """What a study lets be drawn: of a protocol the errors over the times."""
    file = path.stem if data_folder() in path.parents else str(path)
    if study.bounds:
        return [
            Entry(
                name=f"{name}-pareto",
                draw="pareto",
                studies=[file],
                datasets=[name],
                caption=f"{study.title}: worst error on unseen inputs over the time of a call.",
                options={"titled": True},
            )
        ]
    kinds = {"errors": "errors over what is varied"}
    if study.keep == "trajectories":
        kinds["histories"] = "outputs and errors over the time"
        if {output.name for output in component("model", study.model).outputs} >= set(PATH):
            kinds["paths"] = "paths in the plane"
    return [
        Entry(
            name=f"{name}-{kind}",
            draw="result",
            studies=[file],
            caption=f"{study.title}: {words}.",
            options={"kind": kind},
        )
        for kind, words in kinds.items()
    ]


def _of_a_model(kind: str, model: str, results: Path) -> Entry:
    """One of the figures that every model has, of all registered methods."""
    drawing, content, study, caption = OF_A_MODEL[kind]
    outputs = list(main_outputs(component("model", model)))[:MOST_OUTPUTS]
    methods = default_studies.legend(model)
    options: dict[str, object] = {"outputs": outputs, "methods": methods}
    if drawing == "histories":
        options |= {"rows": [content], "height": 1.4 + 1.8 * len(outputs)}
    elif drawing == "error map":
        options["values"] = True
        options["methods"] = {k: text for k, text in methods.items() if k != "pod_literal"}
    return Entry(
        name=f"{kind}-{model}",
        draw=drawing,
        studies=[study(model, results)],
        caption=f"{model}: {caption}",
        options={} if drawing == "pareto" else options,
    )
