"""Handling tests that engineers look at first: frequency response, sine with dwell."""

from collections.abc import Iterator

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vehiclemor.exceptions import InputError
from vehiclemor.handling.motion import Motion
from vehiclemor.handling.steering_tests import (
    FREQUENCIES,
    RATIOS,
    dwell_of,
    frequency_response,
)
from vehiclemor.report import labels
from vehiclemor.report.figures import theme
from vehiclemor.report.figures.runs import Runs, legend_of, runs_of
from vehiclemor.report.figures.theme import FULL, THIN, Style
from vehiclemor.simulation.trajectory import FINISHED

SIZE = (6.7, 5.0)
LIMIT: Style = {"color": "black", "marker": "_", "markersize": 14, "linestyle": "none"}


def _motions(runs: Runs) -> Iterator[tuple[str, Style, Motion]]:
    """Text of the legend, style and motion of full order and of the runs that have ended."""
    if "inputs" not in runs.full:
        raise InputError("the result has no inputs: a handling test is drawn over the steering")
    if bool(runs.full["reference_outputs"].notnull().all()):
        yield "full order", FULL, _motion(runs.full, "reference_outputs")
    for curve in runs.curves:
        if curve.run["status"].item() in FINISHED:
            yield curve.text, curve.style, _motion(curve.run, "outputs")


def _motion(run: xr.Dataset, variable: str) -> Motion:
    names = tuple(map(str, run["input"].values))
    inputs = run["inputs"].transpose("time", "input").values
    outputs = tuple(map(str, run["output"].values))

    def history(name: str) -> np.ndarray:
        return run[variable].sel(output=name).values

    return Motion.of(run["time"].values, names, inputs, outputs, history, np.nan)


def figure_frequency_response(dataset: xr.Dataset) -> Figure:
    """Gain and phase of yaw rate and lateral acceleration over the frequency of the steering."""
    figure, axes = theme.panels(2, 2, SIZE, sharex=True)
    for text, style, motion in _motions(runs_of(dataset, legend_of(dataset))):
        response = frequency_response(motion)
        for (gain, phase), name in zip(axes.T, ("yaw_rate", "lateral_acceleration"), strict=True):
            gain.plot(FREQUENCIES, response[f"{name}_gain"], label=text, **style)
            phase.plot(FREQUENCIES, np.degrees(response[f"{name}_phase"]), **style)
    titles = {"yaw rate": "1/s", "lateral acceleration": "m/s^2/rad"}
    for number, (axis, (title, unit)) in enumerate(zip(axes[0], titles.items(), strict=True)):
        axis.set_title(theme.letter(number, title))
        axis.set_ylabel(f"gain ({labels.raised(unit)})")
        axis.set_ylim(bottom=0.0)
    for axis in axes[1]:
        axis.set_ylabel("phase (degrees)")
        axis.set_xlabel("frequency of the steering (Hz)")
        axis.set_xlim(0.0, FREQUENCIES[-1])
    theme.legend_below(figure, axes[0])
    return figure


def figure_sine_with_dwell(dataset: xr.Dataset) -> Figure:
    """Steering and yaw rate; the times after the steering, and how much yaw rate they allow."""
    figure, (steering, yaw_rate) = theme.panels(2, 1, SIZE, sharex=True)
    steering, yaw_rate = steering[0], yaw_rate[0]
    motions = list(_motions(runs_of(dataset, legend_of(dataset))))
    for text, style, motion in motions:
        yaw_rate.plot(motion.times, motion.yaw_rate, label=text, **style)
    if motions:
        *_, first = motions[0]
        factor, unit = labels.readable_unit(float(np.abs(first.wheel_angle).max()), "rad")
        steering.plot(first.times, factor * first.wheel_angle, color="black")
        steering.set_ylabel(f"angle of the\nfront wheels ({unit})")
        _mark_times(first, steering, yaw_rate)
        yaw_rate.set_xlim(first.times[0], first.times[-1])
    for number, axis in enumerate((steering, yaw_rate)):
        axis.set_title(theme.letter(number))
    yaw_rate.set_ylabel("yaw rate (rad/s)")
    yaw_rate.set_xlabel("time (s)")
    theme.legend_below(figure, [yaw_rate])
    return figure


def _mark_times(motion: Motion, steering: Axes, yaw_rate: Axes) -> None:
    """Times at which the yaw rate must be small, with their names, and the largest allowed."""
    dwell = dwell_of(motion)
    for after, ratio in RATIOS.values():
        time = dwell.end + after
        for axis in (steering, yaw_rate):
            axis.axvline(time, linestyle=":", **THIN)
        steering.annotate(
            f"{after:g} s after",
            (time, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(0, 2),
            textcoords="offset points",
            ha="center",
            va="bottom",
        )
        limit = -dwell.side * ratio * dwell.peak
        yaw_rate.plot(time, limit, label="largest allowed (FMVSS 126)", **LIMIT)
