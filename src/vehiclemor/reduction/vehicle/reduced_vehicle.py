"""Reduced vehicles: few coordinates of the shape, heading and position as quadratures."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np

from vehiclemor.arguments import check_shapes, require
from vehiclemor.inputs.checks import checked_maneuver
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.reduction.interface import OfflineCost
from vehiclemor.reduction.reduced_system import MOST_STARTS, ReducedSystem
from vehiclemor.reduction.trust import trust_of
from vehiclemor.reduction.vehicle.decoding import (
    NO_TRANSIENT,
    NOTHING_KNOWN,
    Decoding,
    TrainingReach,
    Transient,
    decayed,
)
from vehiclemor.reduction.vehicle.features import (
    PLANAR,
    Features,
    feature_columns,
    feature_system,
    needed_parameters,
)
from vehiclemor.reduction.vehicle.shape import VehicleShape
from vehiclemor.simulation.control_periods import ControlPeriods, whole_space
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.system import System
from vehiclemor.simulation.trajectory import Start, Trajectory, Trust

# Step of the reduced coordinates in differences.
DIFFERENCE = 1e-6
NOTHING_EXCITED = np.empty((2, 0, 2))
NO_COST = OfflineCost()


class KnownStart(NamedTuple):
    """A full state as a start, its reduced state, what of the transient it excites, until when (s).

    `start_trust` has the time (s) from which on this is as in training runs; how far the start is
    from theirs, 1 at the edge; 1.
    """

    state: np.ndarray
    encoded: np.ndarray
    excited: np.ndarray
    until: float
    start_trust: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class ReducedVehicle(ReducedSystem):
    """A vehicle whose reduced equations are linear in features, see `features`.

    Integrator and tolerance are by default those of runs that are compared with training runs.
    """

    model: DynamicModel
    shape: VehicleShape
    # Features of the equations and the parameters in their text.
    features: Features
    parameters: np.ndarray
    coefficients: np.ndarray  # C (terms, states + 3) of the equations.
    # Coefficients (terms, n) of the deviation of the shape from straight running.
    decoding: np.ndarray
    encoding: np.ndarray  # Reduced coordinates per deviation of the shape (states, n).
    # Reduced coordinates per input (states, inputs), to be subtracted at the start.
    feedthrough: np.ndarray
    # Magnitude of each reduced state (states + 3,) below which its error counts absolutely.
    error_scale: np.ndarray
    offline: OfflineCost = NO_COST
    solver: str = "dopri5"
    tolerance: float = 1e-6
    transient: Transient = NO_TRANSIENT  # What is added to the decoded shapes.
    # Features of the decoding, with the same parameters, if not those of the equations.
    decoded_features: Features | None = None
    # What the training runs have shown of durations and starts.
    reach: TrainingReach = NOTHING_KNOWN

    def check_sizes(self) -> None:
        """Raise `ValueError` if kernels would read or write beyond these arrays."""
        features, reach = self.features, self.reach
        decoded = self.decoded_features or features
        k, n, inputs = features.states, len(self.shape.indices), len(self.model.inputs)
        require((features.inputs, decoded.inputs) == (inputs, inputs), "features")
        require(decoded.states == k, "features")
        check_shapes("parameters", (self.parameters, len(self.parameters)))
        needed = max(needed_parameters(features), needed_parameters(decoded))
        require(len(self.parameters) >= needed, "parameters")
        check_shapes("coefficients", (self.coefficients, len(features.terms), k + PLANAR))
        check_shapes("decoding", (self.decoding, len(decoded.terms), n))
        check_shapes("encoding", (self.encoding, k, n), (self.feedthrough, k, inputs))
        check_shapes("error_scale", (self.error_scale, k + PLANAR))
        modes = len(self.transient.rates)
        require(not modes or self.transient.left.shape[1:] == (n,), "transient")
        require(modes <= n, "modes")
        require(reach.inputs.shape[1] in (0, inputs), "reach")
        require(0 <= features.lateral == decoded.lateral <= len(decoded.watched), "lateral")
        if len(reach.lasted):
            known = len(reach.lasted), len(reach.decaying), len(reach.left)
            require(known == (2 * decoded.lateral, modes, n), "lasted")

    @property
    def order(self) -> int:
        """Number of integrated states, heading and position included."""
        return self.features.states + PLANAR

    @cached_property
    def spectral_abscissa(self) -> float:
        """Largest real part (1/s) of the shape's eigenvalues at straight running."""
        k = self.features.states
        steps = DIFFERENCE * np.vstack([np.eye(k), -np.eye(k)])
        no_input = np.zeros((2 * k, self.features.inputs))
        columns = feature_columns(self.features, steps, no_input, self.parameters)
        rates = columns @ self.coefficients[:, :k]
        jacobian = (rates[:k] - rates[k:]).T / (2.0 * DIFFERENCE)
        return float(np.linalg.eigvals(jacobian).real.max())

    @cached_property
    def system(self) -> System:
        """The compiled equations."""
        arrays = self.parameters, self.coefficients, self.error_scale
        return feature_system(self.features, *arrays, np.zeros(self.features.states))

    @property
    def spaces(self) -> ControlPeriods:
        """One control period with all reduced states."""
        return whole_space(self.order)

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the reduced states: they tell nothing of what has decayed after the start."""
        x, y, heading = self.model.definition.planar
        return (*(f"z{i}" for i in range(self.features.states)), heading, x, y)

    def decode(self, states: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Full states (samples, 2 n) of reduced ones."""
        return self._decoded(states, inputs)[:, : len(self.model.definition.states)]

    def _decoded(self, states: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        return self.decoder.states(np.zeros(len(states)), states, inputs, NOTHING_EXCITED)[0]

    def decoder_slopes(
        self, state: np.ndarray, inputs: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of the full state by the reduced one and by the inputs."""
        return self.decoder.slopes(state, inputs)

    def trust(self, states: np.ndarray, inputs: np.ndarray) -> Trust | None:
        """Of states one by one: they tell neither how long a run has lasted nor of its start."""
        names = [name for _, name in self.decoder.features.watched]
        used = self._decoded(states, inputs)[:, self.decoder.layout.size :]
        return trust_of(np.zeros(len(states)), used, names) if names else None

    def encode(self, state: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Reduced state (states + 3,) of a full one and the inputs (inputs,) at that time."""
        return self.encoded_path(state[None], inputs[None])[0]

    def encoded_path(self, states: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Reduced states (samples, states + 3) of full ones at inputs (samples, inputs)."""
        deviations = self.shape.of(states) - self.shape.reference
        x, y, heading = self.model.planar
        z = deviations @ self.encoding.T - inputs @ self.feedthrough.T
        return np.hstack([z, states[:, [heading, x, y]]])

    @cached_property
    def decoder(self) -> Decoding:
        """The compiled way back to full states."""
        shape, features = self.shape, self.decoded_features or self.features
        of_shape = self.decoding, shape.reference, shape.layout
        return Decoding(features, self.parameters, *of_shape, self.transient, self.reach)

    def path(
        self, maneuver: Excitation, start: Start, times: np.ndarray | None = None
    ) -> np.ndarray | None:
        """Reduced states (samples, states + 3), if the run comes to its end."""
        maneuver = checked_maneuver(maneuver, self.model.definition)
        state = self.encode(self.model.start(start), maneuver.recorded_inputs[1][0])
        run = self.run(maneuver, state, times)
        return None if run.failure or not np.isfinite(run.path).all() else run.path

    def simulate(
        self, maneuver: Excitation, start: Start, outputs: tuple[str, ...] | None = None
    ) -> Trajectory:
        """Integrate the reduced equations, then decode states at the maneuver's output times."""
        maneuver, inputs, input_use = self._checked_inputs(maneuver)
        known = self.known(start, inputs[0])
        run = self.run(maneuver, known.encoded, direct_until=known.until)
        states, trust = self.decoder.of_run(
            run, inputs, known.excited, (*known.start_trust, *input_use)
        )
        if not len(run.point_of_sample) or run.point_of_sample[0, 1] < 0.0:
            # The start is known better than its slow part.
            states[0, : len(known.state)] = known.state
        trajectory = self.model.recorded(maneuver, run, inputs, states, trust, outputs)
        run.give_back()
        return trajectory

    @cached_property
    def _checked_inputs(
        self,
    ) -> Callable[[Excitation], tuple[Excitation, np.ndarray, tuple[float, float]]]:
        """Of the last maneuvers: checked, inputs at the output times, how far these go."""

        def check(maneuver: Excitation) -> tuple[Excitation, np.ndarray, tuple[float, float]]:
            maneuver = checked_maneuver(maneuver, self.model.definition)
            return maneuver, maneuver.recorded_inputs[1], self.reach.input_use(maneuver)

        return lru_cache(MOST_STARTS)(check)

    def excited(self, state: np.ndarray) -> np.ndarray:
        """What of the transient a full state excites, see `Decoding.excited`."""
        return self.decoder.excited(self.shape.of(state[None])[0] - self.shape.reference)

    def remainder(
        self, states: np.ndarray, inputs: np.ndarray, excited: np.ndarray = NOTHING_EXCITED
    ) -> np.ndarray:
        """What of the shapes (samples, n) of full states their reduced states don't give."""
        path = self.encoded_path(states, inputs)
        decoded, _ = self.decoder.states(np.zeros(len(path)), path, inputs, excited)
        return self.shape.of(states) - self.shape.of(decoded[:, : states.shape[1]])

    def begin(self, start: Start, inputs: np.ndarray) -> np.ndarray:
        """Reduced state of a start."""
        return self.known(start, inputs).encoded.copy()

    def prepared(self, state: np.ndarray, inputs: np.ndarray) -> KnownStart:
        """A start with what it excites, at inputs."""
        excited = self.excited(state)
        remainder = self.remainder(state[None], inputs[None], excited)[0]
        start_trust = self.reach.decay_time(excited), self.reach.start_distance(remainder), 1.0
        return KnownStart(state, self.encode(state, inputs), excited, decayed(excited), start_trust)
