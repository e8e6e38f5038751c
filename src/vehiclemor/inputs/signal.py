"""Signals: inputs through samples, beside the functions of maneuvers."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from vehiclemor.arguments import file_path, line_of_text, number, within
from vehiclemor.exceptions import InputError, blamed
from vehiclemor.inputs.columns import (
    check_numbers,
    column_names,
    csv_samples,
    derivative_order,
    listed,
    sample_arrays,
    unit_factor,
)
from vehiclemor.inputs.excitation import (
    LONGEST_DURATION,
    MOST_SAMPLES,
    Excitation,
    Jumps,
    cached,
    checked_factor,
    checked_times,
    polynomial_loops,
    values_at,
)
from vehiclemor.inputs.polynomial_loops import Pieces
from vehiclemor.inputs.polynomials import (
    HOLDS,
    check_rates,
    interpolants,
    piece_lengths,
    time_derivative,
)
from vehiclemor.multibody.quantities import OPTIONAL_INPUTS, integral_of
from vehiclemor.registry import choice

# Time (s) between output times, as of the registered maneuvers of vehicles.
OUTPUT_STEP = 0.02
# Time (s) between the samples that are taken of a function.
FUNCTION_STEP = 0.01
# Part of an input's range that changes between two samples as if it jumped.
STEEP = 0.25

# Inputs that an angle's unit or a steering ratio is not meant for.
OF_ANOTHER_UNIT = frozenset(quantity.name for quantity in OPTIONAL_INPUTS)
# Optional inputs that are no sizes, such as friction.
NOT_SCALED = frozenset(quantity.name for quantity in OPTIONAL_INPUTS if quantity.default)


@dataclass(frozen=True, eq=False)
class Signal(Excitation):
    """Inputs through samples; its constructors are `from_samples`, `from_function`, `from_csv`.

    It ends with the last sample, whatever the hold: later inputs are refused, not extrapolated.
    `perturbed` scales its time, so its duration, and its values.

    Attributes
    ----------
    name, summary, inputs, duration, samples
        See `Excitation`; without names of inputs it has all those of a model, in its order.
    hold
        Interpolation between samples.
    nominal_pieces
        Polynomials for factors of 1.
    """

    name: str
    summary: str
    inputs: tuple[str, ...]
    duration: float
    samples: int
    hold: str
    nominal_pieces: Pieces
    frequency_factor: float = 1.0
    amplitude_factor: float = 1.0

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
        return id(self.nominal_pieces), self.inputs, self.samples, factors

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
            Names of the columns; by default they are all inputs of a model, in its order.  Further
            inputs of a model are 0 or at their default, but derivatives of one that is given
            (`s_dot` and `s_ddot` of `s`) follow from it; that needs a cubic hold.
        output_step
            About the time in s between output times.

        Raises
        ------
        InputError
            If times don't increase, a value isn't finite, a rate is wrong, or shapes don't fit.
        """
        times, values = sample_arrays(t, u)
        how: dict[str, Any] = {"inputs": inputs, "output_step": output_step, "name": name}
        return many_signals(times, values[None], hold, **how)[0]

    @property
    def pieces(self) -> Pieces:
        """Inputs as piecewise polynomials."""
        if self.frequency_factor == self.amplitude_factor == 1.0:
            return self.nominal_pieces
        return self._scaled_pieces()

    @cached
    def _scaled_pieces(self) -> Pieces:
        edges, first, starts, coefficients = self.nominal_pieces
        amplitudes = np.ones(coefficients.shape[2])
        for column, name in enumerate(self.inputs or [""] * len(amplitudes)):
            order = derivative_order(name, self.inputs)
            if name not in NOT_SCALED:
                amplitudes[column] = self.amplitude_factor * self.frequency_factor**order
        return Pieces(
            edges / self.frequency_factor,
            first,
            starts / self.frequency_factor,
            coefficients * amplitudes,
        )

    @property
    def break_points(self) -> tuple[float, ...]:
        """Times in s inside the run at which a time loop begins anew."""
        return tuple(self.pieces.edges[1:-1].tolist())

    @property
    def jumps(self) -> Jumps:
        """Jumps of the inputs inside the run; unless samples are held, their steep changes."""
        return super().jumps if self.hold == "zero" else self._steep

    @property
    @cached
    def _steep(self) -> Jumps:
        # Derivatives may be nothing but rounding.
        own = [derivative_order(name, self.inputs) == 0 for name in self.inputs or ("",)]
        values = self.pieces.coefficients[:, 0]
        # The last piece ends the run.
        sizes, least = np.diff(values, axis=0), STEEP * np.ptp(values, axis=0)
        steep = np.flatnonzero((np.abs(sizes) > np.where(own, least, math.inf)).any(axis=1))
        if not len(steep):
            return Jumps(np.empty(0), np.empty(0), sizes[:0])
        lengths = piece_lengths(self.pieces)
        begins = self.pieces.edges[0] + np.cumsum(lengths) - lengths
        return Jumps(begins[steep], lengths[steep], sizes[steep])

    def at(self, times: np.ndarray) -> np.ndarray:
        """Inputs (n, number of inputs) at times (n,) in s; `InputError` beyond the samples."""
        times = checked_times(times)
        within_run = times.clip(0.0, self.duration)
        beyond = np.abs(times - within_run) > 1e-9 * self.duration
        if beyond.any():
            late = times[beyond][0]
            raise InputError(f"{self} lasts from 0 to {self.duration:g} s: no inputs at {late:g} s")
        return values_at(self.pieces, within_run)

    def _at_output_times(self) -> np.ndarray:
        inputs = np.empty((self.samples, self.pieces.coefficients.shape[2]))
        polynomial_loops()["sampled"](self.packed_pieces, self.times, inputs)
        return inputs

    def perturbed(self, frequency: float = 1.0, amplitude: float = 1.0) -> Signal:
        """The signal with its factors set: so much faster and shorter, so many times as large.

        Friction, which is a factor itself, stays as it is.
        """
        frequency = checked_factor("frequency", frequency)
        amplitude = checked_factor("amplitude", amplitude)
        if (frequency, amplitude) == (self.frequency_factor, self.amplitude_factor):
            return self
        return replace(
            self,
            frequency_factor=frequency,
            amplitude_factor=amplitude,
            duration=float(self.nominal_pieces.edges[-1]) / frequency,
        )

    def for_inputs(self, names: tuple[str, ...], defaults: tuple[float, ...] = ()) -> Signal:
        """The signal with all inputs of a model, in its order; `InputError` if they don't fit."""
        names = listed(names)
        return self if self.inputs == names else self._completed(names, defaults)

    @cached
    def _completed(self, names: tuple[str, ...], defaults: tuple[float, ...]) -> Signal:
        columns = self.nominal_pieces.coefficients.shape[2]
        needed = ", ".join(names)
        if not self.inputs:
            if columns == len(names):
                check_rates(self.nominal_pieces.coefficients[None], names)
                return replace(self, inputs=names)
            raise InputError(
                f"{self} has {columns} columns without names, the model needs {needed}: "
                f"name the columns by inputs=[...]"
            )
        for name in self.inputs:
            if name not in names:
                raise InputError(
                    f"{self} gives input {name!r}, the model needs {needed}: "
                    f"say which column is which input"
                )
        values = dict(zip(names, defaults, strict=False))
        columns = [self._column(name, values.get(name, 0.0)) for name in names]
        coefficients = np.stack(columns, axis=2)
        pieces = self.nominal_pieces._replace(coefficients=coefficients)
        return replace(self, inputs=names, nominal_pieces=pieces)

    def _column(self, name: str, default: float) -> np.ndarray:
        """Coefficients (pieces, degree + 1) of an input, at factors of 1."""
        pieces, order = self.nominal_pieces, 0
        while name not in self.inputs:
            lower = integral_of(name)
            if not lower:
                constant = np.zeros_like(pieces.coefficients[:, :, 0])
                constant[:, 0] = default
                return constant
            name, order = lower, order + 1
        if order and self.hold != "cubic":
            raise InputError(f"{self}: derivatives of {name} follow from a cubic hold alone")
        for _ in range(order):
            pieces = time_derivative(pieces)
        return pieces.coefficients[:, :, self.inputs.index(name)]

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
            Of these columns: `SI`, `rad`, `deg`, `m`, `mm`, `m/s`, `km/h`, `mph`.
        ratio
            Divides them, as a steering ratio does the angle of a steering wheel.
        hold, output_step, name
            As of `from_samples`; the name is that of the file by default.
        """
        path = file_path("path", path)
        scale = unit_factor(unit, ratio)
        times, values, names = csv_samples(path, separator, decimal, time, inputs)
        columns = inputs.values() if isinstance(inputs, Mapping) else names
        table = np.column_stack([times, values])
        check_numbers(path, [time, *columns], table, range(1, len(table) + 1))
        mixed = [name for name in names if name in OF_ANOTHER_UNIT]
        if scale != 1.0 and mixed:
            raise InputError(
                f"unit and ratio convert all columns, {mixed[0]} too: write columns in SI units, "
                "or run the log by a study, where each column has its unit"
            )
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
    """Signals through samples at the same times, at once.

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
    if not len(values):
        raise InputError("u holds no runs; one is needed at least")
    if len(times) < 2:
        raise InputError(f"a signal needs two samples at least, not {len(times)}")
    within("number of samples", len(times), (2, MOST_SAMPLES))
    times, values = times - times[0], values.reshape(*values.shape[:2], -1)
    names = column_names(inputs, values.shape[2])
    if not line_of_text("name", name):
        raise InputError("name is empty")
    runs = interpolants(times, values, hold, names)
    duration = within("duration of a signal", float(times[-1]), (0.0, LONGEST_DURATION), " s")
    about = name, f"{len(times)} samples, {hold} hold", names, duration
    output_samples = _output_samples(duration, output_step)
    return [Signal(*about, output_samples, hold, pieces) for pieces in runs]


def _output_samples(duration: float, step: Any) -> int:
    """Number of times about so many seconds apart."""
    if number("step", step) <= 0.0:
        raise InputError(f"step: {step:g} s is not positive")
    within("step", step, (duration / (MOST_SAMPLES - 1), LONGEST_DURATION), " s")
    return max(round(duration / step), 1) + 1
