"""Results as one HTML file: verdicts, tables, vector pictures, provenance and settings."""

import json
from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

import pandas as pd
import xarray as xr
from matplotlib.figure import Figure

from vehiclemor.arguments import MOST_JOBS, count, file_path, study_names
from vehiclemor.exceptions import FileError, InputError
from vehiclemor.failure import attempt_apart
from vehiclemor.files import begins_with, replaceable, write_text
from vehiclemor.netcdf_file import read_dataset
from vehiclemor.registry import names
from vehiclemor.report.comparison import nominal, paper_comparison, perturbed, result_rows, unseen
from vehiclemor.report.figures.result_plot import PICTURES, pictures_of, plot_result
from vehiclemor.report.figures.theme import METADATA, styled
from vehiclemor.report.results import KINDS, counted_ends, select_point
from vehiclemor.report.screens import Part, paper_parts, study_parts
from vehiclemor.study.plans.loading import refuse_doubles
from vehiclemor.study.run import run_studies

# Of a report.
BEGINNING = b"""<!DOCTYPE html>
<html lang="en">
<head>
<meta name="generator" content="vehiclemor">"""


class Section(NamedTuple):
    """A study, protocol or comparison: paragraphs and tables, SVG (base 64) by captions."""

    name: str
    title: str
    parts: Sequence[Part]
    pictures: Sequence[tuple[str, str]] = ()
    attributes: Mapping[str, object] | None = None


def write_report(
    studies: str | Path | Sequence[str | Path] = (),
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
        The file, which ends with .html; an older report there is replaced, nothing else.
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
    if path.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"out: {path} does not end in .html")
    replaceable(path, "report of vehiclemor", begins_with(BEGINNING))
    studies = study_names("studies", studies)
    count("jobs", jobs, most=MOST_JOBS)
    left_out: dict[str, str] = {}
    sections: list[Section] = []
    datasets = _run_studies(studies, folder, jobs) if studies else _stored(folder, left_out)
    if "paper" in studies:
        draw = partial(_paper, folder, jobs)
        sections += attempt_apart("comparison with the paper", left_out, draw)
    for name, dataset in datasets.items():
        section = attempt_apart(name, left_out, partial(_section, name, dataset, left_out))
        sections += section
        if not section and not studies:
            left_out[name] += "; if other source has stored it, vehiclemor run makes it again"
    if not sections:
        raise InputError("; ".join(f"{name}: {why}" for name, why in left_out.items()))
    return write_text(path, _page(sections, left_out))


def _run_studies(wanted: Sequence[str], folder: Path, jobs: int) -> dict[str, xr.Dataset]:
    """Datasets of studies, and of the default studies of models, run where they are missing."""
    chosen: list[str] = []
    for name in wanted:
        if name in names("model"):
            chosen += (default(name, folder) for default in (nominal, perturbed, unseen))
        else:
            chosen.append(name)
    refuse_doubles(chosen)
    datasets: dict[str, xr.Dataset] = {}
    for name in chosen:
        for dataset in run_studies(name, folder, jobs).values():
            # Two studies may have one name, but not one file.
            file = Path(dataset.encoding.get("source", dataset.attrs["study"]))
            datasets[file.stem] = dataset
    return datasets


def _stored(folder: Path, left_out: dict[str, str]) -> dict[str, xr.Dataset]:
    """All combined datasets of studies that are stored; in `left_out` what can't be read."""
    datasets: dict[str, xr.Dataset] = {}
    for path in sorted((folder / "studies").glob("*.nc")):
        try:
            dataset = read_dataset(path, stored=True)
        except FileError as error:
            left_out[str(path)] = str(error).removeprefix(f"{path}: ")
            continue
        # Timings and references have no study file.
        if "configuration" in dataset.attrs:
            datasets[path.stem] = dataset
    if not datasets:
        raise InputError(f"{folder}: no results of a study; vehiclemor run STUDY makes them")
    return datasets


def _page(sections: Sequence[Section], left_out: Mapping[str, str]) -> str:
    from jinja2 import Environment, FileSystemLoader

    loader = FileSystemLoader(Path(__file__).parent)
    environment = Environment(loader=loader, autoescape=True, trim_blocks=True, lstrip_blocks=True)
    environment.filters["indented"] = lambda text: json.dumps(json.loads(text), indent=2)
    template = environment.get_template("page.html.jinja")
    return template.render(sections=sections, left_out=left_out)


def _paper(folder: Path, jobs: int) -> Section:
    """Verdicts on what the paper prints."""
    parts = paper_parts(paper_comparison(folder, jobs))
    return Section("published", "Published beside reproduced", parts)


def _section(name: str, dataset: xr.Dataset, left_out: dict[str, str]) -> Section:
    """A study or protocol as `compare` has it, and every picture that it has the data for."""
    parts: list[Part] = []
    pictures: dict[str, Callable[[], Figure]] = {}
    kinds = pictures_of(dataset)
    if "errors" in kinds:
        parts.append(f"Study of {dataset.attrs['model']}: {counted_ends(dataset)}.")
    for kind in kinds:
        caption, draw = PICTURES[kind]
        if kind not in KINDS:
            pictures[caption] = partial(draw, dataset)
            continue
        for start in dataset["start"].values if kind != "errors" else [None]:
            part, point = select_point(dataset, kind, {"start": start} if start else {})
            where = f"{caption} at {point}" if point else caption
            pictures[where] = partial(plot_result, part, None, kind)
    drawn: list[tuple[str, str]] = []
    for caption, draw in pictures.items():
        drawn += attempt_apart(f"{caption}, {name}", left_out, partial(_svg, caption, draw))
    parts = study_parts(pd.DataFrame(result_rows(dataset))) + parts
    return Section(name, str(dataset.attrs["title"]), parts, drawn, dataset.attrs)


def _svg(caption: str, draw: Callable[[], Figure]) -> tuple[str, str]:
    target = BytesIO()
    with styled():
        draw().savefig(target, format="svg", metadata=METADATA["svg"])
    return caption, b64encode(target.getvalue()).decode()
