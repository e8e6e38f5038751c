"""Sobol indices of a model in full and reduced, as `data/sobol` declares them."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import Field

from vehiclemor.codegen.cache import source_digest
from vehiclemor.errors import InputError
from vehiclemor.files import make_folder
from vehiclemor.resources import data_folder, data_names
from vehiclemor.study.netcdf_file import read_dataset, write_dataset
from vehiclemor.study.provenance import code_digest
from vehiclemor.toml_files import FileSchema, read_toml

if TYPE_CHECKING:
    import xarray as xr

FOLDER = "sobol"
# What lays results out.
SOURCES = ("online/sobol.py", "report/sobol.py")


class Contestant(FileSchema):
    """A model of whose runs there are indices."""

    label: str = Field(description="in the legend")
    method: str = Field(description="registered name; full_order is the model itself")
    settings: dict[str, Any] = Field(default_factory=dict, description="of the method")


class SobolFile(FileSchema):
    """Schema of `data/sobol/*.toml`."""

    title: str = Field(description="one line")
    model: str = Field(description="registered name")
    maneuver: str = Field(description="registered name")
    samples: int = Field(description="a power of two; runs are samples (parameters + 2)")
    objectives: list[str] = Field(description="names of objectives")
    parameters: dict[str, float] = Field(
        default_factory=dict, description="values that differ from the parameter file's"
    )
    box: dict[str, list[float]] = Field(description="parameter -> both ends of its range")
    models: list[Contestant] = Field(description="the full model, reduced ones")


def sobol_dataset(model: str, results: Path) -> xr.Dataset:
    """Indices of a model on the dimension `model`, from the results folder or computed now.

    Raises
    ------
    InputError
        If no file declares a box for the model.
    """
    import xarray as xr

    if model not in data_names(FOLDER):
        raise InputError(f"no file in data/{FOLDER} declares a box of parameters of {model}")
    path = data_folder() / FOLDER / f"{model}.toml"
    declared = read_toml(path, SobolFile)
    digests = [code_digest(declared.model, own.method) for own in declared.models]
    digests.append(source_digest((), SOURCES, ()))
    key = hashlib.sha256("\n".join([path.read_text(), *digests]).encode()).hexdigest()[:16]
    stored = results / FOLDER / f"{model}-{key}.nc"
    if stored.exists():
        return read_dataset(stored, "key", key)
    found = [_indices(declared, own) for own in declared.models]
    labels = xr.DataArray([own.label for own in declared.models], dims="model")
    seconds, runs, untrusted = (
        xr.DataArray([own.attrs[name] for own in found], dims="model")
        for name in ("seconds", "runs", "untrusted")
    )
    whole = xr.concat(found, "model", combine_attrs="override").assign_coords(model=labels)
    whole["seconds"] = seconds.assign_attrs(units="s", long_name="CPU seconds of all runs")
    whole["untrusted"] = (untrusted / runs).assign_attrs(units="1", long_name="part of the runs")
    whole = whole.assign_attrs(key=key, title=declared.title)
    make_folder(stored.parent)
    write_dataset(whole, stored)
    return whole


def _indices(declared: SobolFile, own: Contestant) -> xr.Dataset:
    from vehiclemor.online.rom import reduce
    from vehiclemor.online.sobol import sobol_indices
    from vehiclemor.simulation.build import build

    full, maneuver = build(declared.model, None, declared.parameters), declared.maneuver
    reduced = reduce(full, own.method, **own.settings)
    return sobol_indices(
        reduced, declared.objectives, declared.box, maneuver=maneuver, samples=declared.samples
    )
