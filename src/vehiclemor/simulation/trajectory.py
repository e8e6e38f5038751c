"""Trajectories: time histories with solver counts, and their labelled dataset."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.arguments import check_shapes, quoted
from vehiclemor.exceptions import InputError
from vehiclemor.inputs.excitation import checked_times
from vehiclemor.multibody.definition import STATE_KINDS, ModelDefinition
from vehiclemor.registry import choice
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.run_timer import CLOCK

if TYPE_CHECKING:
    import xarray as xr

HISTORIES = ("coordinates", "outputs", "inputs", "speeds", "further_states")
# s before the end of the full-order run, or its stop, from which on a stop is early.
EARLY = 0.5
# Times (s) that differ by less are one.
SAME_TIME = 1e-9

# A named initial condition of a model, or a state (n,).
Start = str | tuple[float, ...] | np.ndarray
# Outputs, coordinates or speeds; all outputs where there are none.
Names = str | Sequence[str] | None
STATUSES = ("ok", "untrusted", "stopped", "diverged", "unreachable", "rejected", "error")
# Of a run without complaint; `stopped` the vehicle has come to rest, where its model ends.
WITHOUT_COMPLAINT = ("ok", "stopped")
# Of a run that has come to its end; `untrusted` it has left what its model knows, and says so.
FINISHED = (*WITHOUT_COMPLAINT, "untrusted")
# What a run says of itself, in datasets.
REPORTED = {
    "status": f"one of {', '.join(STATUSES)}",
    "message": "why the status is not ok",
    "remark": "what else there is to know",
}
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
STRUCTURAL_COUNTS = {
    "steps": "steps",
    "port_evaluations": "evaluations of the port forces",
    "linear_solves": "solutions of the linear system of a step",
}
# By kind of model; the second is how often the equations were evaluated.
COUNTS = {"ae": ALGEBRAIC_COUNTS, "ode": DYNAMIC_COUNTS, "dae": DYNAMIC_COUNTS}
COUNTS["structural"] = STRUCTURAL_COUNTS
EVALUATIONS = {"ae": "residual_evaluations", "ode": "rhs_calls", "dae": "rhs_calls"}
EVALUATIONS["structural"] = "port_evaluations"


@dataclass(frozen=True)
class Trust:
    """How far a reduced model trusts its run.

    The indicator is the largest value in the run of what tells how far it goes: 1 is the edge of
    what it knows.  `until` is the time in s at which it has first passed 1, infinite if it never
    has; the reason is by what the run leaves, empty if it does not.
    """

    indicator: float
    until: float = np.inf
    reason: str = ""

    @property
    def message(self) -> str:
        """By what and when it leaves, empty if it does not."""
        return f"{self.reason}, from t = {self.until:.4g} s on" if self.reason else ""


@dataclass(frozen=True, eq=False)
class Trajectory(ShortRepr):
    """Result of one simulation.

    Attributes
    ----------
    times
        Output times (samples,) in s.
    inputs, coordinates, speeds, further_states, outputs
        Histories (samples, number of quantities), SI units; a kinematic model has 0 speeds.
    counts
        Solver counts by name, those of `Model.counts`.
    seconds
        CPU time of the thread in the compiled loop; 0 where nothing was computed.
    status
        One of `STATUSES`; from the failure on a diverged trajectory is not a number, from its stop
        on a stopped one.
    message
        Why it is not ok, empty if it is.
    remark
        What else there is to know, such as wheels that leave the ground.
    trust
        What a reduced model tells of this run; none of a model that is the full one.
    names
        Of the outputs.
    model
        Of which it is.
    method
        By which it was reduced; empty for a run of the full model.
    maneuver
        Name of the input.
    error_estimate
        Of a reduced vehicle or mechanism, see `reduction.error_estimate.ErrorEstimate`; else none.
    """

    times: np.ndarray
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
    model: Any = None
    method: str = ""
    maneuver: str = ""
    further_states: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    error_estimate: Any = field(default=None, repr=False)

    # Outputs have names: Python would try the numbers 0, 1, ... otherwise.
    __iter__ = None

    def __post_init__(self) -> None:
        """By default there are no further states at all samples."""
        if not self.further_states.size:
            object.__setattr__(self, "further_states", self.inputs[:, :0])

    def check_sizes(self) -> None:
        """Raise `ValueError` if histories are of other samples than the times."""
        samples = max(len(self.times), 1)
        check_shapes("times", (self.times, samples))
        for history in (self.inputs, self.coordinates, self.speeds, self.outputs):
            check_shapes("samples", (history, samples, *history.shape[1:2]))

    @classmethod
    def of(cls, **fields: Any) -> Trajectory:
        """A trajectory of these fields, in a third of the time that the constructor takes.

        A `recording` instead of coordinates, speeds and outputs gives these when one of them is
        first read.
        """
        trajectory = object.__new__(cls)
        trajectory.__dict__.update(fields)
        return trajectory

    def __getattr__(self, name: str) -> Any:
        """Histories that nobody has read so far, see `of`."""
        fields = self.__dict__
        if name == "further_states" and "recording" not in fields:
            return self.inputs[:, :0]
        if name not in (*STATE_KINDS, "outputs") or "recording" not in fields:
            raise AttributeError(f"{type(self).__name__} has no {name}")
        recording, n = fields["recording"], len(fields["model"].coordinates)
        if name == "outputs":
            fields[name] = recording.output_history
        else:
            fields["coordinates"] = recording.state_history[:, :n]
            fields["speeds"] = recording.state_history[:, n : 2 * n]
            fields["further_states"] = recording.state_history[:, 2 * n :]
        return fields[name]

    def __getitem__(self, name: str) -> np.ndarray:
        """History (samples,) of an output, a coordinate or a speed, without the others."""
        return self._columns((name,))[:, 0]

    def _columns(self, names: tuple[str, ...]) -> np.ndarray:
        """Histories (samples, names) of outputs, coordinates or speeds."""
        if names == self.names:
            return self.outputs
        recording = self.__dict__.get("recording")
        if recording is not None and "outputs" not in self.__dict__:
            return recording.columns(names)
        groups = {"outputs": self.names}
        if recording is not None or self.coordinates.shape[1]:
            groups |= {group: getattr(self.model, group, ()) for group in STATE_KINDS}
        columns = {
            name: (group, column)
            for group in reversed(groups)
            for column, name in enumerate(groups[group])
        }
        histories = []
        for name in names:
            group, column = columns[choice("quantity", name, columns)]
            histories.append(getattr(self, group)[:, column])
        return np.stack(histories, 1)

    def chosen(self, outputs: Names = None, times: Any = None) -> Trajectory:
        """The same run with some outputs alone, at some of its output times.

        Parameters
        ----------
        outputs
            Name or names of outputs, coordinates or speeds, which become the outputs of the run:
            it has no coordinates and speeds then.  All outputs by default.
        times
            Output times in s, increasing; all by default.
        """
        fields = dict(self.__dict__)
        if outputs is not None:
            names = output_names(outputs)
            nothing = self.inputs[:, :0]
            fields.pop("recording", None)
            fields |= {"names": names, **dict.fromkeys(STATE_KINDS, nothing)}
            fields["outputs"] = self._columns(names)
        if times is not None:
            rows = sample_rows(times, self.times)
            for history in ("times", "inputs", *STATE_KINDS, "outputs"):
                if history in fields:
                    fields[history] = fields[history][rows]
            if "recording" in fields:
                fields["recording"] = fields["recording"].at(rows)
        return Trajectory.of(**fields)

    def dataset(self) -> xr.Dataset:
        """Labelled dataset of histories, counts, seconds and status, with units."""
        dataset = trajectory_dataset(self.model, self).assign_attrs(model=self.model.name)
        return dataset.assign_attrs(method=self.method) if self.method else dataset

    @property
    def finished(self) -> bool:
        """Whether the run has come to its end, trusted or not."""
        return self.status in FINISHED

    @property
    def samples_to_stop(self) -> int:
        """Number of samples before the vehicle stops; all of a run that does not stop."""
        if self.status != "stopped":
            return len(self.times)
        return int(np.isfinite(self.outputs[:, 0]).sum())

    def stops_early(self, full: Trajectory) -> bool:
        """Whether the vehicle stops where that of the full-order run drives on for a while."""
        if self.status != "stopped":
            return False
        stop, full_stop = (min(run.samples_to_stop, len(run.times) - 1) for run in (self, full))
        return bool(full.times[full_stop] - self.times[stop] > EARLY)

    def judged(self, trust: Trust | None) -> Trajectory:
        """The same with what its model tells of it; untrusted if that is that it has left."""
        if trust is None or self.status not in ("ok", "untrusted") or not trust.reason:
            return Trajectory.of(**self.__dict__ | {"trust": trust})
        verdict = {"trust": trust, "status": "untrusted", "message": trust.message}
        return Trajectory.of(**self.__dict__ | verdict)

    @property
    def states(self) -> np.ndarray:
        """Coordinates, speeds and further states side by side (samples, n)."""
        if "recording" in self.__dict__:
            return self.__dict__["recording"].state_history
        return np.hstack((self.coordinates, self.speeds, self.further_states))

    def states_at(self, rows: np.ndarray) -> np.ndarray:
        """States (rows, n) at some of the samples; of a run that nobody has read, no others."""
        recording = self.__dict__.get("recording")
        return self.states[rows] if recording is None else recording.at(rows).state_history


def output_names(outputs: Any, what: str = "outputs") -> tuple[str, ...]:
    """Names of chosen outputs, or of something else; `InputError` if they are none."""
    names = (outputs,) if isinstance(outputs, str) else outputs
    if isinstance(names, np.ndarray):
        names = names.ravel().tolist()
    if type(names) not in (tuple, list) or not names or not all(isinstance(n, str) for n in names):
        raise InputError(f"{what} is {quoted(outputs)}, not a list of names")
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f"{what}: {quoted(twice)} stands twice")
    return tuple(names)


def sample_rows(times: Any, known: np.ndarray) -> np.ndarray:
    """Numbers of the samples at some of the output times, all in s.

    `InputError` if the times don't increase, or one of them is no output time.
    """
    wanted = checked_times(times if np.iterable(times) else [times])
    if not len(wanted) or (np.diff(wanted) <= SAME_TIME).any():
        raise InputError("times must be one or more, and increase")
    rows = np.minimum(np.searchsorted(known, wanted - SAME_TIME), len(known) - 1)
    missed = abs(known[rows] - wanted) > SAME_TIME
    if missed.any():
        raise InputError(
            f"{wanted[missed.argmax()]:g} s is no output time; they go from {known[0]:g} to "
            f"{known[-1]:g} s by {known[min(1, len(known) - 1)] - known[0]:g} s"
        )
    return rows


def trajectory_dataset(
    model: Any, trajectory: Trajectory, further: dict[str, tuple] | None = None
) -> xr.Dataset:
    """Labelled dataset of histories, counts, seconds, status and further variables, with units."""
    import xarray as xr

    variables: dict[str, tuple] = {}
    for name in HISTORIES:
        history = getattr(trajectory, name)
        if history.shape[1]:
            label = name.removesuffix("s")
            attributes = {"long_name": name, "units": f"see {label}_unit"}
            variables[name] = (("time", label), history, attributes)
    held = tuple(variables)
    for name, long_name in model.counts.items():
        attributes = {"units": "1", "long_name": long_name}
        variables[name] = ((), trajectory.counts.get(name, 0), attributes)
    seconds = {"units": "s", "long_name": "time spent in the compiled loop", "clock": CLOCK}
    variables["seconds"] = ((), trajectory.seconds, seconds)
    for name, long_name in REPORTED.items():
        variables[name] = ((), getattr(trajectory, name), {"long_name": long_name})
    names = trajectory.names or model.outputs
    labels = _labels(model.definition, held, names, trajectory.times.tobytes())
    return with_units(xr.Dataset(variables | (further or {}), labels))


# An index of names takes a tenth of a millisecond to make.
@lru_cache(maxsize=16)
def _labels(
    definition: ModelDefinition, histories: tuple[str, ...], names: tuple[str, ...], times: bytes
) -> xr.Coordinates:
    """Times, and names and units of histories; the outputs are those of the names."""
    import xarray as xr

    seconds = np.frombuffer(times)
    labels: dict[str, tuple] = {"time": ("time", seconds, {"units": "s", "long_name": "time"})}
    declared = (*definition.outputs, *definition.state_quantities)
    known = {quantity.name: quantity for quantity in reversed(declared)}
    for name in histories:
        quantities, label = getattr(definition, name), name.removesuffix("s")
        if name == "outputs":
            quantities = [known[output] for output in names]
        for key, values, text in (
            (label, [q.name for q in quantities], "name"),
            (f"{label}_unit", [q.unit for q in quantities], "SI unit"),
        ):
            array = np.array(values)
            array.flags.writeable = False
            labels[key] = label, array, {"long_name": f"{text} of the {label}"}
    return xr.Dataset(coords=labels).coords


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
