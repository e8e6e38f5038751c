"""Handling tests that engineers look at first: frequency response, sine with dwell."""

from collections.abc import Iterator

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from vehiclemor.exceptions import InputError
from vehiclemor.handling.motion import Motion
from vehiclemor.handling.open_loop_tests import (
    FREQUENCIES,
    RATIO_TIMES,
    frequency_response,
    steering_interval,
)
from vehiclemor.report import labels
from vehiclemor.report.figures import theme
from vehiclemor.report.figures.runs import legend_of, runs_of
from vehiclemor.report.figures.theme import FULL, THIN, Style
from vehiclemor.simulation.trajectory import FINISHED

SIZE = (6.7, 5.0)


def _motions(dataset: xr.Dataset) -> Iterator[tuple[str, Style, Motion]]:
    """Text of the legend, style and motion of full order and of the runs that have ended."""
    runs = runs_of(dataset, legend_of(dataset))
    if "inputs" not in runs.full:
        raise InputError("the result has no inputs: a handling test is drawn over the steering")
    if bool(runs.full["reference_outputs"].notnull().all()):
        yield "full order", FULL, _motion(runs.full, "reference_outputs")
    for curve in runs.curves:
        if curve.run["status"].item() in FINISHED:
            yield curve.text, curve.style, _motion(curve.run, "outputs")


def _motion(run: xr.Dataset, variable: str) -> Motion:
    histories: dict[str, np.ndarray] = {}
    for values, axis in (("inputs", "input"), (variable, "output")):
        columns = run[values].transpose(axis, "time").values
        histories |= dict(zip(run[axis].values.tolist(), columns, strict=True))
    return Motion(run["time"].values, histories)


def figure_frequency_response(dataset: xr.Dataset) -> Figure:
    """Gain and phase of yaw rate and lateral acceleration over the frequency of the steering."""
    figure, axes = theme.panels(2, 2, SIZE, sharex=True)
    units = {"yaw_rate": "1/s", "lateral_acceleration": "m/s^2/rad"}
    for text, style, motion in _motions(dataset):
        response = frequency_response(motion)
        for (gain, phase), name in zip(axes.T, units, strict=True):
            gain.plot(FREQUENCIES, response[f"{name}_gain"], label=text, **style)
            phase.plot(FREQUENCIES, np.degrees(response[f"{name}_phase"]), **style)
    for number, ((gain, phase), (name, unit)) in enumerate(zip(axes.T, units.items(), strict=True)):
        gain.set_title(theme.letter(number, name.replace("_", " ")))
        gain.set_ylabel(f"gain ({labels.raised(unit)})")
        gain.set_ylim(bottom=0.0)
        phase.set_ylabel("phase (degrees)")
        phase.set_xlabel("frequency of the steering (Hz)")
        phase.set_xlim(0.0, FREQUENCIES[-1])
    theme.legend_below(figure, axes[0])
    return figure


def figure_sine_with_dwell(dataset: xr.Dataset) -> Figure:
    """Steering and yaw rate, with the times after the steering at which the yaw rate is judged."""
    figure, axes = theme.panels(2, 1, SIZE, sharex=True)
    steering, yaw_rate = axes[:, 0]
    motions = list(_motions(dataset))
    for text, style, motion in motions:
        yaw_rate.plot(motion.times, motion["yaw_rate"], label=text, **style)
    for *_, first in motions[:1]:
        steering.plot(first.times, np.degrees(first.wheel_angle), color="black")
        yaw_rate.set_xlim(first.times[0], first.times[-1])
        _, end = steering_interval(first)
        for after in RATIO_TIMES.values():
            steering.axvline(end + after, linestyle=":", **THIN)
            yaw_rate.axvline(end + after, linestyle=":", **THIN)
            above = steering.get_xaxis_transform()
            at = {"ha": "center", "va": "bottom", "transform": above}
            steering.text(end + after, 1.02, f"{after:g} s after", **at)
    for number, axis in enumerate((steering, yaw_rate)):
        axis.set_title(theme.letter(number))
    steering.set_ylabel("angle of the\nfront wheels (degrees)")
    yaw_rate.set_ylabel("yaw rate (rad/s)")
    yaw_rate.set_xlabel("time (s)")
    theme.legend_below(figure, [yaw_rate])
    return figure
