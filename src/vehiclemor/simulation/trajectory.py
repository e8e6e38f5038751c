"""Trajectories: time histories with solver counts, and their labelled dataset."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import xarray as xr

    from vehiclemor.simulation.algebraic import AlgebraicModel

COUNTS = {
    "iterations": "solver iterations",
    "residual_evaluations": "evaluations of the residual equations",
    "jacobian_evaluations": "evaluations of the Jacobian",
    "linear_solves": "solutions of a linear system, or products with a constant inverse",
}


@dataclass(frozen=True)
class Trajectory:
    """Result of one simulation.

    Attributes
    ----------
    time
        Output times (samples,) in s.
    inputs, coordinates, outputs
        Histories (samples, number of quantities), SI units.
    counts
        Solver counts by name.
    seconds
        Time spent in the compiled loop; 0 where nothing was computed.
    status
        `ok` or `diverged`; from the failure on, a diverged trajectory is not a number.
    message
        Why it diverged, empty if it did not.
    """

    time: np.ndarray
    inputs: np.ndarray
    coordinates: np.ndarray
    outputs: np.ndarray
    counts: dict[str, int]
    seconds: float
    status: str = "ok"
    message: str = ""


def trajectory_dataset(model: AlgebraicModel, trajectory: Trajectory) -> xr.Dataset:
    """Labelled dataset of a trajectory: histories, counts and seconds, with units."""
    import xarray as xr

    def labels(quantities: tuple) -> list[str]:
        return [quantity.name for quantity in quantities]

    def units(quantities: tuple) -> str:
        return ", ".join(f"{quantity.name}: {quantity.unit}" for quantity in quantities)

    equations = model.equations
    histories = {
        "coordinates": ("coordinate", trajectory.coordinates, equations.coordinates),
        "outputs": ("output", trajectory.outputs, equations.outputs),
        "inputs": ("input", trajectory.inputs, equations.inputs),
    }
    dataset = xr.Dataset(
        {
            name: (("time", label), values, {"long_name": f"{name}", "units": units(quantities)})
            for name, (label, values, quantities) in histories.items()
        },
        coords={
            "time": ("time", trajectory.time, {"units": "s", "long_name": "time"}),
            **{label: (label, labels(quantities)) for label, _, quantities in histories.values()},
        },
    )
    for name, long_name in COUNTS.items():
        dataset[name] = ((), trajectory.counts.get(name, 0), {"units": "1", "long_name": long_name})
    dataset["seconds"] = (
        (),
        trajectory.seconds,
        {"units": "s", "long_name": "time spent in the compiled loop"},
    )
    for label, _, quantities in histories.values():
        dataset[label].attrs["long_name"] = f"name of the {label}"
        dataset.coords[f"{label}_unit"] = (
            label,
            [quantity.unit for quantity in quantities],
            {"long_name": f"SI unit of the {label}"},
        )
    dataset.attrs |= {"status": trajectory.status, "message": trajectory.message}
    return dataset
