"""Reduced models as files: one netCDF-4 file with all of their parts, and nothing to run.

Numbers are variables by the names of the fields that they stand in, operations of features too;
their order is JSON.  Machine code is compiled from these operations, or comes from the cache.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from vehiclemor.arguments import file_path, flag, require
from vehiclemor.exceptions import FileError, InputError, VehiclemorError, one_line
from vehiclemor.files import data_folder, replaceable
from vehiclemor.multibody.quantities import Quantity
from vehiclemor.netcdf_file import INTEGRITY, is_saved_model, opened, write_dataset
from vehiclemor.provenance import attributes, code_digest
from vehiclemor.reduction.interface import FittedModel, Method
from vehiclemor.reduction.parts import Parts
from vehiclemor.reduction.training import training_summary
from vehiclemor.reduction.trust import BANDS, InputRange
from vehiclemor.reduction.validation import checked_fit, checked_settings, validated
from vehiclemor.registry import component
from vehiclemor.short_repr import shortened
from vehiclemor.simulation.build import build
from vehiclemor.simulation.model import Model

# Of the layout of these files.
SCHEMA = 8
# Texts beside the arrays.
TEXTS = ("parts", "settings", "training", "parameters")
# Parts of a reduced model and their types.
PARTS = {"reduced": FittedModel, "input_range": InputRange}
# Bytes of all variables of a file, and characters of a text: the largest of this package's methods
# have 3 MB and 0.3 million.
MOST_BYTES, MOST_CHARACTERS = 1 << 28, 2_000_000
# Differences of what a model's equations give that rounding explains: relative, and as part of the
# largest number.
SAME, ROUNDING = 1e-8, 1e-12
# Length (s) of the step by which reduced models are known.
STEP = 0.01


def write(rom: Any, path: Any, overwrite: bool = False) -> Path:
    """Write a reduced model into a file, see `ReducedOrderModel.save`."""
    import xarray as xr

    path = file_path("path", path)
    if not flag("overwrite", overwrite) and os.path.lexists(path):
        raise InputError(f"{path} is there already; overwrite=True replaces a saved model")
    replaceable(path, "saved model", is_saved_model)
    model, state, writer = rom.model, rom.__getstate__(), Parts(rom.model)
    try:
        parts = {name: writer.write(state[name], name, of) for name, of in PARTS.items()}
    except InputError as error:
        raise InputError(f"{rom.method} of {model.name}: {error}") from None
    if sum(array.nbytes for array in writer.arrays.values()) > MOST_BYTES:
        raise InputError(f"{rom.method} of {model.name}: more than {MOST_BYTES} bytes to save")
    texts = parts, dict(rom.settings), list(state["training"]), _parameters(model)
    variables: dict[str, Any] = {
        name: ((), json.dumps(text)) for name, text in zip(TEXTS, texts, strict=True)
    }
    prints = {"fingerprint": fingerprint(model), "response": response(model, rom.reduced)}
    for name, array in (writer.arrays | prints).items():
        dimensions = [f"{name}_{axis}" for axis in range(array.ndim)]
        variables[name] = dimensions, array, {}, {"zlib": True, "_FillValue": None}
    described = attributes(
        f"{rom.method} of {model.name}",
        model.kernel_hash,
        saved_model=SCHEMA,
        model=model.name,
        method=rom.method,
        vehiclemor=version("vehiclemor"),
        code=code_digest(model.name, rom.method),
        date=datetime.now(UTC).isoformat(timespec="seconds"),
    )
    if driven := model.definition.choice.driven:
        described["driven_inputs"] = " ".join(driven)
    write_dataset(xr.Dataset(variables, attrs=described), path)
    return path


def read(path: Any) -> dict[str, Any]:
    """Arguments of `ReducedOrderModel` from its file; see `rom.load`."""
    path = file_path("path", path)
    stored, attrs = content(path)
    try:
        method, name = str(attrs["method"]), str(attrs["model"])
        parts, settings, training, parameters = (_parsed(stored.pop(key)) for key in TEXTS)
        model = _model(name, parameters, str(attrs.get("driven_inputs", "")).split())
        reduces: Method = component("method", method)
        checked_settings(reduces, model, validated(reduces, model.kind, settings))
        if not _alike(stored.pop("fingerprint"), fingerprint(model)):
            raise FileError(f"the equations of {name} have changed since")
        reader = Parts(model, stored)
        fields = {name: reader.read(parts[name], name, of) for name, of in PARTS.items()}
        checked_fit(method, fields["reduced"])
        kinds = len(BANDS) if model.kind == "structural" else 1
        require(fields["input_range"].largest.shape == (kinds, len(model.inputs)), "largest")
        if not _alike(stored["response"], response(model, fields["reduced"])):
            raise FileError(f"{method} makes something else of these numbers")
        further = {"model": model, "method": method, "settings": settings}
        return further | {"training": tuple(training)} | fields
    except (ArithmeticError, AttributeError, LookupError, RuntimeError, TypeError) as error:
        why = one_line(error)
    except (SyntaxError, ValueError, VehiclemorError) as error:
        why = str(error)
    raise FileError(f"{path}: does not fit what is installed ({why}); reduce the model again")


def training_of(path: Path, inputs: Sequence[Quantity]) -> dict[str, str]:
    """Method of a file and what it was trained on, without the model being built."""
    stored, attrs = content(path)
    method, runs = str(attrs["method"]), json.loads(stored["training"])
    covered = training_summary(method, runs, stored["input_range.largest"], inputs)
    return {"method": method} | covered


def _parsed(text: str) -> Any:
    if len(text) > MOST_CHARACTERS:
        raise ValueError(f"a text has {len(text)} characters, more than {MOST_CHARACTERS}")
    return json.loads(text)


def fingerprint(model: Model) -> np.ndarray:
    """What a model's equations and outputs give at one state: equal for equal models."""
    state, u = model.start(), 1e-2 * np.cos(np.arange(len(model.inputs)))
    state += 1e-3 * np.cos(np.arange(len(state)))
    if model.kind == "structural":
        x = np.cos(np.arange(2 * len(model.definition.ports)))
        result = np.empty((len(model.definition.ports), 3))
        model.kernels.call("port_forces", x, u, model.constants, result)
        return result.ravel()
    equations = "residual" if model.kind == "ae" else "derivative"
    parts = [model.evaluated(name, state, u) for name in (equations, "outputs")]
    return np.concatenate(parts)


def response(model: Model, reduced: Any) -> np.ndarray:
    """What a reduced model gives after one step, full states too; none if it can't be stepped.

    Equal for equal models, whatever version of this package has reduced them.
    """
    if not hasattr(reduced, "step"):
        return np.empty(0)
    u = 1e-3 * np.cos(np.arange(len(model.inputs)))
    try:
        state = reduced.step(reduced.begin(model.starts[0], u), u, STEP)
        return np.concatenate([state, reduced.decode(state[None], u[None])[0]])
    except VehiclemorError:
        return np.empty(0)


def _alike(then: np.ndarray, now: np.ndarray) -> bool:
    rounding = ROUNDING * np.abs(now).max(initial=0.0)
    return then.shape == now.shape and np.allclose(then, now, SAME, rounding)


def _parameters(model: Model) -> dict[str, Any]:
    return {name: entry.value for name, entry in model.parameters.entries.items()}


def _model(name: str, parameters: Mapping[str, Any], driven: Sequence[str]) -> Model:
    """The model with these parameters; those of its parameter file keep their sources."""
    model = build(name, driven=driven)
    from_file = _parameters(model)
    changed = {key: value for key, value in parameters.items() if from_file.get(key) != value}
    return build(name, overrides=changed, driven=driven) if changed else model


def content(path: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Variables and attributes of an undamaged file of this format, else `FileError`."""
    shipped = data_folder() in path.absolute().parents
    with opened(path, "saved model", trusted=shipped) as file:
        attrs = {name: file.getncattr(name) for name in file.ncattrs()}
        if "saved_model" not in attrs or INTEGRITY not in file.groups:
            raise FileError(f"{path}: not a saved model")
        if attrs["saved_model"] != SCHEMA:
            was = f"format {shortened(str(attrs['saved_model']))} where this is {SCHEMA}"
            raise FileError(f"{path}: saved by another version, {was}; reduce the model again")
        # What is compressed or was never written takes no space in a file.
        if sum(8 * math.prod(variable.shape) for variable in file.variables.values()) > MOST_BYTES:
            raise FileError(f"{path}: its variables have more than {MOST_BYTES} bytes")
        return {name: variable[...] for name, variable in file.variables.items()}, attrs
