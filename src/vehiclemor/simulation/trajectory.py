"""Trajectories: time histories with solver counts, and their labelled dataset."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import xarray as xr

    from vehiclemor.simulation.model import Model

# A named initial condition of a model, or a state (n,).
Start = str | np.ndarray
STATUSES = ("ok", "diverged", "unreachable", "rejected", "error")
# What the solvers of a kind of model count: name -> meaning.
ALGEBRAIC_COUNTS = {
    "iterations": "solver iterations",
    "residual_evaluations": "evaluations of the residual equations",
    "jacobian_evaluations": "evaluations of the Jacobian",
    "linear_solves": "solutions of a linear system, or products with a constant inverse",
}
DYNAMIC_COUNTS = {
    "rhs_calls": "evaluations of the right-hand side",
    "steps": "accepted steps",
    "rejected_steps": "rejected steps",
    "jacobian_evaluations": "Jacobians, by differences of the right-hand side",
    "factorisations": "LU factorisations of an iteration matrix",
    "linear_solves": "solutions of a linear system, or products with a stored inverse",
}


@dataclass(frozen=True)
class Trajectory:
    """Result of one simulation.

    Attributes
    ----------
    time
        Output times (samples,) in s.
    inputs, coordinates, speeds, outputs
        Histories (samples, number of quantities), SI units; a kinematic model has 0 speeds.
    counts
        Solver counts by name, those of `Model.counts`.
    seconds
        Time spent in the compiled loop; 0 where nothing was computed.
    status
        One of `STATUSES`; from the failure on, a diverged trajectory is not a number.
    message
        Why it diverged, empty if it did not.
    remark
        What else there is to know, such as wheels that leave the ground.
    """

    time: np.ndarray
    inputs: np.ndarray
    coordinates: np.ndarray
    speeds: np.ndarray
    outputs: np.ndarray
    counts: dict[str, int]
    seconds: float
    status: str = "ok"
    message: str = ""
    remark: str = ""

    @property
    def states(self) -> np.ndarray:
        """Coordinates and speeds side by side (samples, n)."""
        return np.hstack((self.coordinates, self.speeds))


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
