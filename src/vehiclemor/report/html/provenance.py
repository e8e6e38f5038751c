"""Where the results of a section come from."""

import json
from collections.abc import Mapping
from pathlib import Path

import xarray as xr

from vehiclemor.report.html.parts import Cell
from vehiclemor.resources import data_folder

WORDS = {
    "machine": "machine",
    "versions": "versions",
    "kernel_hash": "compiled kernels",
    "cells": "hash of study and cells",
    "digest": "seal of the draw",
    "drawn_on": "drawn on",
    "study_file": "study file",
}


def name_of(dataset: xr.Dataset) -> str:
    """Name of the file of a study's results: two studies may have one name, but not one file."""
    return Path(dataset.encoding.get("source", dataset.attrs["study"])).stem


def facts(dataset: xr.Dataset, cells: Mapping[str, Cell]) -> dict[str, str]:
    """Versions, machine and hashes that a dataset and its cells were stored with."""
    found = {words: str(dataset.attrs[k]) for k, words in WORDS.items() if k in dataset.attrs}
    codes = sorted(
        {str(c.configuration["code"]) for c in cells.values() if "code" in c.configuration}
    )
    return found | ({"source of the methods": ", ".join(codes)} if codes else {})


def source_text(dataset: xr.Dataset, folder: Path) -> str:
    """The TOML of a study if it still says what was run, else what was run, as JSON."""
    name = str(dataset.attrs.get("study_file", ""))
    stored = json.loads(dataset.attrs["configuration"])
    kind = "protocols" if "row" in dataset.dims else "studies"
    own, given = data_folder() / kind / f"{name}.toml", folder / name
    for path in (own, given):
        if path.suffix == ".toml" and path.is_file():
            return path.read_text(encoding="utf-8")
    return json.dumps(stored, indent=2)
