"""Logs: measured inputs in files, of which windows of equal length are runs.

A run begins with straight running.  In the first `lead_in` seconds of its window the inputs go over
from their defaults to the log: steering that is not zero where the window begins sets in smoothly.
"""

import math
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from vehiclemor.arguments import within
from vehiclemor.exceptions import InputError
from vehiclemor.inputs.columns import UNITS, csv_samples
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.inputs.signal import many_signals
from vehiclemor.inputs.steering import ramp
from vehiclemor.multibody.definition import ModelDefinition
from vehiclemor.registry import choice
from vehiclemor.study.plans.study_runs import DECIMALS, Limit, Runs
from vehiclemor.toml_files import FileSchema, Line

# A step in time of more than so many usual ones is a gap.
GAP = 10.0
MOST_WINDOWS = 10_000
# Decimals of the second at which a window begins.
CLOCK_DECIMALS = 6
# Of the Butterworth filter, which runs forwards and backwards.
FILTER_ORDER = 2


class LogColumn(FileSchema):
    """A column of a log: its numbers, in a unit and times a scale, are SI values."""

    column: str = Field(description="name in the first line of the file")
    unit: str = Field(default="SI", description=f"one of {', '.join(UNITS)}")
    scale: float = Field(
        default=1.0,
        allow_inf_nan=False,
        description="factor beside the unit: 0.0625 for a steering ratio of 16, the radians of "
        "full lock; negative where the log has the other sign",
    )

    @property
    def factor(self) -> float:
        """SI value of a one in the file; `InputError` of an unknown unit."""
        return UNITS[choice("unit", self.unit, UNITS)] * self.scale


class LogSpeed(LogColumn):
    """The column of the speed."""

    of: Literal["first", "mean"] = Field("first", description="value of a window that counts")


def _column(value: object) -> object:
    return {"column": value} if isinstance(value, str) else value


Column = Annotated[LogColumn, BeforeValidator(_column)]


class Log(FileSchema):
    """Windows of a measured file; a column is a name, or a table with unit and scale."""

    log: str = Field(min_length=1, description="CSV file, its path from the study file's folder")
    name: Line | None = Field(None, description="of its runs, NAME:SECOND; the path by default")
    inputs: dict[str, Column] = Field(min_length=1, description="input of the model -> column")
    time: Column = Field(LogColumn(column="time"), description="column of the times")
    speed_column: Annotated[LogSpeed | None, BeforeValidator(_column)] = Field(
        None, description="column of the speed at which each window starts"
    )
    separator: str = Field(",", description="character between columns")
    decimal: str = Field(".", description="character before decimals")
    window: Limit = Field(description="s, length of a window")
    step: Limit | None = Field(None, description="s from window to window; the length by default")
    begin: float = Field(0.0, ge=0.0, description="s after the first row: windows begin here")
    end: Limit | None = Field(None, description="s after the first row: no window goes beyond")
    lead_in: float = Field(
        1.0,
        ge=0.0,
        description="s of each window in which its inputs grow from straight running to the log's",
    )
    rate: Limit = Field(50.0, description="1/s, samples taken of the log if it has so many")
    low_pass: Limit | None = Field(
        None, description="Hz, of a Butterworth filter that runs forwards and backwards"
    )


class LogGroup(Log, Runs):
    """Windows of a log, combined with factors, speeds, starts and parameters."""

    @model_validator(mode="after")
    def _one_speed(self) -> "LogGroup":
        if self.speed and self.speed_column:
            raise ValueError("give speed or speed_column, not both")
        return self


class Window(NamedTuple):
    """Inputs of a run, and its speed in m/s if the log has one."""

    signal: Excitation
    speed: float | None


class _Part(NamedTuple):
    """Times (n,) in s, and SI values (n, columns): those of the inputs, then of the speed."""

    times: np.ndarray
    values: np.ndarray

    def at(self, times: np.ndarray) -> np.ndarray:
        """Values of all columns on one more dimension, linear between the rows."""
        columns = [np.interp(times, self.times, column) for column in self.values.T]
        return np.stack(columns, axis=-1)


def windows(log: Log, folder: Path, definition: ModelDefinition) -> list[Window]:
    """Windows of a log of a folder, for a model.

    `InputError` if a column, a unit or an input of the model is unknown, times don't increase,
    values are missing or not finite, or no window fits.
    """
    defaults = {q.name: q.default or 0.0 for q in (*definition.inputs, *definition.optional_inputs)}
    straight = [defaults[choice(f"input of {definition.name}", n, defaults)] for n in log.inputs]
    path = folder / log.log
    part = _read(log, path)
    rate = min(log.rate, 1.0 / float(np.median(np.diff(part.times))))
    if log.low_pass:
        part = _filtered(path, part, rate, log.low_pass)
    begins = _begins(log, path, part.times)
    times = np.linspace(0.0, log.window, max(round(rate * log.window), 4) + 1)
    values = part.at(begins[:, None] + times)
    inputs = values[:, :, : len(straight)]
    if log.lead_in:
        share = ramp(times / log.lead_in, log.lead_in)[:, :1]
        inputs = straight + share * (inputs - straight)
    signals = many_signals(times, inputs, "cubic", inputs=[*log.inputs])
    names = [f"{log.name or log.log}:{begin:.9g}" for begin in begins.round(CLOCK_DECIMALS)]
    speeds: list[float | None] = [None] * len(begins)
    if log.speed_column:
        speed = values[:, :, -1]
        chosen = speed[:, 0] if log.speed_column.of == "first" else speed.mean(axis=1)
        speeds = chosen.round(DECIMALS).tolist()
    return [
        Window(replace(signal, name=name), speed)
        for signal, name, speed in zip(signals, names, speeds, strict=True)
    ]


def _read(log: Log, path: Path) -> _Part:
    """What a log holds from `begin` to `end`."""
    columns = dict(log.inputs)
    if log.speed_column:
        columns["speed_column"] = log.speed_column
    names = {name: column.column for name, column in columns.items()}
    times, values, _ = csv_samples(path, log.separator, log.decimal, log.time.column, names)
    if not np.isfinite(times).all():
        raise InputError(f"{path}: row {np.isfinite(times).argmin() + 1} has no time")
    times = log.time.factor * (times - times[:1])
    used = (times >= log.begin) & (times <= (log.end or np.inf))
    part = _Part(times[used], values[used] * [column.factor for column in columns.values()])
    _check(path, part, np.flatnonzero(used) + 1, [*names.values()])
    return part


def _check(path: Path, part: _Part, rows: np.ndarray, columns: list[str]) -> None:
    """Raise `InputError` if times don't increase or are apart, or a value is not finite."""
    times, values = part
    if len(times) < 2:
        raise InputError(f"{path}: {len(times)} rows lie between begin and end; two are needed")
    steps = np.diff(times)
    least, most, usual = int(steps.argmin()), int(steps.argmax()), float(np.median(steps))
    if steps[least] <= 0.0:
        raise InputError(
            f"{path}: times must increase; row {rows[least + 1]} has {times[least + 1]:.6g} s "
            f"after {times[least]:.6g} s"
        )
    if steps[most] > GAP * usual:
        raise InputError(
            f"{path}: a gap of {steps[most]:.3g} s from {times[most]:.6g} s on, after row "
            f"{rows[most]}; a step is {usual:.3g} s: set end= or begin= to leave it out"
        )
    if not np.isfinite(values).all():
        row, column = np.argwhere(~np.isfinite(values))[0]
        raise InputError(f"{path}: column {columns[column]!r} has no number in row {rows[row]}")


def _begins(log: Log, path: Path, times: np.ndarray) -> np.ndarray:
    """Times in s at which windows begin; `InputError` if none fits, or too many do."""
    length, step = times[-1] - times[0], log.step or log.window
    # A window fits that ends after the last row by rounding.
    number = math.floor((length - log.window) / step + 1e-6) + 1
    if number < 1:
        raise InputError(f"{path}: no window of {log.window:g} s fits into {length:.6g} s")
    within(f"{path}: number of windows", number, (1, MOST_WINDOWS))
    return times[0] + step * np.arange(number)


def _filtered(path: Path, part: _Part, rate: float, frequency: float) -> _Part:
    """Equidistant rows without what is faster than a frequency in Hz."""
    from scipy.signal import butter, sosfiltfilt

    within(f"{path}: low_pass", frequency, (0.0, 0.45 * rate), " Hz")
    first, last = part.times[[0, -1]]
    times = np.linspace(first, last, max(round(rate * (last - first)), 10) + 1)
    sections = butter(FILTER_ORDER, frequency, fs=rate, output="sos")
    return _Part(times, sosfiltfilt(sections, part.at(times), axis=0))
