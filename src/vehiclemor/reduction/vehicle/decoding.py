"""From reduced states to full ones in one compiled pass, with what tells how far a run goes.

Ranges tell where a run is.  But errors of the heading grow with the time that a run stays there,
those of the position with the way that it drives on with them; and what a start excites, beside the
slow motion, is known for the starts of the training alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from vehiclemor.arguments import check_shapes, require
from vehiclemor.codegen.kernels import Kernels
from vehiclemor.codegen.loops import Loop, Prepared, loops
from vehiclemor.codegen.operations import LANES, Kernel, padded
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.reduction.trust import by_factor, inputs_beyond
from vehiclemor.reduction.vehicle.decoding_loops import (
    BESIDES,
    LEVELS,
    MOVING,
    PARTS,
    STILL,
    Known,
)
from vehiclemor.reduction.vehicle.features import PLANAR, Features, Layout, decoding_kernel
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.evaluation import INPUTS, PATH_LOOPS, STATE, address_of, partial
from vehiclemor.simulation.trajectory import Trust
from vehiclemor.simulation.workspaces import Run

# Part of a transient below which it needs no further samples.
NEGLIGIBLE = 1e-4
# Modes are known by differences: a smaller part of a deviation than this excites none.
ROUNDING = 1e-7
# A run may last so many times as long as any training run.
LONGER = 1.05
# A start may leave so many times what samples of training runs leave.
UNLIKE = 3.0
# What is left, beside its modes, of a start's motion when training runs begin to be steered.
FADED = 0.01
# Decay (1/s) that is none.
SLOWEST = 1e-6
# Reasons besides ranges, in the order of the loop.
REASONS = (
    "lateral motion lasts longer, or ended longer ago, than in training",
    "lateral motion begins earlier after such a start than in training",
    "steering or lateral motion at the start is larger than in training",
    "fast motion at the start leaves its training range",
    "steering goes further or changes faster than in training",
)
BEYOND = np.array([STILL, MOVING, *np.arange(1, PARTS) / PARTS])


@dataclass(frozen=True)
class Transient:
    """Decaying motion that the reduced coordinates leave out, from a start that is no equilibrium.

    Linear, in closed form: the sum over modes of right w^T d exp(rate t), with d the deviation of
    the start's shape.
    """

    rates: np.ndarray  # Eigenvalues (m,) in 1/s, one of each conjugate pair.
    # Eigenvectors (m, n), scaled so that real parts of the sum are the motion.
    left: np.ndarray
    right: np.ndarray

    def check_sizes(self) -> None:
        """Raise `ValueError` if there are not as many vectors as rates."""
        modes, *n = self.left.shape
        require(self.rates.shape == (modes,) and self.right.shape == (modes, *n), "transient")

    def amplitudes(self, deviation: np.ndarray) -> np.ndarray:
        """Amplitudes (m,) that a deviation (n,) of a start's shape excites; empty if it is none."""
        if not len(self.rates):
            return self.rates
        amplitudes = self.left @ deviation
        least = ROUNDING * (abs(self.left) @ abs(deviation))
        if (abs(amplitudes) > least).any():
            return amplitudes
        return amplitudes[:0]


NO_TRANSIENT = Transient(np.zeros(0), np.zeros((0, 0)), np.zeros((0, 0)))


@dataclass(frozen=True)
class TrainingReach:
    """What is known of durations and starts."""

    # Seconds (2 columns, levels) that a run may be beyond each level of a range; below them their
    # integrals in s^2.
    lasted: np.ndarray
    sideways: float  # How far the starts use the ranges of these columns.
    # Amplitudes (modes,) that a start's transient may have in a run that is steered.
    decaying: np.ndarray
    # When (s) known starts that excite modes were steered first, 0 if none was, and their
    # amplitudes (modes,).
    faded: float
    steered: np.ndarray
    left: np.ndarray  # What decoding leaves of the states of the shape (n,).
    # Directions (m, n), in parts of `left`, in which known starts leave more, and how far.
    starts: np.ndarray
    begun: np.ndarray
    # Sizes (3, inputs) that the inputs may have between output times too, see `Extent`; empty
    # where nothing is known of them.
    inputs: np.ndarray = field(default_factory=lambda: np.zeros((3, 0)))

    def check_sizes(self) -> None:
        """Raise `ValueError` if the amplitudes or the starts don't fit one another."""
        modes, n, starts = len(self.decaying), len(self.left), len(self.begun)
        check_shapes("lasted", (self.lasted, len(self.lasted), LEVELS))
        check_shapes("steered", (self.decaying, modes), (self.steered, modes))
        check_shapes("starts", (self.left, n), (self.starts, starts, n), (self.begun, starts))
        check_shapes("reach", (self.inputs, 3, *self.inputs.shape[1:2]))

    def input_use(self, maneuver: Excitation) -> tuple[float, float]:
        """How far a maneuver's inputs go, 1 at the edge, and when (s) they pass it."""
        if not self.inputs.size:
            return 0.0, np.inf
        used = float(np.maximum.reduce(maneuver.extent.largest / self.inputs, axis=None))
        return used, np.inf if used <= 1.0 else inputs_beyond(maneuver, self.inputs).min()

    def decay_time(self, excited: np.ndarray) -> float:
        """Time in s from which on a start's transient, as `Decoding.excited` gives it, is known."""
        rates, amplitudes = excited
        if not len(rates) or not len(self.decaying):
            return 0.0
        sizes = np.hypot(*amplitudes.T)
        larger = np.maximum(sizes / self.decaying, 1.0)
        # What does not decay never settles.
        decayed = float((np.log(larger) / np.maximum(-rates[:, 0], SLOWEST)).max())
        if not self.faded:
            return decayed
        # Slower motion of the start is in the reduced states; it is as large as that of the modes.
        larger = max(float((sizes / self.steered).max()) / FADED, 1.0)
        return max(decayed, self.faded * np.log(larger) / -np.log(FADED))

    def start_distance(self, remainder: np.ndarray) -> float:
        """How much a start leaves (n,), beside what known starts do; 1 is the edge."""
        if not len(self.left):
            return 0.0
        scaled = remainder / self.left
        known = np.clip(self.starts @ scaled, -LONGER * self.begun, LONGER * self.begun)
        return float(np.abs(scaled - known @ self.starts).max()) / UNLIKE


NONE = np.zeros(0)
NOTHING_KNOWN = TrainingReach(
    np.zeros((0, LEVELS)), MOVING, NONE, 0.0, NONE, NONE, np.zeros((0, 0)), NONE
)


def durations(times: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Seconds (samples, 2 columns, levels) beyond each level so far, and their integrals."""
    spans = np.diff(times, prepend=times[:1])[:, None, None]
    spent = np.cumsum(spans * (sizes[:, :, None] > BEYOND), axis=0)
    return np.concatenate([spent, np.cumsum(spans * spent, axis=0)], axis=1)


class DecodingSpace(NamedTuple):
    """Arrays of one decoding at a time, and the loops that write them.

    `calls` are the loops, and the words in which the number of rows stands.
    """

    excited: np.ndarray
    times: np.ndarray
    states: np.ndarray
    largest: np.ndarray
    first: np.ndarray
    start: np.ndarray
    calls: tuple[tuple[Prepared, tuple[int, ...]], ...]


@dataclass(frozen=True, eq=False)
class Decoding(ShortRepr):
    """How full states follow from reduced ones, see `ReducedVehicle`.

    Coefficients (terms, n) are of the shape's deviation from its reference, straight running.
    """

    features: Features
    parameters: np.ndarray
    coefficients: np.ndarray
    reference: np.ndarray
    layout: Layout
    transient: Transient
    reach: TrainingReach = NOTHING_KNOWN

    @cached_property
    def _by_modes(self) -> dict[int, tuple[Kernels, np.ndarray]]:
        return {}

    def kernel(self, modes: int) -> tuple[Kernel, np.ndarray]:
        """The kernel and its constants; without modes for a start that excites none."""
        right = self.transient.right[:modes]
        pairs = np.stack([np.real(right), -np.imag(right)], axis=1)
        pairs = pairs.reshape(2 * modes, right.shape[1])
        shared = [self.coefficients, self.reference[None]]
        rows = np.vstack([*shared, pairs] if modes else shared)
        rows = np.pad(rows, ((0, 0), (0, padded(rows.shape[1]) - rows.shape[1])))
        kernel = decoding_kernel(self.features, self.layout, len(self.parameters), modes)
        return kernel, np.concatenate([self.parameters, rows.ravel()])

    def _kernels(self, modes: int) -> tuple[Kernels, np.ndarray]:
        """The kernel and its constants."""
        if modes not in self._by_modes:
            (kernel, constants), features = self.kernel(modes), self.features
            kernel.check(features.states + PLANAR, features.inputs + 2 * modes, len(constants))
            self._by_modes[modes] = Kernels([kernel]), constants
        return self._by_modes[modes]

    def slopes(self, state: np.ndarray, inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of full states by reduced ones and inputs, without a transient."""
        kernels, constants = self._kernels(0)
        size, arrays = self.layout.size, (state, inputs, constants)
        rows = size + len(self.features.watched)
        by_state = partial(kernels, "full_state", arrays, rows, STATE)
        by_inputs = partial(kernels, "full_state", arrays, rows, INPUTS)
        return by_state[:size], by_inputs[:size]

    def excited(self, deviation: np.ndarray) -> np.ndarray:
        """Rates and amplitudes (2, m, 2) of the transient's modes, each with its two parts.

        The deviation (n,) of the start's shape may excite none, as straight running at any speed.
        """
        amplitudes = self.transient.amplitudes(deviation)
        modes = np.array([self.transient.rates[: len(amplitudes)], amplitudes], dtype=complex)
        return np.stack([np.real(modes), np.imag(modes)], axis=2)

    def states(
        self, times: np.ndarray, path: np.ndarray, inputs: np.ndarray, excited: np.ndarray
    ) -> tuple[np.ndarray, Trust | None]:
        """Full states and, behind them, what is watched (samples, 2 n + watched); the trust.

        The path has reduced states (samples, states + 3); `excited` is what `excited` gives.
        """
        recorded = times, path, inputs
        if len(times) > 1 or excited.shape[1]:
            return self._decode(self.space(recorded, excited, len(times)), len(times))
        # One sample and then another, as in a closed loop.
        try:
            space, sample = self._single.pop()
        except IndexError:
            sample = tuple(array.copy() for array in recorded)
            space = self.space(sample, excited, 1)
        for array, values in zip(sample, recorded, strict=True):
            array[:] = values
        states, trust = self._decode(space, 1)
        states = states.copy()
        self._single.append((space, sample))
        return states, trust

    @cached_property
    def _single(self) -> list[tuple[DecodingSpace, tuple[np.ndarray, ...]]]:
        return []

    def of_run(
        self, run: Run, inputs: np.ndarray, excited: np.ndarray, start: Sequence[float]
    ) -> tuple[np.ndarray, Trust | None]:
        """Full states and trust of a run, of whose rows only `run.rows` count.

        `inputs` are those at the samples; of `start` see `decoding_loops.Known`.
        """
        space = run.cached_loops.get("decoded")
        if space is None or space.excited.shape != excited.shape:
            times, inputs = run.recorded_at(inputs)
            space = self.space((times, run.recorded_states, inputs), excited.copy(), run.rows)
            run.cached_loops["decoded"] = space
        space.excited[:] = excited
        space.start[:] = start
        return self._decode(space, run.rows)

    def space(
        self, recorded: tuple[np.ndarray, ...], excited: np.ndarray, rows: int
    ) -> DecodingSpace:
        """Arrays of the loops and these, packed once."""
        (times, path, inputs), calls = recorded, []
        modes, watched = excited.shape[1], self.features.watched
        if modes:
            given = np.empty((len(times), inputs.shape[1] + 2 * modes))
            scratch = np.empty((modes, 2))
            decay = decoding_loops()["with_decay"].prepared(times, inputs, *excited, scratch, given)
            calls.append((decay, ("times", "inputs", "result")))
            inputs = given
        kernels, constants = self._kernels(modes)
        lanes = LANES if rows >= LANES else 1
        address = np.array([address_of(kernels, "full_state", lanes)], dtype=np.int64)
        states = np.empty((len(times), self.layout.size + len(watched)))
        reasons = len(watched) + BESIDES if watched else 0
        largest, first = np.empty(reasons), np.empty(reasons, dtype=np.int64)
        start = np.array([0.0, 0.0, 0.0, 0.0, np.inf])
        lasted = self.reach.lasted
        known = Known(times, lasted, np.empty_like(lasted), start, self.reach.sideways)
        decoded = decoding_loops()["decoded"].prepared(
            path, inputs, address, constants, states, known, largest, first
        )
        calls.append((decoded, ("path", "inputs", "states", "known.times")))
        counted = []
        for call, names in calls:
            counted.append((call, tuple(call.address(name) + 1 for name in names)))
        return DecodingSpace(excited, times, states, largest, first, start, tuple(counted))

    def _decode(self, space: DecodingSpace, rows: int) -> tuple[np.ndarray, Trust | None]:
        """Run the loops on so many rows; no trust where nothing is watched."""
        for call, row_counts in space.calls:
            for index in row_counts:
                call.words[index] = rows
            call()
        largest, first = space.largest.tolist(), space.first.tolist()
        watched = self.features.watched
        if not largest:
            return space.states, None
        left = min(first)
        if left >= rows:
            return space.states, Trust(max(largest))
        # Of ranges that are left at once the start's says most.
        column = len(first) - 1 - first[::-1].index(left)
        if column < len(watched):
            reason = f"{watched[column][1]} leaves its training range"
        else:
            reason = REASONS[column - len(watched)]
        reason = by_factor(reason, largest[column])
        return space.states, Trust(max(largest), float(space.times[left]), reason)


def decayed(excited: np.ndarray) -> float:
    """Time in s at which the modes of a transient have decayed; 0 if there are none."""
    slowest = excited[0, :, 0].max(initial=-np.inf)
    return float(np.log(NEGLIGIBLE) / slowest) if slowest < 0.0 else np.inf


def decoding_loops() -> Mapping[str, Loop]:
    """The compiled loops of reduced vehicles."""
    entries = "with_decay", "decoded", "recurrence"
    return loops((*PATH_LOOPS, "reduction.vehicle.decoding_loops"), entries)
