"""From reduced states to full ones in one compiled pass, with what tells how far a run goes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vehiclemor.codegen.kernels import Kernels, kernel_sources
from vehiclemor.codegen.loops import Loop, loops
from vehiclemor.codegen.weighted_sums import padded
from vehiclemor.reduction.vehicle.feature_kernels import Layout, lifting_text
from vehiclemor.reduction.vehicle.features import Features
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.paths import results
from vehiclemor.simulation.trajectory import Trust


@dataclass(frozen=True)
class Transient:
    """Decaying motion that the reduced coordinates leave out, from a start that is no equilibrium.

    Linear, in closed form: the sum over modes of right w^T d exp(rate t), with d the deviation of
    the start's shape.

    Attributes
    ----------
    rates
        Eigenvalues (m,) in 1/s, one of each conjugate pair.
    left, right
        Eigenvectors (m, n), scaled so that real parts of the sum are the motion.
    """

    rates: np.ndarray
    left: np.ndarray
    right: np.ndarray


NO_TRANSIENT = Transient(np.zeros(0), np.zeros((0, 0)), np.zeros((0, 0)))


@dataclass(frozen=True, eq=False)
class Lifting(ShortRepr):
    """How full states follow from reduced ones.

    Attributes
    ----------
    features, parameters
        Features of the shape, and the parameters in their text.
    coefficients
        Of the shape's deviation from straight running (terms, n).
    reference
        Shape (n,) of straight running.
    layout
        Where the shape stands in the states.
    transient
        What is added to the shapes.
    """

    features: Features
    parameters: np.ndarray
    coefficients: np.ndarray
    reference: np.ndarray
    layout: Layout
    transient: Transient

    @cached_property
    def _made(self) -> dict[int, tuple[Kernels, np.ndarray]]:
        return {}

    def _kernel(self, modes: int) -> tuple[Kernels, np.ndarray]:
        """Kernel and constants; without modes for a start that excites none."""
        if modes not in self._made:
            right = self.transient.right[:modes]
            pairs = np.stack([right.real, -right.imag], axis=1).reshape(-1, right.shape[1])
            shared = [self.coefficients, self.reference[None]]
            rows = np.vstack([*shared, pairs] if modes else shared)
            rows = np.pad(rows, ((0, 0), (0, padded(rows.shape[1]) - rows.shape[1])))
            text = lifting_text(self.features, self.layout, len(self.parameters), modes)
            constants = np.concatenate([self.parameters, rows.ravel()])
            self._made[modes] = Kernels(kernel_sources(text)), constants
        return self._made[modes]

    def states(
        self, times: np.ndarray, path: np.ndarray, inputs: np.ndarray, deviation: np.ndarray
    ) -> np.ndarray:
        """Full states, and behind them what is watched (samples, 2 n + watched).

        Parameters
        ----------
        times, path, inputs
            Of the samples: in s, reduced states (samples, states + 3), inputs (samples, inputs).
        deviation
            Of the start's shape from straight running (n,).
        """
        rates = self.transient.rates
        amplitudes = self.transient.left @ deviation if deviation.any() else rates[:0]
        modes = len(amplitudes)
        if modes:
            given = np.empty((len(times), inputs.shape[1] + 2 * modes))
            parts = [np.column_stack([a.real, a.imag]) for a in (rates, amplitudes)]
            _loops()["with_decay"](times, inputs, *parts, np.empty((modes, 2)), given)
            inputs = given
        kernels, constants = self._kernel(modes)
        size = self.layout.size + len(self.features.watched)
        return results(kernels, "full_state", constants, (path, inputs), size)

    def trust(self, times: np.ndarray, states: np.ndarray) -> Trust | None:
        """How far a run has gone, of its states as `states` gives them; none if nothing tells."""
        watched = self.features.watched
        if not watched:
            return None
        largest = np.empty(len(watched))
        first = np.empty(len(watched), dtype=np.int64)
        _loops()["furthest"](states, self.layout.size, largest, first)
        if not first.min() < len(times):
            return Trust(float(largest.max()))
        place = int(first.argmin())
        reason = f"{watched[place][1]} leaves what the training runs have covered"
        return Trust(float(largest.max()), float(times[first[place]]), reason)


def _loops() -> Mapping[str, Loop]:
    modules = ("simulation.integrators.structures", "reduction.vehicle.lifting_loops")
    return loops(modules, ("with_decay", "furthest"))
