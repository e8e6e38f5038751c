"""What batches of runs give: chosen quantities at chosen times, and what is told of each run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from vehiclemor.arguments import quoted, real_array
from vehiclemor.errors import InputError
from vehiclemor.registry import choice
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.run_timer import CLOCK
from vehiclemor.simulation.trajectory import STATUSES, Trajectory
from vehiclemor.study.failure import Failure

# Times (s) that differ by less are one.
SAME_TIME = 1e-9


class Selection(NamedTuple):
    """What of each run is kept.

    Attributes
    ----------
    names
        Names of outputs, coordinates or speeds.
    places
        Where a trajectory has them: its attribute, and their number there.
    times
        In s; the signals' own output times if none.
    """

    names: tuple[str, ...]
    places: list[tuple[str, int]]
    times: np.ndarray | None


def selected(model: Model, outputs: Any, times: Any) -> Selection:
    """What a user has chosen, checked; all outputs at the signals' output times by default."""
    known = {
        name: (group, number)
        for group in ("speeds", "coordinates", "outputs")
        for number, name in enumerate(getattr(model, group))
    }
    chosen = model.outputs if outputs is None else outputs
    chosen = (chosen,) if isinstance(chosen, str) else chosen
    if not isinstance(chosen, Sequence) or not len(chosen):
        raise InputError(f"outputs is {quoted(outputs)}, not a list of names")
    places = [known[choice("output", name, known)] for name in chosen]
    if times is not None:
        try:
            times = np.atleast_1d(real_array(times))
        except (TypeError, ValueError):
            raise InputError(f"times is {quoted(times)}, no list of times in s") from None
        if times.ndim != 1 or not len(times) or not np.isfinite(times).all():
            raise InputError("times must be a list of finite times in s")
        if (np.diff(times) <= SAME_TIME).any():
            raise InputError("times must increase")
    return Selection(tuple(chosen), places, times)


class Found(NamedTuple):
    """Results of runs, into which each is written.

    Attributes
    ----------
    values
        Quantities (runs, times, names).
    status, message, remark
        Of each run, see `Trajectory`.
    indicator, until
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
    counts: np.ndarray
    seconds: np.ndarray

    @classmethod
    def empty(cls, shape: tuple[int, int, int], counts: int) -> Found:
        """Room for values of such a shape."""
        runs = shape[0]
        return cls(
            values=np.empty(shape),
            status=np.full(runs, "ok", dtype=object),
            message=np.full(runs, "", dtype=object),
            remark=np.full(runs, "", dtype=object),
            indicator=np.full(runs, np.nan),
            until=np.full(runs, np.inf),
            counts=np.zeros((runs, counts), dtype=np.int64),
            seconds=np.zeros(runs),
        )

    def fail(self, run: int, why: Failure) -> None:
        """Write a run of which there are no numbers."""
        self.values[run], self.until[run] = np.nan, 0.0
        self.status[run], self.message[run] = why.status, why.message

    def write(
        self, run: int, found: Trajectory, rows: slice | np.ndarray, chosen: Selection
    ) -> None:
        """Write what is chosen of a trajectory."""
        for place, (group, number) in enumerate(chosen.places):
            self.values[run, :, place] = getattr(found, group)[rows, number]
        self.status[run], self.message[run] = found.status, found.message
        self.remark[run], self.seconds[run] = found.remark, found.seconds
        self.counts[run] = list(found.counts.values())
        if found.trust is not None:
            self.indicator[run], self.until[run] = found.trust.indicator, found.trust.until


def dataset(model: Model, chosen: Selection, times: np.ndarray, found: Found) -> Any:
    """Labelled dataset of runs on the dimensions run, time and output."""
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
        ("seconds", "s", "time spent in the compiled loop"),
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
        "run": ("run", np.arange(len(found.status)), {"long_name": "number"}),
        "time": ("time", times, {"units": "s", "long_name": "time"}),
        "output": ("output", list(chosen.names), {"long_name": "name of the quantity"}),
        "output_unit": (
            "output",
            [units[name] for name in chosen.names],
            {"long_name": "SI unit of the quantity"},
        ),
    }
    return xr.Dataset(variables, coordinates)
