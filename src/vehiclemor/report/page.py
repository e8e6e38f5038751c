"""Results as one HTML file: verdicts, tables, vector pictures, provenance and settings."""

import json
from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd
import xarray as xr
from matplotlib.figure import Figure

from vehiclemor.arguments import MOST_JOBS, count, file_path, quoted
from vehiclemor.errors import FileError, InputError
from vehiclemor.files import write_text
from vehiclemor.registry import names
from vehiclemor.report.comparison.kinds import paper_comparison
from vehiclemor.report.default_studies import nominal, perturbed, unseen
from vehiclemor.report.figures.pareto import figure_pareto
from vehiclemor.report.figures.result_plot import plot_result, shown_outputs
from vehiclemor.report.figures.runs import PATH
from vehiclemor.report.figures.theme import METADATA, styled
from vehiclemor.report.frames import counted_ends, frame, warned_runs
from vehiclemor.report.labels import TRAINED, trained_runs, unit_of
from vehiclemor.report.predictive.rows import protocol_rows
from vehiclemor.report.printing import table
from vehiclemor.report.result_selection import drawn
from vehiclemor.report.verdicts import VERDICTS, counted
from vehiclemor.study.failure import attempt_apart
from vehiclemor.study.netcdf_file import read_dataset
from vehiclemor.study.plans.study_file import PARAMETER
from vehiclemor.study.run import run_studies

# A table of a study with more rows is summed up.
MOST_ROWS = 200
PICTURES = {
    "histories": "Outputs over the time, differences from full order below",
    "paths": "Paths in the plane, distances from full order below",
    "errors": "RMS errors",
}
COUNTS = ("effective_rank", "rhs_calls", "iterations", "steps")
# Columns of tables, as `compare --json` names them.
VERDICT = "item verdict variant start published bound reproduced signal_rms unit measure reason"
TARGET = "item bound measured unit verdict reason threshold_source"
CONTESTANT = "label role winner misses silent flagged score seconds ratio_equal offline_seconds"


class Section(NamedTuple):
    """A study, protocol or comparison: tables and SVG (base 64) by captions."""

    name: str
    title: str
    intro: str
    tables: Mapping[str, pd.DataFrame]
    pictures: Sequence[tuple[str, str]] = ()
    attributes: Mapping[str, object] | None = None


def write_report(
    studies: str | Sequence[str] = (),
    out: str | Path = "report.html",
    results: str | Path = "results",
    jobs: int = 1,
) -> Path:
    """Write results as one HTML file that needs no network and no other file.

    Parameters
    ----------
    studies
        Names of studies or collections, TOML files, run first where results are missing, or models,
        of which their studies by default are meant.  None: all that is stored, as it is.
    out
        The file.
    results
        Results folder.
    jobs
        Number of processes for missing studies.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    VehiclemorError
        If a name is wrong, nothing is stored, or the file can't be written.
    """
    path, folder = file_path("out", out), file_path("results", results)
    studies = [studies] if isinstance(studies, str) else studies
    if not (isinstance(studies, Sequence) and all(isinstance(name, str) for name in studies)):
        raise InputError(f"studies is {quoted(studies)}, not a list of names of studies")
    left_out: dict[str, str] = {}
    sections: list[Section] = []
    if studies:
        chosen = [name for study in studies for name in _studies_of(study, folder)]
        jobs = count("jobs", jobs, most=MOST_JOBS)
        every = [d for n in chosen for d in run_studies(n, folder, jobs).values()]
        # Two studies may have one name, but not one file.
        found = {Path(d.encoding.get("source", d.attrs["study"])).stem: d for d in every}
    else:
        found = _stored(folder, left_out)
    if "paper" in studies:
        made = partial(_paper, folder, jobs)
        sections += attempt_apart("comparison with the paper", left_out, made)
    for name, dataset in found.items():
        section = _protocol if "scenario_set" in dataset.coords else _study
        made = attempt_apart(name, left_out, partial(section, name, dataset, left_out))
        sections += [part._replace(attributes=dataset.attrs) for part in made]
        if not made and not studies:
            left_out[name] += "; if other source has stored it, vehiclemor run makes it again"
    if not sections:
        raise InputError("; ".join(f"{name}: {why}" for name, why in left_out.items()))
    return write_text(path, _page(sections, left_out))


def _studies_of(name: str, folder: Path) -> list[str]:
    if name not in names("model"):
        return [name]
    return [kind(name, folder) for kind in (nominal, perturbed, unseen)]


def _stored(folder: Path, left_out: dict[str, str]) -> dict[str, xr.Dataset]:
    """All combined datasets of studies that are stored; `left_out` is told what can't be read."""
    found: dict[str, xr.Dataset] = {}
    for path in sorted((folder / "studies").glob("*.nc")):
        try:
            found[path.stem] = read_dataset(path, "source", "vehiclemor")
        except FileError as error:
            left_out[str(path)] = str(error).removeprefix(f"{path}: ")
    found = {n: d for n, d in found.items() if "status" in d and "study" in d.attrs}
    if not found:
        raise InputError(f"{folder}: no results of a study; vehiclemor run STUDY makes them")
    return found


def _page(sections: Sequence[Section], left_out: Mapping[str, str]) -> str:
    from jinja2 import Environment, FileSystemLoader

    loader = FileSystemLoader(Path(__file__).parent)
    environment = Environment(loader=loader, autoescape=True, trim_blocks=True, lstrip_blocks=True)
    environment.filters["indented"] = lambda text: json.dumps(json.loads(text), indent=2)
    environment.filters["html"] = partial(table, to="html")
    template = environment.get_template("page.html.jinja")
    return template.render(sections=sections, left_out=left_out)


def _paper(folder: Path, jobs: int) -> Section:
    """Verdicts on what the paper prints."""
    rows = paper_comparison(folder, jobs)
    shown = rows[VERDICT.split()].replace({"verdict": VERDICTS}).groupby(rows["model"], sort=False)
    tables = {f"Verdicts: {model}": pd.DataFrame(part) for model, part in shown}
    intro = (
        "Masoudi, Uchida, McPhee (2015), doi:10.1115/1.4029390: every printed number and claim "
        f"beside what is reproduced. {len(rows)} rows: {counted(rows['verdict'])}."
    )
    return Section("published", "Published beside reproduced", intro, tables)


def _protocol(name: str, dataset: xr.Dataset, left_out: dict[str, str]) -> Section:
    """Targets of what was chosen, and all contestants."""
    rows = protocol_rows(dataset)
    targets, methods = (
        pd.DataFrame([row for row in rows if row["kind"] == kind]) for kind in ("target", "method")
    )
    methods = methods.sort_values(["silent", "misses", "score"])
    errors = [key for key in methods if str(key).startswith("worst_")]
    tables = {
        "Verdicts on what was chosen": targets.reindex(columns=TARGET.split()).replace(
            {"verdict": VERDICTS}
        ),
        "Contestants on the judged runs, fewest undetected misses first": methods[
            [*CONTESTANT.split(), *errors]
        ],
    }
    made = partial(
        _svg, "Worst error over bound, over time", partial(figure_pareto, {name: dataset})
    )
    pictures = attempt_apart(f"errors over times of {name}", left_out, made)
    runs, test_set = methods["runs"].iloc[0], dataset.attrs["test_set"]
    intro = f"{runs} judged runs of {dataset.attrs['model']}, test set {test_set}."
    return Section(name, str(dataset.attrs["title"]), intro, tables, pictures)


def _study(name: str, dataset: xr.Dataset, left_out: dict[str, str]) -> Section:
    """Errors of every run of a study on a grid, and every picture that it has the data for."""
    held = {"histories": bool(dataset.sizes.get("time")), "errors": True}
    held["paths"] = held["histories"] and set(PATH) <= set(dataset["output"].values)
    pictures: list[tuple[str, str]] = []
    for kind in filter(held.get, PICTURES):
        for start in dataset["start"].values if kind != "errors" else [None]:
            part, point = drawn(dataset, kind, {"start": start} if start else {})
            caption = f"{PICTURES[kind]}{f' at {point}' if point else ''}"
            made = partial(_svg, caption, partial(plot_result, part, None, kind))
            pictures += attempt_apart(f"{kind} of {name}", left_out, made)
    intro = f"Study of {dataset.attrs['model']}: {counted_ends(dataset)}."
    return Section(name, str(dataset.attrs["title"]), intro, error_tables(dataset), pictures)


def error_tables(dataset: xr.Dataset) -> dict[str, pd.DataFrame]:
    """Errors of every run of a study, with its status and cell; of many the extremes alone."""
    units = {output: unit_of(dataset, output) for output in shown_outputs(dataset)}
    heads = {f"rms_error.{o}": f"RMS error of {o} ({unit})" for o, unit in units.items()}
    told = dataset.assign(warned=warned_runs(dataset), trained=trained_runs(dataset))
    runs: Any = frame(told).rename(columns=heads)
    axes = [d for d in dataset["status"].dims if d != "label" and dataset.sizes[d] > 1]
    ok = runs["status"] == "ok"
    if len(runs) > MOST_ROWS:
        by = ["label", *(["start"] if "start" in axes else [])]
        good = runs[ok].groupby(by, sort=False)[[*heads.values()]]
        extremes = good.agg(["count", "min", "median", "max"]).reset_index()
        extremes.columns = [": ".join(filter(None, names)) for names in extremes]
        return {"Errors of the runs that are ok; the netCDF file has every run": extremes}
    said = runs["message"] + runs["remark"].where(runs["warned"] & ok, "")
    marks = runs["trained"].map({True: f" ({TRAINED})", False: ""})
    status = runs["status"] + marks + said.map(lambda text: f": {text}" if text else "")
    axes += [n for n, c in dataset.coords.items() if c.dims == ("sample",) and n not in axes]
    shown = runs[["label", *axes, *heads.values(), *(name for name in COUNTS if name in runs)]]
    shown = shown.rename(columns=lambda key: str(key).removeprefix(PARAMETER))
    return {"Every run": shown.assign(status=status, cell=runs["cell_key"])}


def _svg(caption: str, draw: Callable[[], Figure]) -> tuple[str, str]:
    target = BytesIO()
    with styled():
        draw().savefig(target, format="svg", metadata=METADATA["svg"])
    return caption, b64encode(target.getvalue()).decode()
