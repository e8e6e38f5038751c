"""Labelled dataset of a trajectory."""

from __future__ import annotations

from typing import TYPE_CHECKING

from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import STATUSES, Trajectory

if TYPE_CHECKING:
    import xarray as xr


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

    equations = model.equations
    histories = {
        "coordinates": ("coordinate", trajectory.coordinates, equations.coordinates),
        "outputs": ("output", trajectory.outputs, equations.outputs),
        "inputs": ("input", trajectory.inputs, equations.inputs),
    }
    if model.speeds:
        histories["speeds"] = ("speed", trajectory.speeds, equations.speeds)
    variables: dict[str, tuple] = {}
    coordinates: dict[str, tuple] = {
        "time": ("time", trajectory.time, {"units": "s", "long_name": "time"})
    }
    for name, (label, values, quantities) in histories.items():
        variables[name] = (
            ("time", label),
            values,
            {"long_name": name, "units": f"see {label}_unit"},
        )
        coordinates[label] = (
            label,
            [quantity.name for quantity in quantities],
            {"long_name": f"name of the {label}"},
        )
        coordinates[f"{label}_unit"] = (
            label,
            [quantity.unit for quantity in quantities],
            {"long_name": f"SI unit of the {label}"},
        )
    for name, long_name in model.counts.items():
        attributes = {"units": "1", "long_name": long_name}
        variables[name] = ((), trajectory.counts.get(name, 0), attributes)
    variables["seconds"] = (
        (),
        trajectory.seconds,
        {"units": "s", "long_name": "time spent in the compiled loop"},
    )
    variables["status"] = ((), trajectory.status, {"long_name": f"one of {', '.join(STATUSES)}"})
    variables["message"] = ((), trajectory.message, {"long_name": "why the status is not ok"})
    variables["remark"] = ((), trajectory.remark, {"long_name": "what else there is to know"})
    return xr.Dataset(variables | (further or {}), coordinates)
