"""From reduced states to full ones in one compiled pass, with what tells how far a run goes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from vehiclemor.codegen.kernels import Kernels
from vehiclemor.codegen.loops import Loop, Prepared, loops
from vehiclemor.codegen.operations import Kernel
from vehiclemor.codegen.vector_lanes import LANES, padded
from vehiclemor.reduction.vehicle.decoding_loops import BESIDES, Known
from vehiclemor.reduction.vehicle.features import PLANAR, Features, Layout, decoding_kernel
from vehiclemor.reduction.vehicle.training_reach import NOTHING_KNOWN, REASONS, TrainingReach
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.evaluation import INPUTS, PATH_LOOPS, STATE, address_of, partial
from vehiclemor.simulation.trajectory import Trust
from vehiclemor.simulation.workspaces import Run
from vehiclemor.sizes import require

# Part of a transient below which it needs no samples of its own.
NEGLIGIBLE = 1e-4
# Modes are known by differences: a smaller part of a deviation than this excites none.
ROUNDING = 1e-7


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
        found = self.left @ deviation
        least = ROUNDING * (abs(self.left) @ abs(deviation))
        return found[: None if (abs(found) > least).any() else 0]


NO_TRANSIENT = Transient(np.zeros(0), np.zeros((0, 0)), np.zeros((0, 0)))


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
    def _made(self) -> dict[int, tuple[Kernels, np.ndarray]]:
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
        if modes not in self._made:
            (kernel, constants), features = self.kernel(modes), self.features
            given = features.states + PLANAR, features.inputs + 2 * modes, len(constants)
            kernel.check(*given)
            self._made[modes] = Kernels([kernel]), constants
        return self._made[modes]

    def slopes(self, state: np.ndarray, inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of full states by reduced ones and inputs, without a transient."""
        kernels, constants = self._kernels(0)
        size, arrays = self.layout.size, (state, inputs, constants)
        by_state, by_inputs = (
            partial(kernels, "full_state", arrays, size + len(self.features.watched), place)[:size]
            for place in (STATE, INPUTS)
        )
        return by_state, by_inputs

    def excited(self, deviation: np.ndarray) -> np.ndarray:
        """Rates and amplitudes (2, m, 2) of the transient's modes, each with its two parts.

        The deviation (n,) of the start's shape may excite none, as straight running at any speed.
        """
        amplitudes = self.transient.amplitudes(deviation)
        found = np.array([self.transient.rates[: len(amplitudes)], amplitudes], dtype=complex)
        return np.stack([np.real(found), np.imag(found)], axis=2)

    def states(
        self, times: np.ndarray, path: np.ndarray, inputs: np.ndarray, excited: np.ndarray
    ) -> tuple[np.ndarray, Trust | None]:
        """Full states, and behind them what is watched (samples, 2 n + watched); what this tells.

        The path has reduced states (samples, states + 3); `excited` is what `excited` gives.
        """
        recorded = times, path, inputs
        if len(times) > 1 or excited.shape[1]:
            return self._lifted(self.space(recorded, excited, len(times)), len(times))
        # One sample and then another, as in a closed loop.
        try:
            held, own = self._single.pop()
        except IndexError:
            own = tuple(array.copy() for array in recorded)
            held = self.space(own, excited, 1)
        for array, given in zip(own, recorded, strict=True):
            array[:] = given
        states, trust = self._lifted(held, 1)
        states = states.copy()
        self._single.append((held, own))
        return states, trust

    @cached_property
    def _single(self) -> list[tuple[DecodingSpace, tuple[np.ndarray, ...]]]:
        return []

    def of_run(
        self, run: Run, inputs: np.ndarray, excited: np.ndarray, start: Sequence[float]
    ) -> tuple[np.ndarray, Trust | None]:
        """The same of a run and its inputs at the samples; of its rows only `run.rows` count.

        Of `start` see `decoding_loops.Known`.
        """
        held = run.kept.get("decoded")
        if held is None or held.excited.shape != excited.shape:
            times, inputs = run.recorded_at(inputs)
            held = self.space((times, run.whole, inputs), excited.copy(), run.rows)
            run.kept["decoded"] = held
        held.excited[:] = excited
        held.start[:] = start
        return self._lifted(held, run.rows)

    def space(
        self, recorded: tuple[np.ndarray, ...], excited: np.ndarray, rows: int
    ) -> DecodingSpace:
        """Arrays of the loops and these, packed once."""
        (times, path, inputs), calls = recorded, []
        modes, watched = excited.shape[1], self.features.watched
        if modes:
            given = np.empty((len(times), inputs.shape[1] + 2 * modes))
            scratch = np.empty((modes, 2))
            decay = _loops()["with_decay"].prepared(times, inputs, *excited, scratch, given)
            calls.append((decay, ("times", "inputs", "result")))
            inputs = given
        kernels, constants = self._kernels(modes)
        lanes = LANES if rows >= LANES else 1
        address = np.array([address_of(kernels, "full_state", lanes)], dtype=np.int64)
        states = np.empty((len(times), self.layout.size + len(watched)))
        told = len(watched) + BESIDES if watched else 0
        largest, first = np.empty(told), np.empty(told, dtype=np.int64)
        start = np.array([0.0, 0.0, 0.0, 0.0, np.inf])
        lasted = self.reach.lasted
        known = Known(times, lasted, np.empty_like(lasted), start, self.reach.sideways)
        decoded = _loops()["decoded"].prepared(
            path, inputs, address, constants, states, known, largest, first
        )
        calls.append((decoded, ("path", "inputs", "states", "known.times")))
        counted = tuple(
            (call, tuple(call.address(name) + 1 for name in names)) for call, names in calls
        )
        return DecodingSpace(excited, times, states, largest, first, start, counted)

    def _lifted(self, space: DecodingSpace, rows: int) -> tuple[np.ndarray, Trust | None]:
        for call, places in space.calls:
            for place in places:
                call.words[place] = rows
            call()
        largest, first = space.largest.tolist(), space.first.tolist()
        left = min(first, default=rows)
        return space.states, self.trust(
            largest, first, float(space.times[left]) if left < rows else np.inf
        )

    def trust(self, largest: list[float], first: list[int], until: float) -> Trust | None:
        """How far a run has gone; none if nothing tells.

        Of each watched quantity and of what is told besides the largest magnitude, and the first
        row at which it is above 1; `until` is the time (s) of the first of these rows.
        """
        if not largest:
            return None
        if np.isinf(until):
            return Trust(max(largest))
        # Of what is left at once the start tells most.
        column = len(first) - 1 - first[::-1].index(min(first))
        watched = self.features.watched
        if column >= len(watched):
            return Trust(max(largest), until, REASONS[column - len(watched)])
        reason = f"{watched[column][1]} leaves what the training runs have covered"
        return Trust(max(largest), until, reason)


def decayed(excited: np.ndarray) -> float:
    """Time in s at which the modes of a transient have decayed; 0 if there are none."""
    slowest = excited[0, :, 0].max(initial=-np.inf)
    return float(np.log(NEGLIGIBLE) / slowest) if slowest < 0.0 else np.inf


def _loops() -> Mapping[str, Loop]:
    return loops((*PATH_LOOPS, "reduction.vehicle.decoding_loops"), ("with_decay", "decoded"))
