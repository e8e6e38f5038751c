"""Inputs of many runs: signals of one array of samples, and any maneuvers as loops take them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple, overload

import numpy as np

from vehiclemor.arguments import real_array
from vehiclemor.codegen.loops import Prepared, address_of_array, ready
from vehiclemor.errors import InputError, one_line
from vehiclemor.maneuver import Maneuver
from vehiclemor.online.batch_stages import addresses, batch_loop, stage
from vehiclemor.piecewise import through
from vehiclemor.sample_loops import Pieces
from vehiclemor.short_repr import ShortRepr
from vehiclemor.signals import OUTPUT_STEP, Signal
from vehiclemor.simulation.input_polynomials import (
    Extent,
    extent_of,
    no_limits,
    recorded_inputs,
    sampled,
    signal_loops,
    signal_of,
)
from vehiclemor.simulation.maneuver_checks import cut_short


class Given(NamedTuple):
    """Inputs of runs with the same output times.

    Attributes
    ----------
    words
        Words (runs, words) of their signals, see `Pieces` and `loops.Ready`.
    edges
        Ends of the smooth segments of each, in s.
    inputs
        At the times at which the runs are recorded (runs, samples, inputs).
    extent
        Of the inputs of each (runs, ...).
    remarks
        That a maneuver is longer than its run.
    kept
        What the words are addresses of.
    """

    words: np.ndarray
    edges: Sequence[np.ndarray]
    inputs: np.ndarray
    extent: Extent
    remarks: Sequence[str]
    kept: Any

    def part(self, runs: Sequence[int]) -> Given:
        """Those of some of the runs."""
        edges, remarks = [self.edges[run] for run in runs], [self.remarks[run] for run in runs]
        extent = Extent(*(part[runs] for part in self.extent))
        return Given(self.words[runs], edges, self.inputs[runs], extent, remarks, self.kept)


class Signals(Sequence[Signal], ShortRepr):
    """Signals through samples at the same times: one array instead of as many objects.

    Parameters
    ----------
    t
        Increasing times (n,) in s.
    u
        Inputs (runs, n) or (runs, n, inputs) at these times, SI units.
    hold, inputs, output_step
        See `Signal.from_samples`.

    Raises
    ------
    InputError
        If the samples are none of signals.
    """

    repr_fields = ("runs", "duration", "hold", "inputs")

    def __init__(
        self,
        t: Any,
        u: Any,
        hold: str = "linear",
        *,
        inputs: Sequence[str] = (),
        output_step: float = OUTPUT_STEP,
    ) -> None:
        try:
            # Copies, which nobody else can change after the checks.
            times, values = real_array(t).copy(), real_array(u).copy()
        except (TypeError, ValueError) as error:
            raise InputError(f"samples of signals: {one_line(error)}") from None
        if values.ndim not in (2, 3) or not len(values) or values.shape[1:2] != times.shape:
            raise InputError(
                f"samples of signals: t has shape {times.shape} and u {values.shape}, "
                f"not (n,) and (runs, n) or (runs, n, inputs)"
            )
        times.flags.writeable = values.flags.writeable = False
        self.u, self.hold = values.reshape(*values.shape[:2], -1), hold
        self._given = {"inputs": inputs, "output_step": output_step}
        # One of them is checked with all that they share.
        self.t = times
        self.first = self[0]
        finite = np.isfinite(self.u).all(axis=(1, 2))
        if not finite.all():
            raise InputError(f"samples of signals: run {finite.argmin()} holds what is not finite")

    @property
    def runs(self) -> int:
        """Number of signals."""
        return len(self.u)

    @property
    def duration(self) -> float:
        """Length in s."""
        return self.first.duration

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs that are given, see `Signal`."""
        return self.first.inputs

    def __len__(self) -> int:
        return len(self.u)

    @overload
    def __getitem__(self, run: int) -> Signal: ...
    @overload
    def __getitem__(self, run: slice | np.ndarray) -> Signals: ...
    def __getitem__(self, run: Any) -> Any:
        if isinstance(run, int | np.integer):
            return Signal.from_samples(self.t, self.u[run], self.hold, **self._given)
        part = object.__new__(Signals)
        part.__dict__.update(self.__dict__ | {"u": self.u[run]})
        return part

    def given(self, names: tuple[str, ...], times: np.ndarray | None) -> Given:
        """The inputs of a model with these names, as loops take them; see `given_of`."""
        if self.inputs != names and (self.inputs or self.u.shape[2] != len(names)):
            return given_of([signal.for_inputs(names) for signal in self.apart()], times)
        pieces = self._pieces()
        # Runs with the same segments share all but their coefficients.
        kept = {id(own.edges): own for own in pieces}
        of = {edges: ready(own) for edges, own in kept.items()}
        words = np.stack([np.frombuffer(of[id(own.edges)].words, np.int64) for own in pieces])
        # The address of the coefficients comes before their shape, which is last.
        begin, size = address_of_array(pieces[0].coefficients), pieces[0].coefficients.nbytes
        words[:, -4] = begin + size * np.arange(self.runs)
        output_times = self.first.times if times is None else times
        first, columns = of[id(pieces[0].edges)], self.u.shape[2]
        inputs = np.empty((self.runs, len(output_times), columns))
        _of_each(sampled().prepared(first, output_times, inputs[0]), "inputs", words, inputs)
        found = np.empty((self.runs, 5, columns))
        extent = signal_loops()["extent"].prepared(first, no_limits(columns), found[0])
        _of_each(extent, "result", words, found)
        edges = [own.edges for own in pieces]
        return Given(words, edges, inputs, Extent.of(found), [""] * self.runs, pieces)

    def apart(self) -> list[Signal]:
        """The signals, one by one; polynomials of all are made together."""
        return [replace(self.first, pieces=pieces, kept={}) for pieces in self._pieces()]

    def _pieces(self) -> list[Pieces]:
        return through(self.t - self.t[0], self.u, self.hold)


def _of_each(call: Prepared, result: str, words: np.ndarray, results: np.ndarray) -> None:
    """A loop of a signal for signals in words, each with its own part of the results."""
    begin = call.address("signal.edges")
    places = [*range(begin, begin + words.shape[1]), call.address(result)]
    batch_loop("for_each_run")(stage(call, places, [words, addresses(results)]))


def given_of(signals: Sequence[Maneuver], times: np.ndarray | None) -> Given:
    """Inputs of maneuvers, which have all inputs of the model.

    Parameters
    ----------
    times
        At which the runs are recorded (samples,) in s; the output times of all if none.
    """
    held = [signal_of(signal) for signal in signals]
    inputs = [recorded_inputs(s)[1] if times is None else s.at(times) for s in signals]
    words = np.frombuffer(b"".join([signal.words for signal in held]), dtype=np.int64)
    return Given(
        words.reshape(len(signals), -1),
        [signal.bundle.edges for signal in held],
        np.stack(inputs),
        Extent(*map(np.stack, zip(*map(extent_of, signals), strict=True))),
        [cut_short(signal) for signal in signals],
        held,
    )
