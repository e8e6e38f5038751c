"""What batches of runs give: chosen quantities at chosen times, and what is told of each run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from vehiclemor.arguments import quoted, real_array
from vehiclemor.errors import InputError
from vehiclemor.maneuver import Maneuver
from vehiclemor.registry import choice
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.run_timer import CLOCK
from vehiclemor.simulation.trajectory import STATUSES, Trajectory

# Times (s) that differ by less are one.
SAME_TIME = 1e-9


class Selection(NamedTuple):
    """What of each run is kept.

    Attributes
    ----------
    names
        Names of outputs, coordinates or speeds.
    columns
        Their numbers among the states and, behind these, the outputs.
    times
        In s; the signals' own output times if none.
    """

    names: tuple[str, ...]
    columns: np.ndarray
    times: np.ndarray | None

    def part(self, times: np.ndarray, names: np.ndarray) -> Selection:
        """Some of the names, by their numbers, at some of the times."""
        return Selection(tuple(self.names[k] for k in names), self.columns[names], times)

    def samples(self, maneuver: Maneuver) -> tuple[np.ndarray | None, np.ndarray]:
        """Times at which a run is recorded, if not at its own output times, and the rows kept.

        Recorded are all of its own output times too: there a run is watched.
        """
        times = maneuver.times
        if self.times is None:
            return None, np.arange(len(times))
        rows = np.minimum(np.searchsorted(times, self.times - SAME_TIME), len(times) - 1)
        if (abs(times[rows] - self.times) <= SAME_TIME).all():
            return None, rows
        times = np.unique(np.concatenate([times, self.times]))
        return times, np.searchsorted(times, self.times)


def selected(model: Model, outputs: Any, times: Any) -> Selection:
    """What a user has chosen, checked; all outputs at the signals' output times by default."""
    known = {name: k for k, name in enumerate((*model.definition.states, *model.outputs))}
    chosen = model.outputs if outputs is None else outputs
    chosen = (chosen,) if isinstance(chosen, str) else chosen
    if not isinstance(chosen, Sequence) or not len(chosen):
        raise InputError(f"outputs is {quoted(outputs)}, not a list of names")
    columns = [known[choice("output", name, known)] for name in chosen]
    if times is not None:
        try:
            times = np.atleast_1d(real_array(times))
        except (TypeError, ValueError):
            raise InputError(f"times is {quoted(times)}, no list of times in s") from None
        if times.ndim != 1 or not len(times) or not np.isfinite(times).all():
            raise InputError("times must be a list of finite times in s")
        if (np.diff(times) <= SAME_TIME).any():
            raise InputError("times must increase")
    return Selection(tuple(chosen), np.array(columns, dtype=np.int64), times)


class Found(NamedTuple):
    """Results of some runs.

    Attributes
    ----------
    values
        Quantities (runs, times, names).
    status, message, remark
        Of each run, see `Trajectory`.
    indicator, until, reason
        What each run tells of itself, see `Trust`; the first is not a number where it is nothing.
    counts
        Solver counts (runs, counts).
    seconds
        Time in compiled loops (runs,).
    """

    values: np.ndarray
    status: np.ndarray
    message: np.ndarray
    remark: np.ndarray
    indicator: np.ndarray
    until: np.ndarray
    reason: np.ndarray
    counts: np.ndarray
    seconds: np.ndarray

    @classmethod
    def empty(cls, runs: int, shape: tuple[int, int], counts: int) -> Found:
        """Room for so many runs."""
        status, message, remark, reason = (
            np.full(runs, text, dtype=object) for text in ("ok", "", "", "")
        )
        values, whole = np.empty((runs, *shape)), np.zeros((runs, counts), dtype=np.int64)
        told = np.full(runs, np.nan), np.full(runs, np.inf), reason
        return cls(values, status, message, remark, *told, whole, np.zeros(runs))

    def write(self, runs: Any, other: Found) -> None:
        """Write results of some of the runs."""
        for array, values in zip(self, other, strict=True):
            array[runs] = values

    def refuse(self, refused: Mapping[int, str], status: str = "rejected") -> None:
        """Write runs (number -> why) of which there are no numbers."""
        for run, why in refused.items():
            self.values[run], self.until[run] = np.nan, 0.0
            self.status[run], self.message[run] = status, why

    def write_trajectory(self, run: int, found: Trajectory, rows: np.ndarray, columns: Any) -> None:
        """Write a trajectory, of which some rows and columns are kept."""
        table = np.hstack([found.coordinates, found.speeds, found.outputs])
        self.values[run] = table[np.ix_(rows, columns)]
        self.status[run], self.message[run] = found.status, found.message
        self.remark[run], self.seconds[run] = found.remark, found.seconds
        self.counts[run] = list(found.counts.values())
        if found.trust is not None:
            trust = found.trust
            self.indicator[run], self.until[run] = trust.indicator, trust.until
            self.reason[run] = trust.reason


def dataset(
    model: Model, chosen: Selection, times: np.ndarray, found: Found, first: int = 0
) -> Any:
    """Labelled dataset of runs on the dimensions run, time and output.

    Parameters
    ----------
    first
        Number of the first of the runs.
    """
    import xarray as xr

    declared = (*model.definition.outputs, *model.definition.coordinates, *model.definition.speeds)
    units = {quantity.name: quantity.unit for quantity in reversed(declared)}
    variables: dict[str, Any] = {
        "values": (("run", "time", "output"), found.values, {"long_name": "quantities"})
    }
    for name, unit, long_name in (
        ("status", "", f"one of {', '.join(STATUSES)}"),
        ("message", "", "why the status is not ok"),
        ("remark", "", "what else there is to know"),
        ("indicator", "1", "how far the run goes in what its model knows; 1 is the edge"),
        ("until", "s", "time at which the indicator has first passed 1"),
        ("seconds", "s", "time spent in the compiled loop, the mean of runs done together"),
    ):
        attributes = {"long_name": long_name} | ({"units": unit} if unit else {})
        if name == "seconds":
            attributes["clock"] = CLOCK
        values = getattr(found, name)
        variables[name] = (
            "run",
            values.astype(str) if values.dtype == object else values,
            attributes,
        )
    for k, (name, long_name) in enumerate(model.counts.items()):
        variables[name] = "run", found.counts[:, k], {"units": "1", "long_name": long_name}
    coordinates = {
        "run": ("run", np.arange(first, first + len(found.status)), {"long_name": "number"}),
        "time": ("time", times, {"units": "s", "long_name": "time"}),
        "output": ("output", list(chosen.names), {"long_name": "name of the quantity"}),
        "output_unit": (
            "output",
            [units[name] for name in chosen.names],
            {"long_name": "SI unit of the quantity"},
        ),
    }
    return xr.Dataset(variables, coordinates)
