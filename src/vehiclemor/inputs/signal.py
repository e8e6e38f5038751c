"""Signals: inputs from samples, wherever a maneuver is wanted."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from vehiclemor.arguments import file_path, line_of_text, number, within
from vehiclemor.codegen.loops import Loop, loops
from vehiclemor.exceptions import InputError, blamed
from vehiclemor.inputs.columns import (
    column_names,
    csv_samples,
    derivative_order,
    integral_of,
    listed,
    sample_arrays,
    unit_factor,
)
from vehiclemor.inputs.maneuver import (
    LONGEST_DURATION,
    MOST_SAMPLES,
    Maneuver,
    checked_factor,
    checked_times,
)
from vehiclemor.inputs.polynomial_loops import DISORDERED, NOT_FINITE, ROWS, Pieces
from vehiclemor.registry import choice

# What lies between samples, and the degree of its polynomials.
HOLDS = {"linear": 1, "zero": 0, "cubic": 3}
# Time (s) between output times, as of the registered maneuvers of vehicles.
OUTPUT_STEP = 0.02
# Time (s) between the samples that are taken of a function.
FUNCTION_STEP = 0.01


@dataclass(frozen=True, eq=False)
class Signal(Maneuver):
    """Inputs through samples, made by `from_samples` and its kin.

    It ends with the last sample, whatever the hold: later inputs are refused, not extrapolated.
    `perturbed` scales its time, so its duration, and its values.  Inputs are the names of those
    that are given, empty if they are all of a model's, in its order; `hold` is what lies between
    samples, `pieces` the polynomials for factors of 1, `kept` what is made of it when it is run.
    """

    hold: str = "linear"
    pieces: Pieces = None  # type: ignore[assignment]
    kept: dict[Any, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """The constructors have checked."""

    def __getstate__(self) -> dict[str, Any]:
        """What a copy takes along: addresses are its own."""
        return super().__getstate__() | {"kept": {}}

    def __str__(self) -> str:
        name = "signal" if self.name == "signal" else f"signal {self.name!r}"
        inputs = ", ".join(self.inputs) or "in the model's order"
        return f"{name} ({self.duration:.6g} s, {self.summary}; inputs {inputs})"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Signal) and self._identity == other._identity

    def __hash__(self) -> int:
        return hash(self._identity)

    @property
    def _identity(self) -> tuple[Any, ...]:
        factors = self.frequency_factor, self.amplitude_factor
        return id(self.pieces), self.inputs, self.samples, factors

    @classmethod
    def from_samples(
        cls,
        t: Any,
        u: Any,
        hold: str = "linear",
        *,
        inputs: str | Sequence[str] = (),
        output_step: float = OUTPUT_STEP,
        name: str = "signal",
    ) -> Signal:
        """A signal through samples.

        Parameters
        ----------
        t
            Increasing times (n,) in s; the run begins with the first of them.
        u
            Inputs (n,) or (n, inputs) at these times, SI units.
        hold
            Between samples: `linear`; `zero`, each sample until the next, so that the last only
            ends the run; `cubic`, the spline with continuous second derivatives.
        inputs
            Names of the columns; by default they are all inputs of a model, in its order.  Inputs
            that a model has besides are 0, but where they are derivatives of one that is given
            (`s_dot` and `s_ddot` of `s`) these.
        output_step
            About the time in s between output times.

        Raises
        ------
        InputError
            If times don't increase, a value isn't finite, or shapes don't fit.
        """
        times, values = sample_arrays(t, u)
        how: dict[str, Any] = {"inputs": inputs, "output_step": output_step, "name": name}
        return many_signals(times, values[None], hold, **how)[0]

    @property
    def polynomials(self) -> Pieces:
        """Polynomials with the factors."""
        frequency, amplitude = self.frequency_factor, self.amplitude_factor
        if frequency == amplitude == 1.0:
            return self.pieces
        if "polynomials" not in self.kept:
            inputs = self.pieces.coefficients.shape[1]
            orders = np.array(
                [derivative_order(name, self.inputs) for name in self.inputs] or [0] * inputs
            )
            amplitudes = amplitude * frequency**orders
            self.kept["polynomials"] = self.pieces._replace(
                edges=self.pieces.edges / frequency,
                starts=self.pieces.starts / frequency,
                coefficients=self.pieces.coefficients * amplitudes[:, None],
            )
        return self.kept["polynomials"]

    @property
    def break_points(self) -> tuple[float, ...]:
        """Times in s inside the run at which a time loop begins anew."""
        return tuple(self.polynomials.edges[1:-1].tolist())

    def at(self, times: np.ndarray) -> np.ndarray:
        """Inputs (n, number of inputs) at times (n,) in s; `InputError` beyond the samples."""
        times = checked_times(times)
        within_run = times.clip(0.0, self.duration)
        beyond = np.abs(times - within_run) > 1e-9 * self.duration
        if beyond.any():
            late = times[beyond][0]
            raise InputError(f"{self} lasts from 0 to {self.duration:g} s: no inputs at {late:g} s")
        return at(self.polynomials, within_run)

    def perturbed(self, frequency: float = 1.0, amplitude: float = 1.0) -> Signal:
        """The signal with its factors set: so much faster and shorter, so many times as large."""
        frequency = checked_factor("frequency", frequency)
        amplitude = checked_factor("amplitude", amplitude)
        if (frequency, amplitude) == (self.frequency_factor, self.amplitude_factor):
            return self
        return replace(
            self,
            frequency_factor=frequency,
            amplitude_factor=amplitude,
            duration=float(self.pieces.edges[-1]) / frequency,
            kept={},
        )

    def for_inputs(self, names: tuple[str, ...]) -> Signal:
        """The signal with all inputs of a model, in its order; `InputError` if they don't fit."""
        names = listed(names)
        if self.inputs == names:
            return self
        if names not in self.kept:
            self.kept[names] = self._completed(names)
        return self.kept[names]

    def _completed(self, names: tuple[str, ...]) -> Signal:
        columns, needed = self.pieces.coefficients.shape[1], ", ".join(names)
        if not self.inputs:
            if columns == len(names):
                return replace(self, inputs=names, kept={})
            raise InputError(
                f"{self} has {columns} columns without names, the model needs {needed}: "
                f"name those that are given by inputs=[...]"
            )
        for name in self.inputs:
            if name not in names:
                raise InputError(
                    f"{self} gives input {name!r}, the model needs {needed}: "
                    f"say which column is which input"
                )
        coefficients = np.stack([self._column(name) for name in names], axis=1)
        pieces = self.pieces._replace(coefficients=coefficients)
        return replace(self, inputs=names, pieces=pieces, kept={})

    def _column(self, name: str) -> np.ndarray:
        """Polynomials (pieces, 6) of an input, at factors of 1."""
        pieces, order = self.pieces, 0
        while name not in self.inputs:
            lower = integral_of(name)
            if not lower:
                return np.zeros_like(pieces.coefficients[:, 0])
            name, order = lower, order + 1
        if order and self.hold != "cubic":
            raise InputError(f"{self}: derivatives of {name} follow from a cubic hold alone")
        for _ in range(order):
            pieces = derivative(pieces)
        return pieces.coefficients[:, self.inputs.index(name)]

    @classmethod
    def from_function(
        cls,
        function: Callable[[np.ndarray], Any],
        duration: float,
        hold: str = "cubic",
        *,
        inputs: str | Sequence[str] = (),
        step: float = FUNCTION_STEP,
        **further: Any,
    ) -> Signal:
        """A signal through samples of a function; what lies between these is not seen.

        Parameters
        ----------
        function
            Times (n,) in s -> inputs (n,) or (n, inputs).
        duration, step
            In s; the time between samples is about the step.
        inputs, **further
            As of `from_samples`.
        """
        within("duration of a signal", number("duration", duration), (0.0, LONGEST_DURATION), " s")
        times = np.linspace(0.0, duration, _output_samples(duration, step))
        with blamed("function of a signal", function):
            values = function(times)
        return cls.from_samples(times, values, hold, inputs=inputs, **further)

    @classmethod
    def from_csv(
        cls,
        path: str | Path,
        hold: str = "linear",
        *,
        separator: str = ",",
        decimal: str = ".",
        time: str = "time",
        inputs: str | Sequence[str] | Mapping[str, str] = (),
        unit: str = "SI",
        ratio: float = 1.0,
        output_step: float = OUTPUT_STEP,
        name: str = "",
    ) -> Signal:
        """A signal through the rows of a CSV file, whose first line names its columns.

        Parameters
        ----------
        separator, decimal
            Character between columns, and before decimals.
        time
            Column of the times in s.
        inputs
            Columns to take, or input -> column where they have other names; all by default.
        unit
            Of these columns: `SI`, `deg` or `mm`.
        ratio
            Divides them, as a steering ratio does the angle of a steering wheel.
        hold, output_step, name
            As of `from_samples`; the name is that of the file by default.
        """
        path = file_path("path", path)
        scale = unit_factor(unit, ratio)
        times, values, names = csv_samples(path, separator, decimal, time, inputs)
        name = name or path.name
        return cls.from_samples(
            times, scale * values, hold, inputs=names, output_step=output_step, name=name
        )


def many_signals(
    t: Any,
    u: Any,
    hold: str = "linear",
    *,
    inputs: str | Sequence[str] = (),
    output_step: float = OUTPUT_STEP,
    name: str = "signal",
) -> list[Signal]:
    """Signals through samples at the same times, by one compiled call for all.

    Parameters
    ----------
    t, u
        Increasing times (n,) in s; inputs (runs, n) or (runs, n, inputs) at these, SI units.
    hold, inputs, output_step, name
        See `Signal.from_samples`.
    """
    choice("hold", hold, HOLDS)
    times, values = sample_arrays(t, u)
    if times.ndim != 1 or values.ndim not in (2, 3) or values.shape[1] != len(times):
        raise InputError(
            f"samples of a signal: t has shape {times.shape} and u {values.shape[1:]} in a run, "
            f"not (n,) and (n,) or (n, inputs)"
        )
    if len(times) < 2 or not len(values):
        raise InputError(f"a signal needs two samples at least, not {len(times)}")
    within("number of samples", len(times), (2, MOST_SAMPLES))
    times, values = times - times[0], values.reshape(*values.shape[:2], -1)
    names = column_names(inputs, values.shape[2])
    if not line_of_text("name", name):
        raise InputError("name is empty")
    every = through(times, np.ascontiguousarray(values), hold)
    duration = within("duration of a signal", float(times[-1]), (0.0, LONGEST_DURATION), " s")
    own = f"{len(times)} samples, {hold} hold", _unused, names, duration
    samples = _output_samples(duration, output_step)
    return [Signal(name, *own, samples, _unused, hold=hold, pieces=pieces) for pieces in every]


def _unused(*_: Any) -> Any:
    raise NotImplementedError("a signal is evaluated by its polynomials, which have its corners")


def _output_samples(duration: float, step: Any) -> int:
    """Number of times about so many seconds apart."""
    if number("step", step) <= 0.0:
        raise InputError(f"step: {step:g} s is not positive")
    within("step", step, (duration / (MOST_SAMPLES - 1), LONGEST_DURATION), " s")
    return max(round(duration / step), 1) + 1


@cache
def polynomial_loops() -> dict[str, Loop]:
    """Loops over polynomials of time."""
    return loops(("inputs.polynomial_loops",), ("sampled", "extent"))


@cache
def _through() -> Loop:
    return loops(("inputs.polynomial_loops",), ("through",))["through"]


def derivative(pieces: Pieces) -> Pieces:
    """By time; jumps have none."""
    if len(pieces.starts):
        lengths = np.diff(pieces.starts, append=pieces.edges[-1])
    else:
        counts = np.diff(pieces.first)
        lengths = np.repeat(np.diff(pieces.edges) / counts, counts)
    rates = np.zeros_like(pieces.coefficients)
    rates[:, :, :-1] = pieces.coefficients[:, :, 1:] * np.arange(1.0, rates.shape[2])
    return pieces._replace(coefficients=rates / lengths[:, None, None])


def at(pieces: Pieces, times: np.ndarray) -> np.ndarray:
    """Values (n, inputs) at times (n,) in s; at a jump those after it, at the end before."""
    order, values = np.argsort(times), np.empty((len(times), pieces.coefficients.shape[1]))
    increasing = np.empty_like(values)
    polynomial_loops()["sampled"](pieces, times[order], increasing)
    values[order] = increasing
    return values


def through(times: np.ndarray, samples: np.ndarray, hold: str) -> list[Pieces]:
    """Polynomials of each run through samples (runs, n, inputs) by one of `HOLDS`.

    One piece for each interval; segments end at kinks, at jumps, and where nothing moves for long.
    Runs with the same segments share all but their coefficients, which are of one array.
    `InputError` if times (n,) don't increase, or something isn't finite.
    """
    runs, n, inputs = samples.shape
    coefficients = np.empty((runs * (n - 1), inputs, HOLDS[hold] + 1))
    rows, counts = np.empty((runs, n), dtype=np.int64), np.empty(runs, dtype=np.int64)
    even = _through()(times, samples, np.empty((ROWS, n)), coefficients, rows, counts)
    if even < 0:
        raise InputError(f"samples of a signal: {_wrong(even, times, samples)}")
    starts, own = np.empty(0) if even else times[:-1].copy(), n - 1
    shared: dict[bytes, Pieces] = {}
    found = []
    for run, count in enumerate(counts.tolist()):
        first = rows[run, :count]
        key, part = first.tobytes(), coefficients[run * own : (run + 1) * own]
        if key not in shared:
            shared[key] = Pieces(times[first], first.copy(), starts, part)
        found.append(shared[key]._replace(coefficients=part))
    return found


def _wrong(status: int, times: np.ndarray, samples: np.ndarray) -> str:
    """What is wrong by what the loop has returned."""
    if status == DISORDERED and np.isfinite(times).all():
        row = int(np.argmax(times[1:] <= times[:-1]))
        now, before = times[row + 1], times[row]
        return f"times must increase, t[{row + 1}] = {now:.6g} s follows {before:.6g} s"
    run = NOT_FINITE - status
    given = times if status == DISORDERED else samples[run]
    finite = np.isfinite(given).reshape(len(given), -1).all(axis=1)
    if finite.all():
        return "the polynomials through them are not finite"
    where = f" of run {run}" if len(samples) > 1 and status != DISORDERED else ""
    return f"{'t' if status == DISORDERED else 'u'}[{finite.argmin()}]{where} is not finite"
