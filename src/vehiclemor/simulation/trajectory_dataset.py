"""Labelled dataset of a trajectory."""

from __future__ import annotations

from typing import TYPE_CHECKING

from vehiclemor.simulation.model import Model
from vehiclemor.simulation.run_timer import CLOCK
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

    variables: dict[str, tuple] = {}
    coordinates: dict[str, tuple] = {
        "time": ("time", trajectory.time, {"units": "s", "long_name": "time"})
    }
    for name in ("coordinates", "outputs", "inputs", "speeds"):
        quantities, label = getattr(model.definition, name), name.removesuffix("s")
        if not quantities:
            continue
        attributes = {"long_name": name, "units": f"see {label}_unit"}
        variables[name] = (("time", label), getattr(trajectory, name), attributes)
        for key, values, text in (
            (label, [q.name for q in quantities], "name"),
            (f"{label}_unit", [q.unit for q in quantities], "SI unit"),
        ):
            coordinates[key] = label, values, {"long_name": f"{text} of the {label}"}
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
    return with_units(xr.Dataset(variables | (further or {}), coordinates))


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
