"""Which results a report is of: sections of studies and protocols, and of the paper's verdicts."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import xarray as xr

from vehiclemor.arguments import count, file_path, quoted
from vehiclemor.errors import FileError, InputError
from vehiclemor.files import write_text
from vehiclemor.registry import names
from vehiclemor.report.comparison.paper import printed_models
from vehiclemor.report.costs import timing_of
from vehiclemor.report.default_studies import nominal, perturbed, unseen
from vehiclemor.report.html.page import page
from vehiclemor.report.html.parts import Section
from vehiclemor.report.html.protocol_section import protocol_section
from vehiclemor.report.html.provenance import name_of
from vehiclemor.report.html.study_section import study_section
from vehiclemor.report.html.verdict_section import verdict_section
from vehiclemor.study.failure import attempt_apart
from vehiclemor.study.netcdf_file import read_dataset
from vehiclemor.study.plans.study_file import load_studies
from vehiclemor.study.run import run_studies

PAPER = "paper"


class Found(NamedTuple):
    """Datasets by study, of the paper's models by model, and files that can't be read -> why."""

    studies: dict[str, xr.Dataset]
    timings: dict[str, xr.Dataset]
    left_out: dict[str, str]


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
        of which their studies by default are meant.  None: all results that are stored, as they
        are.
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
    found = _run(studies, folder, count("jobs", jobs)) if studies else _stored(folder)
    left_out = dict(found.left_out)
    sections: list[Section] = []
    if found.timings and set(load_studies(PAPER)) <= set(found.studies):
        made = partial(verdict_section, found.studies, found.timings)
        sections += attempt_apart("comparison with the paper", left_out, made)
    for name, dataset in found.studies.items():
        section = protocol_section if "row" in dataset.dims else study_section
        made = attempt_apart(name, left_out, partial(section, dataset, folder, left_out))
        sections += made
        if not made and not studies:
            left_out[name] += "; if other source has stored it, vehiclemor run makes it again"
    if not sections:
        raise InputError("; ".join(f"{name}: {why}" for name, why in left_out.items()))
    return write_text(path, page(sections, left_out))


def _run(studies: Sequence[str], folder: Path, jobs: int) -> Found:
    chosen = [name for study in studies for name in _studies_of(study, folder)]
    datasets = [d for name in chosen for d in run_studies(name, folder, jobs).values()]
    found = {name_of(dataset): dataset for dataset in datasets}
    timed = printed_models() if PAPER in studies else []
    return Found(found, {model: timing_of(model, folder) for model in timed}, {})


def _studies_of(name: str, folder: Path) -> list[str]:
    if name not in names("model"):
        return [name]
    return [kind(name, folder) for kind in (nominal, perturbed, unseen)]


def _stored(folder: Path) -> Found:
    """All combined datasets that are stored, and the timings of the paper's models if all are."""
    every: dict[str, xr.Dataset] = {}
    left_out: dict[str, str] = {}
    for path in sorted((folder / "studies").glob("*.nc")):
        try:
            every[path.stem] = read_dataset(path, "source", "vehiclemor")
        except FileError as error:
            left_out[str(path)] = str(error).removeprefix(f"{path}: ")
    studies = {n: d for n, d in every.items() if "status" in d and "study" in d.attrs}
    if not studies:
        raise InputError(f"{folder}: no results of a study; vehiclemor run STUDY makes them")
    timings = {model: f"timing-{model}" for model in printed_models()}
    known = set(timings.values()) <= set(every)
    return Found(studies, {m: every[n] for m, n in timings.items()} if known else {}, left_out)
