"""Trajectories: time histories with solver counts, and their labelled dataset."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vehiclemor.short_repr import ShortRepr

# A named initial condition of a model, or a state (n,).
Start = str | tuple[float, ...] | np.ndarray
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
# By kind of model; the second is how often the equations were evaluated.
COUNTS = {"ae": ALGEBRAIC_COUNTS, "ode": DYNAMIC_COUNTS, "dae": DYNAMIC_COUNTS}
EVALUATIONS = {"ae": "residual_evaluations", "ode": "rhs_calls", "dae": "rhs_calls"}


@dataclass(frozen=True)
class Trajectory(ShortRepr):
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
        CPU time of the thread in the compiled loop; 0 where nothing was computed.
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
