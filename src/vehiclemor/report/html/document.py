"""The report: sections of studies in one HTML file that loads nothing else."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import xarray as xr

from vehiclemor.errors import InputError
from vehiclemor.files import write_text
from vehiclemor.registry import names
from vehiclemor.report.default_studies import nominal, perturbed, unseen
from vehiclemor.report.html import interactive
from vehiclemor.report.html.cells import shared_anchor, shared_values
from vehiclemor.report.html.parts import Section
from vehiclemor.report.html.protocol_section import protocol_section
from vehiclemor.report.html.study_section import study_section
from vehiclemor.study.run import run_studies
from vehiclemor.study.store import read_dataset

TEMPLATES = Path(__file__).parent


def write_report(studies: Sequence[str], out: Path, folder: Path, jobs: int = 1) -> Path:
    """Write the report of some studies, which are run first where results are missing.

    Parameters
    ----------
    studies
        Names of studies or collections, TOML files, or models, of which their studies by default
        are meant.  None: all results that are stored, as they are.

    Raises
    ------
    VehiclemorError
        If a name is wrong, nothing is stored, or the file can't be written.
    """
    if studies:
        chosen = [name for study in studies for name in _studies_of(study, folder)]
        found = {k: v for name in chosen for k, v in run_studies(name, folder, jobs).items()}
    else:
        found = _all_stored(folder)
    return write_text(out, page([_section(dataset, folder) for dataset in found.values()]))


def _studies_of(name: str, folder: Path) -> list[str]:
    if name not in names("model"):
        return [name]
    return [kind(name, folder) for kind in (nominal, perturbed, unseen)]


def _all_stored(folder: Path) -> dict[str, xr.Dataset]:
    """Combined datasets of studies; timings and the like stand beside them."""
    found: dict[str, xr.Dataset] = {}
    for path in sorted((folder / "studies").glob("*.nc")):
        dataset = read_dataset(path, "source", "vehiclemor")
        if "study" in dataset.attrs and "status" in dataset:
            found[path.stem] = dataset
    if not found:
        raise InputError(f"{folder}: no results of a study; vehiclemor run STUDY makes them")
    return found


def _section(dataset: xr.Dataset, folder: Path) -> Section:
    return (protocol_section if "row" in dataset.dims else study_section)(dataset, folder)


def page(sections: Sequence[Section], title: str = "vehiclemor") -> str:
    """The file's text."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.policies["json.dumps_kwargs"] = {"sort_keys": False, "separators": (",", ":")}
    cells = {anchor: cell for section in sections for anchor, cell in section.cells.items()}
    plots = [plot for section in sections for plot in section.plots]
    given: dict[str, Any] = {
        "title": title,
        "sections": sections,
        "cells": cells,
        "shared": shared_values(cells.values()),
        "shared_anchor": shared_anchor,
        "plots": plots,
        "library": interactive.library() if plots else "",
        "interactive": interactive.available(),
        "style": (TEMPLATES / "report.css").read_text(encoding="utf-8"),
        "script": (TEMPLATES / "report.js").read_text(encoding="utf-8"),
    }
    return environment.get_template("report.html.jinja").render(given)
