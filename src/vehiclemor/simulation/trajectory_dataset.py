"""Labelled dataset of a trajectory."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from vehiclemor.multibody.definition import ModelDefinition
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.run_timer import CLOCK
from vehiclemor.simulation.trajectory import STATUSES, Trajectory

if TYPE_CHECKING:
    import xarray as xr

HISTORIES = ("coordinates", "outputs", "inputs", "speeds")


def trajectory_dataset(
    model: Model, trajectory: Trajectory, further: dict[str, tuple] | None = None
) -> xr.Dataset:
    """Labelled dataset of a trajectory: histories, counts, seconds and status, with units.

    Parameters
    ----------
    further
        Name -> (dimensions, values, attributes) of variables to add.
    """
    import xarray as xr

    variables: dict[str, tuple] = {}
    for name in HISTORIES:
        if getattr(model.definition, name):
            label = name.removesuffix("s")
            attributes = {"long_name": name, "units": f"see {label}_unit"}
            variables[name] = (("time", label), getattr(trajectory, name), attributes)
    for name, long_name in model.counts.items():
        attributes = {"units": "1", "long_name": long_name}
        variables[name] = ((), trajectory.counts.get(name, 0), attributes)
    seconds = {"units": "s", "long_name": "time spent in the compiled loop", "clock": CLOCK}
    variables["seconds"] = ((), trajectory.seconds, seconds)
    for name, long_name in (
        ("status", f"one of {', '.join(STATUSES)}"),
        ("message", "why the status is not ok"),
        ("remark", "what else there is to know"),
    ):
        variables[name] = ((), getattr(trajectory, name), {"long_name": long_name})
    labels = _labels(model.definition, trajectory.time.tobytes())
    return with_units(xr.Dataset(variables | (further or {}), labels))


# An index of names takes a tenth of a millisecond to make.
@lru_cache(maxsize=16)
def _labels(definition: ModelDefinition, times: bytes) -> xr.Coordinates:
    """Times, names and units."""
    import xarray as xr

    seconds = np.frombuffer(times)
    found: dict[str, tuple] = {"time": ("time", seconds, {"units": "s", "long_name": "time"})}
    for name in HISTORIES:
        quantities, label = getattr(definition, name), name.removesuffix("s")
        if not quantities:
            continue
        for key, values, text in (
            (label, [q.name for q in quantities], "name"),
            (f"{label}_unit", [q.unit for q in quantities], "SI unit"),
        ):
            array = np.array(values)
            array.flags.writeable = False
            found[key] = label, array, {"long_name": f"{text} of the {label}"}
    return xr.Dataset(coords=found).coords


def with_units(dataset: xr.Dataset) -> xr.Dataset:
    """The dataset with a unit at each variable that has one.

    `see output_unit` becomes the unit of all outputs if they share one, and is left out otherwise:
    a plot would show it.  The unit of each output stays beside it.
    """
    for variable in dataset.variables.values():
        if str(variable.attrs.get("units", "")).startswith("see "):
            of = variable.attrs.pop("units").removeprefix("see ")
            units = set(dataset.variables[of].values.tolist())
            variable.attrs |= {"units": units.pop()} if len(units) == 1 else {}
    return dataset
