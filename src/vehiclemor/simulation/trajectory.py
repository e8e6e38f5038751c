"""Trajectories: time histories with solver counts, and their labelled dataset."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from vehiclemor.registry import choice
from vehiclemor.short_repr import ShortRepr
from vehiclemor.sizes import shaped

# A named initial condition of a model, or a state (n,).
Start = str | tuple[float, ...] | np.ndarray
STATUSES = ("ok", "untrusted", "diverged", "unreachable", "rejected", "error")
# Of a run that has come to its end; `untrusted` it has left what its model knows, and says so.
FINISHED = ("ok", "untrusted")
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
class Trust:
    """What a reduced model tells of its own run.

    Attributes
    ----------
    indicator
        Largest value in the run of what tells how far it goes: 1 is the edge of what it knows.
    until
        Time in s at which the indicator has first passed 1; infinite if it never has.
    reason
        By what it leaves, empty if it does not.
    """

    indicator: float
    until: float = np.inf
    reason: str = ""

    @property
    def message(self) -> str:
        """When and by what it leaves, empty if it does not."""
        return f"from t = {self.until:.4g} s on {self.reason}" if self.reason else ""


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
        Why it is not ok, empty if it is.
    remark
        What else there is to know, such as wheels that leave the ground.
    trust
        What a reduced model tells of this run; none of a model that is the full one.
    names
        Of the outputs.
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
    trust: Trust | None = None
    names: tuple[str, ...] = ()

    # Outputs have names: Python would try the numbers 0, 1, ... otherwise.
    __iter__ = None

    def check_sizes(self) -> None:
        """Raise `ValueError` if histories are of other samples than the times."""
        samples = max(len(self.time), 1)
        shaped("time", (self.time, samples))
        for history in (self.inputs, self.coordinates, self.speeds, self.outputs):
            shaped("samples", (history, samples, *history.shape[1:2]))

    @classmethod
    def of(cls, **fields: Any) -> Trajectory:
        """A trajectory of these fields, in a third of the time that the constructor takes.

        A `recording` in the place of coordinates, speeds and outputs gives these when one of them
        is first read.
        """
        found = object.__new__(cls)
        found.__dict__.update(fields)
        return found

    def __getattr__(self, name: str) -> Any:
        """Histories that nobody has read so far, see `of`."""
        if name not in ("coordinates", "speeds", "outputs") or "recording" not in self.__dict__:
            raise AttributeError(f"{type(self).__name__} has no {name}")
        self.__dict__.update(self.__dict__.pop("recording").histories())
        return self.__dict__[name]

    def __getitem__(self, output: str) -> np.ndarray:
        """History (samples,) of an output, without the others.

        Raises
        ------
        InputError
            If there is no such output.
        """
        number = self.names.index(choice("output", output, self.names))
        if "recording" in self.__dict__:
            return self.__dict__["recording"].output(number)
        return self.outputs[:, number]

    def __getstate__(self) -> dict[str, Any]:
        """All fields, read."""
        assert self.outputs is not None
        return self.__dict__

    @property
    def finished(self) -> bool:
        """Whether the run has come to its end, trusted or not."""
        return self.status in FINISHED

    def judged(self, trust: Trust | None) -> Trajectory:
        """The same with what its model tells of it; untrusted if that is that it has left."""
        if trust is None or self.status not in ("ok", "untrusted") or not trust.reason:
            return Trajectory.of(**self.__dict__ | {"trust": trust})
        told = {"trust": trust, "status": "untrusted", "message": trust.message}
        return Trajectory.of(**self.__dict__ | told)

    def chosen(self, outputs: Any = None, times: Any = None) -> Trajectory:  # noqa: ARG002
        """The run restricted to some outputs and times."""
        return self

    @property
    def states(self) -> np.ndarray:
        """Coordinates and speeds side by side (samples, n)."""
        return np.hstack((self.coordinates, self.speeds))
