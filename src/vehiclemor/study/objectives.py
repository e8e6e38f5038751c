"""Objectives: numbers that design looks at, as functions of a run, with their derivatives."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from vehiclemor.arguments import quoted
from vehiclemor.errors import InputError
from vehiclemor.registry import choice
from vehiclemor.short_repr import ShortRepr
from vehiclemor.study.between_samples import crossing, highest

if TYPE_CHECKING:
    import xarray as xr

# Part of a run, at its end, whose mean is the steady state.
LAST = 0.1
# Smallest steady state as a part of the largest value that an overshoot can be a part of.
SMALLEST_STEADY = 1e-2
# Half of the band in which a history counts as settled, as a part of its steady state.
BAND = 0.05
# Peaks, or a peak and a band, that differ by less than this part are named: a kink is near.
NEAR = 1e-2


class Measured(NamedTuple):
    """An objective of one run.

    Attributes
    ----------
    value
        In the objective's unit; not a number where the run has none.
    weights
        Its derivatives (samples,) by the samples of each history.
    remark
        Why it has a kink or a jump here or nearby, empty if it hasn't.
    """

    value: float
    weights: tuple[np.ndarray, ...]
    remark: str = ""


Measure = Callable[..., Measured]


@dataclass(frozen=True)
class Objective(ShortRepr):
    """A number that a run has.

    Attributes
    ----------
    name, unit
        Unit of the number; `1` for a pure one.
    text
        Its definition.
    source
        Where that comes from.
    histories
        Names of the outputs, or inputs, that it is a function of.
    measure
        (times (samples,) in s, histories (samples,) ...) -> `Measured`.
    """

    repr_fields = ("name", "unit", "text")

    name: str
    unit: str
    text: str
    source: str
    histories: tuple[str, ...]
    measure: Measure

    def __call__(self, result: xr.Dataset) -> Any:
        """Value of a run, or values (run,) of many.

        Parameters
        ----------
        result
            Dataset of `simulate`, `sensitivities` or `simulate_many`, or of a reduced model's run.

        Raises
        ------
        InputError
            If it lacks a history that is needed, or the objective has no meaning for its runs.
        """
        import xarray as xr

        if not isinstance(result, xr.Dataset):
            raise InputError(f"result is {quoted(result)}, not a dataset of runs")
        histories = [_history(result, name, self.name) for name in self.histories]
        time, attributes = result["time"].values, {"units": self.unit, "long_name": self.text}
        if all(history.ndim == 1 for history in histories):
            return self.measured(time, histories).value
        each = xr.broadcast(*histories)
        columns = [history.transpose("run", "time").values for history in each]
        values = [self.measured(time, own).value for own in zip(*columns, strict=True)]
        return xr.DataArray(values, {"run": result["run"]}, "run", self.name, attributes)

    def measured(self, time: np.ndarray, histories: Sequence[Any]) -> Measured:
        """The value with its derivatives by the samples; not a number if a sample is none."""
        arrays = [np.asarray(history, dtype=float) for history in histories]
        if not all(np.isfinite(array).all() for array in arrays):
            return Measured(np.nan, tuple(np.full_like(array, np.nan) for array in arrays))
        return self.measure(time, *arrays)

    def gradient(self, result: xr.Dataset) -> xr.DataArray:
        """Derivatives (parameter,) of a run's value by the parameters of `sensitivities`.

        Where the objective has a kink or a jump, the attribute `remark` names it.

        Raises
        ------
        InputError
            If the result has no derivatives, or as of a call.
        """
        import xarray as xr

        if not isinstance(result, xr.Dataset) or "d_output" not in result:
            raise InputError("result has no derivatives: it must be of sensitivities()")
        histories = [_history(result, name, self.name) for name in self.histories]
        found = self.measured(result["time"].values, histories)
        total: Any = np.zeros(result.sizes["parameter"])
        for name, weights in zip(self.histories, found.weights, strict=True):
            # Inputs are what they are, whatever the parameters.
            if name in result["output"]:
                moved = result["d_output"].sel(output=name).transpose("time", "parameter")
                total = total + weights @ moved.values
        about = {"long_name": f"derivative of {self.name}", "remark": found.remark}
        about["units"] = f"{self.unit} / parameter_unit"
        own = {key: result[key] for key in ("parameter", "parameter_unit")}
        return xr.DataArray(total, own, "parameter", f"d_{self.name}", about)


def _history(result: xr.Dataset, name: str, objective: str) -> xr.DataArray:
    """A history by the name of an output, or of an input."""
    for variable, dimension in (("values", "output"), ("outputs", "output"), ("inputs", "input")):
        if variable in result and name in result[dimension]:
            return result[variable].sel({dimension: name})
    raise InputError(f"{objective} needs {name}, which this result has not")


def peak(time: np.ndarray, y: np.ndarray) -> Measured:
    """Largest magnitude of a history."""
    above, below = highest(time, y), highest(time, -y)
    found, sign = (above, 1.0) if above.value >= below.value else (below, -1.0)
    remark = ""
    if abs(above.value - below.value) <= NEAR * found.value:
        remark = "the peaks to both sides are almost equal: there is a kink where they are"
    elif found.time in (time[0], time[-1]):
        remark = "the peak is at an end of the run"
    return Measured(found.value, (sign * found.weights,), remark)


def _steady(time: np.ndarray, y: np.ndarray) -> tuple[float, np.ndarray]:
    """Mean over the last part of a run, and its derivatives by the samples."""
    last = time >= time[-1] - LAST * (time[-1] - time[0])
    mean = float(y[last].mean())
    if abs(mean) < SMALLEST_STEADY * np.abs(y).max():
        raise InputError("the run ends at rest: overshoot and settling are those of a step")
    return mean, last / last.sum()


def overshoot(time: np.ndarray, y: np.ndarray) -> Measured:
    """How far a history goes beyond its steady state, as a part of that."""
    steady, mean = _steady(time, y)
    top = highest(time, np.sign(steady) * y)
    value = top.value / abs(steady) - 1.0
    weights = (np.sign(steady) * top.weights - top.value / steady * mean) / abs(steady)
    remark = "" if value > NEAR else "there is hardly any overshoot: below none there is a kink"
    return Measured(value, (weights,), remark)


def settling_time(time: np.ndarray, y: np.ndarray) -> Measured:
    """Time after which a history stays in a band about its steady state."""
    steady, mean = _steady(time, y)
    # Outside of the band where it is above zero.
    away = np.abs(y - steady) - BAND * abs(steady)
    outside = np.flatnonzero(away > 0.0)
    if not len(outside):
        return Measured(float(time[0]), (np.zeros_like(y),), "it never leaves the band")
    sample = int(outside[-1])
    if sample == len(time) - 1:
        return Measured(np.nan, (np.full_like(y, np.nan),), "it does not settle within the run")
    side = np.sign(y[sample] - steady)
    found = crossing(time, side * (y - steady) - BAND * abs(steady), sample)
    moved = side * (found.weights - mean) - BAND * np.sign(steady) * mean
    later = away[sample + 1 :].max(initial=-BAND * abs(steady))
    ripple = float(later) > -NEAR * BAND * abs(steady) and len(away) > sample + 2
    remark = "a later peak almost leaves the band: there the time jumps" if ripple else ""
    return Measured(found.time, (-moved / found.slope,), remark)


def slope(time: np.ndarray, y: np.ndarray, x: np.ndarray) -> Measured:
    """Slope of the straight line through a history over another, by least squares."""
    del time
    centred = x - x.mean()
    size = float(centred @ centred)
    if not size > 0.0:
        raise InputError("the wheel does not travel: there is no slope")
    weights = centred / size
    value = float(weights @ y)
    return Measured(value, (weights, (y - y.mean() - 2.0 * value * centred) / size))


ISO_7401 = "ISO 7401:2011, lateral transient response test methods, open loop"
_MILLIKEN = "W. F. Milliken, D. L. Milliken, Race Car Vehicle Dynamics (SAE, 1995), chapter 17"
OBJECTIVES: Mapping[str, Objective] = {
    objective.name: objective
    for objective in (
        Objective(
            "peak_roll",
            "rad",
            "largest magnitude of the roll angle, between the samples too",
            "as in lane changes, such as those of ISO 3888",
            ("roll",),
            peak,
        ),
        Objective(
            "overshoot",
            "1",
            "peak of the yaw rate after a step of the steering over its steady state, less one; "
            "the steady state is the mean of the last tenth of the run",
            ISO_7401,
            ("yaw_rate",),
            overshoot,
        ),
        Objective(
            "settling_time",
            "s",
            "time in the run after which the yaw rate stays within 5 % of its steady state",
            "K. Ogata, Modern Control Engineering (5th ed., 2010), section 5-3",
            ("yaw_rate",),
            settling_time,
        ),
        Objective(
            "bump_steer",
            "rad/m",
            "toe angle over wheel travel, slope of the straight line through the run",
            _MILLIKEN,
            ("toe", "z"),
            slope,
        ),
        Objective(
            "camber_gain",
            "rad/m",
            "camber over wheel travel, slope of the straight line through the run",
            _MILLIKEN,
            ("camber", "z"),
            slope,
        ),
    )
}


def objectives() -> dict[str, str]:
    """Objectives that come with the package: name -> definition."""
    return {name: objective.text for name, objective in OBJECTIVES.items()}


def objective(name: str) -> Objective:
    """An objective by its name, see `objectives()`.

    It is called with a dataset of runs; its `gradient` with one of `sensitivities`.

    Raises
    ------
    InputError
        If there is none of that name.
    """
    return OBJECTIVES[choice("objective", name, OBJECTIVES)]
