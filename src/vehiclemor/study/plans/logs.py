"""Logs: measured inputs in files, of which windows of equal length are runs."""

import math
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import BeforeValidator, Field

from vehiclemor.arguments import within
from vehiclemor.exceptions import InputError
from vehiclemor.inputs.columns import UNITS, check_numbers, csv_samples
from vehiclemor.inputs.signal import Signal, many_signals
from vehiclemor.inputs.steering import ramp
from vehiclemor.registry import choice
from vehiclemor.simulation.model import Model
from vehiclemor.study.plans.study_runs import DECIMALS, Limit, list_of
from vehiclemor.study.scenario import Scenario
from vehiclemor.toml_files import FileSchema, Line

# A step in time of more than so many usual ones is a gap.
GAP = 10.0
MOST_WINDOWS = 10_000


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


# The name of a column stands for its table.
BY_NAME = BeforeValidator(lambda value: {"column": value} if isinstance(value, str) else value)
Column = Annotated[LogColumn, BY_NAME]


class Log(FileSchema):
    """Windows of a measured file; a column is a name, or a table with unit and scale."""

    maneuver: ClassVar[str] = ""
    # Windows are counted when the file is read.
    scenarios: ClassVar[int] = 0

    log: str = Field(min_length=1, description="CSV file, its path from the study file's folder")
    name: Line | None = Field(None, description="of its runs, NAME:SECOND; the path by default")
    inputs: dict[str, Column] = Field(min_length=1, description="input of the model -> column")
    amplitude: list[float] = list_of("factors, 1 by default")
    speed: list[float] = list_of("m/s, that of the model by default")
    speed_column: Annotated[LogSpeed | None, BY_NAME] = Field(
        None, description="column of the speed at which each window starts, instead"
    )
    time: Column = Field(LogColumn(column="time"), description="column of the times")
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


def windows(model: Model, log: Log, folder: Path) -> list[Scenario]:
    """Runs of a model by the windows of a log of a folder, with every amplitude and speed.

    `InputError` if a column, a unit or an input of the model is unknown, times don't increase,
    values are missing or not finite, or no window fits.
    """
    inputs_of_model = (*model.definition.inputs, *model.definition.optional_inputs)
    defaults = {quantity.name: quantity.default or 0.0 for quantity in inputs_of_model}
    straight = [defaults[choice(f"input of {model.name}", name, defaults)] for name in log.inputs]
    clock, *columns = _read(log, folder / log.log).T
    begins = _begins(log, folder / log.log, clock)
    rate = min(log.rate, 1.0 / float(np.median(np.diff(clock))))
    times = np.linspace(0.0, log.window, max(round(rate * log.window), 4) + 1)
    at = begins[:, None] + times
    values = np.stack([np.interp(at, clock, column) for column in columns], axis=-1)
    inputs = values[:, :, : len(straight)]
    if log.lead_in:
        share = ramp(times / log.lead_in, log.lead_in)[:, :1]
        inputs = straight + share * (inputs - straight)
    speeds: list[list[float | None]] = [[*(log.speed or [None])]] * len(begins)
    if log.speed_column:
        speed = values[:, :, -1]
        chosen = speed[:, 0] if log.speed_column.of == "first" else speed.mean(axis=1)
        speeds = chosen.round(DECIMALS)[:, None].tolist()
    unrated = np.array([f"{name}_dot" not in defaults for name in log.inputs])
    signals = many_signals(times, inputs, "cubic", inputs=[*log.inputs])
    runs: list[Scenario] = []
    names = [f"{log.name or log.log}:{begin:.9g}" for begin in begins.round(6)]
    for signal, name, samples, of_window in zip(signals, names, inputs, speeds, strict=True):
        named = replace(_straightened(signal, samples, unrated), name=name)
        for amplitude, speed in product(log.amplitude or [1.0], of_window):
            driven = named.perturbed(amplitude=amplitude)
            runs.append(Scenario(driven, model.starts[0], speed))
    return runs


def _straightened(signal: Signal, samples: np.ndarray, columns: np.ndarray) -> Signal:
    """A cubic signal, some columns of which are linear: a spline of brakes would be negative."""
    pieces, coefficients = signal.pieces, signal.pieces.coefficients.copy()
    coefficients[:, 1, columns] = np.diff(samples[:, columns], axis=0)
    coefficients[:, 2:, columns] = 0.0
    return replace(signal, nominal_pieces=pieces._replace(coefficients=coefficients))


def _read(log: Log, path: Path) -> np.ndarray:
    """Times in s, inputs and speed of the rows from `begin` to `end`, in SI units."""
    columns = {"time": log.time, **log.inputs}
    if log.speed_column:
        if log.speed:
            raise InputError("give speed or speed_column, not both")
        columns["speed_column"] = log.speed_column
    names = {name: column.column for name, column in columns.items()}
    times, values, _ = csv_samples(path, log.separator, log.decimal, names.pop("time"), names)
    factors = [column.factor for column in columns.values()]
    table = np.column_stack([times - times[:1], values]) * factors
    # A row without a time is not left out.
    outside = (table[:, 0] < log.begin) | (table[:, 0] > (log.end or np.inf))
    rows, table = np.flatnonzero(~outside) + 1, table[~outside]
    if len(table) < 2:
        raise InputError(f"{path}: {len(table)} rows lie between begin and end; two are needed")
    check_numbers(path, [column.column for column in columns.values()], table, rows)
    steps = np.diff(table[:, 0])
    row, usual = int(steps.argmin()), float(np.median(steps))
    if steps[row] <= 0.0:
        before, after = table[row : row + 2, 0]
        times_of_rows = f"{after:.6g} s in row {rows[row + 1]} follows {before:.6g} s"
        raise InputError(f"{path}: times must increase, but {times_of_rows}")
    row = int(steps.argmax())
    if steps[row] > GAP * usual:
        raise InputError(
            f"{path}: a gap of {steps[row]:.3g} s from {table[row, 0]:.6g} s on, after row "
            f"{rows[row]}, where a step is {usual:.3g} s: set end= or begin= to leave it out"
        )
    return table


def _begins(log: Log, path: Path, times: np.ndarray) -> np.ndarray:
    """Times in s at which windows begin; `InputError` if none fits, or too many do."""
    length, step = times[-1] - times[0], log.step or log.window
    # A window fits that ends after the last row by rounding.
    number = math.floor((length - log.window) / step + 1e-6) + 1
    if number < 1:
        raise InputError(f"{path}: no window of {log.window:g} s fits into {length:.6g} s")
    within(f"{path}: number of windows", number, (1, MOST_WINDOWS))
    return times[0] + step * np.arange(number)
