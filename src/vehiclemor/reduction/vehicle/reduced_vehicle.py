"""Reduced vehicles: few coordinates of the shape, heading and position as quadratures."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vehiclemor.arguments import check_shapes, require
from vehiclemor.codegen.kernels import Kernels
from vehiclemor.codegen.operations import LANES, Kernel
from vehiclemor.inputs.checks import checked_maneuver
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.reduction.interface import OfflineCost
from vehiclemor.reduction.reduced_system import ReducedSystem
from vehiclemor.reduction.trust import trust_of
from vehiclemor.reduction.vehicle.features import (
    PLANAR,
    Features,
    decoding_kernel,
    feature_system,
    filled,
    needed_parameters,
)
from vehiclemor.reduction.vehicle.shape import VehicleShape
from vehiclemor.simulation.control_periods import ControlPeriods, whole_space
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.evaluation import (
    INPUTS,
    STATE,
    address_of,
    at_samples,
    partial,
    path_loops,
)
from vehiclemor.simulation.system import System
from vehiclemor.simulation.trajectory import Start, Trajectory, Trust
from vehiclemor.simulation.workspaces import Run

NO_COST = OfflineCost()


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
    # Features of the decoding, with the same parameters, if not those of the equations.
    decoded_features: Features | None = None
    # What of a start's deviation (n,) from the decoded shape goes to heading, X and Y (3, n).
    settling: np.ndarray | None = None

    def check_sizes(self) -> None:
        """Raise `ValueError` if kernels would read or write beyond these arrays."""
        features, decoded = self.features, self._decoded_features
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
        if self.settling is not None:
            check_shapes("settling", (self.settling, PLANAR, n))

    @property
    def order(self) -> int:
        """Number of integrated states, heading and position included."""
        return self.features.states + PLANAR

    @cached_property
    def system(self) -> System:
        """The compiled equations."""
        arrays = self.parameters, self.coefficients, self.error_scale
        return feature_system(self.features, *arrays, self.model.inputs_at_rest)

    @property
    def spaces(self) -> ControlPeriods:
        """One control period with all reduced states."""
        return whole_space(self.order)

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the reduced states."""
        x, y, heading = self.model.definition.planar
        return (*(f"z{i}" for i in range(self.features.states)), heading, x, y)

    @property
    def decoder(self) -> tuple[Kernel, np.ndarray]:
        """The kernel of full states and, behind them, of what is watched; and its constants."""
        rows = filled(np.vstack([self.decoding, self.shape.reference]))
        kernel = decoding_kernel(self._decoded_features, self.shape, len(self.parameters))
        return kernel, np.concatenate([self.parameters, rows.ravel()])

    @property
    def _decoded_features(self) -> Features:
        return self.decoded_features or self.features

    @cached_property
    def _decoder(self) -> tuple[Kernels, np.ndarray]:
        kernel, constants = self.decoder
        kernel.check(self.order, self.features.inputs, len(constants))
        return Kernels([kernel]), constants

    @property
    def _decoded_size(self) -> int:
        """Number of full states and of what is watched."""
        return len(self.model.definition.states) + len(self._decoded_features.watched)

    def _decoded(self, path: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Full states and, behind them, what is watched (samples, 2 n + watched)."""
        kernels, constants = self._decoder
        sizes = self.order, self.features.inputs, self._decoded_size
        return at_samples(kernels, "full_state", constants, (path, inputs), sizes)

    def _decoded_run(self, run: Run) -> np.ndarray:
        """The same in the first `run.rows` rows, where a run is recorded.

        The array belongs to the run.
        """
        held = run.cached_loops.get("decoded")
        if held is None:
            (kernels, constants), lanes = self._decoder, LANES if run.rows >= LANES else 1
            address = np.array([address_of(kernels, "full_state", lanes)], dtype=np.int64)
            states = np.empty((len(run.output.states), self._decoded_size))
            path = run.output.states, run.inputs
            call = path_loops()["kernel_path"].prepared(*path, address, constants, states)
            counts = [call.address(name) + 1 for name in ("path", "inputs", "result")]
            held = run.cached_loops["decoded"] = states, call, counts
        states, call, counts = held
        for index in counts:
            call.words[index] = run.rows
        call()
        return states

    def decode(self, states: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Full states (samples, 2 n) of reduced ones."""
        return self._decoded(states, inputs)[:, : len(self.model.definition.states)]

    def decoder_slopes(
        self, state: np.ndarray, inputs: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of the full state by the reduced one and by the inputs."""
        (kernels, constants), size = self._decoder, len(self.model.definition.states)
        given = kernels, "full_state", (state, inputs, constants), self._decoded_size
        return partial(*given, STATE)[:size], partial(*given, INPUTS)[:size]

    def trust(self, states: np.ndarray, inputs: np.ndarray) -> Trust | None:
        """How far states (samples, states + 3) go in the ranges that are watched."""
        names = [name for _, name in self._decoded_features.watched]
        used = self._decoded(states, inputs)[:, len(self.model.definition.states) :]
        return trust_of(np.zeros(len(states)), used, names) if names else None

    def encode(self, state: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Reduced state (states + 3,) of a full one and the inputs (inputs,) at that time.

        Fast motion that is about to decay is gone; where it leads the vehicle is not.
        """
        path = self.encoded_path(state[None], inputs[None])
        if self.settling is None:
            return path[0]
        decoded = self.shape.of(self.decode(path, inputs[None]))
        turn, forward, left = self.settling @ (self.shape.of(state[None]) - decoded)[0]
        heading = path[0, -PLANAR]
        cosine, sine = np.cos(heading), np.sin(heading)
        way = forward * cosine - left * sine, forward * sine + left * cosine
        path[0, -PLANAR:] += turn, *way
        return path[0]

    def encoded_path(self, states: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Reduced states (samples, states + 3) of full ones at inputs (samples, inputs)."""
        deviations = self.shape.of(states) - self.shape.reference
        x, y, heading = self.model.planar
        z = deviations @ self.encoding.T - inputs @ self.feedthrough.T
        return np.hstack([z, states[:, [heading, x, y]]])

    def path(self, maneuver: Excitation, start: Start) -> np.ndarray | None:
        """Reduced states (samples, states + 3), if the run comes to its end."""
        maneuver = checked_maneuver(maneuver, self.model.definition)
        state = self.encode(self.model.start(start), maneuver.recorded_inputs[1][0])
        run = self.run(maneuver, state)
        return None if run.failure or not np.isfinite(run.path).all() else run.path

    def simulate(
        self, maneuver: Excitation, start: Start, outputs: tuple[str, ...] | None = None
    ) -> Trajectory:
        """Integrate the reduced equations, then decode states at the maneuver's output times."""
        maneuver = checked_maneuver(maneuver, self.model.definition)
        inputs = maneuver.recorded_inputs[1]
        state, encoded = self.known(start, inputs[0])
        run = self.run(maneuver, encoded, record_all_until=0.0)
        states = self._decoded_run(run)
        samples = run.output.point_of_sample
        if not len(samples) or samples[0, 1] < 0.0:
            # The start is known better than its slow part.
            states[0, : len(state)] = state
        trajectory = self.model.recorded(maneuver, run, inputs, states, outputs=outputs)
        run.give_back()
        return trajectory
