"""Reduced vehicles: few coordinates of the shape, heading and place as quadratures, compiled."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np

from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.reduction.interface import Offline
from vehiclemor.reduction.reduced_system import MOST_STARTS, ReducedSystem
from vehiclemor.reduction.trust import trust_of
from vehiclemor.reduction.vehicle.features import (
    PLANAR,
    Features,
    feature_columns,
    feature_system,
    needed_parameters,
)
from vehiclemor.reduction.vehicle.lifting import NO_TRANSIENT, Lifting, Transient, decayed
from vehiclemor.reduction.vehicle.shape import VehicleShape
from vehiclemor.reduction.vehicle.training_reach import NOTHING_KNOWN, TrainingReach
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.input_polynomials import recorded_inputs
from vehiclemor.simulation.maneuver_checks import checked_maneuver
from vehiclemor.simulation.projection_windows import whole_space
from vehiclemor.simulation.trajectory import Start, Trajectory, Trust
from vehiclemor.simulation.workspaces import Run
from vehiclemor.sizes import require, shaped

# Step of the reduced coordinates in differences.
DIFFERENCE = 1e-6
NOTHING_EXCITED = np.empty((2, 0, 2))
NO_COST = Offline()


class KnownStart(NamedTuple):
    """A full state as a start: what of the transient it excites, and until when (s).

    Of it is `told` when (s) this is as in training runs; how much else it leaves, 1 at the edge of
    what they leave; 1.
    """

    state: np.ndarray
    excited: np.ndarray
    until: float
    told: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class ReducedVehicle(ShortRepr):
    """A vehicle whose reduced equations are linear in features, see `features`.

    Attributes
    ----------
    features, parameters
        Features of the equations and the parameters in their text.
    coefficients
        C (terms, states + 3) of the equations.
    lifting
        Coefficients (terms, n) of the deviation of the shape from straight running.
    encoding
        Reduced coordinates per deviation of the shape (states, n).
    feedthrough
        Reduced coordinates per input (states, inputs), to be subtracted at the start.
    error_scale
        Magnitude of each reduced state (states + 3,) below which its error counts absolutely.
    transient
        What is added to the lifted shapes.
    lifted_features
        Features of the lifting, with the same parameters, if not those of the equations.
    reach
        What the training runs have shown of durations and starts.

    Integrator and tolerance are by default those of runs that are compared with training runs.
    """

    model: DynamicModel
    shape: VehicleShape
    features: Features
    parameters: np.ndarray
    coefficients: np.ndarray
    lifting: np.ndarray
    encoding: np.ndarray
    feedthrough: np.ndarray
    error_scale: np.ndarray
    offline: Offline = NO_COST
    solver: str = "dopri5"
    tolerance: float = 1e-6
    transient: Transient = NO_TRANSIENT
    lifted_features: Features | None = None
    reach: TrainingReach = NOTHING_KNOWN

    def check_sizes(self) -> None:
        """Raise `ValueError` if kernels would read or write beyond these arrays."""
        own, lifted, reach = self.features, self.lifted_features or self.features, self.reach
        k, n, inputs = own.states, len(self.shape.kept), len(self.model.inputs)
        require((own.inputs, lifted.inputs, lifted.states) == (inputs, inputs, k), "features")
        shaped("parameters", (self.parameters, len(self.parameters)))
        needed = max(needed_parameters(own), needed_parameters(lifted))
        require(len(self.parameters) >= needed, "parameters")
        shaped("coefficients", (self.coefficients, len(own.terms), k + PLANAR))
        shaped("lifting", (self.lifting, len(lifted.terms), n))
        shaped("encoding", (self.encoding, k, n), (self.feedthrough, k, inputs))
        shaped("error_scale", (self.error_scale, k + PLANAR))
        modes = len(self.transient.rates)
        require(not modes or self.transient.left.shape[1:] == (n,), "transient")
        require(modes <= n, "modes")
        require(reach.inputs.shape[1] in (0, inputs), "reach")
        require(0 <= own.lateral == lifted.lateral <= len(lifted.watched), "lateral")
        if len(reach.lasted):
            known = len(reach.lasted), len(reach.decaying), len(reach.left)
            require(known == (2 * lifted.lateral, modes, n), "lasted")

    @property
    def effective_rank(self) -> int:
        """Number of integrated states, heading and place included."""
        return self.features.states + PLANAR

    @cached_property
    def spectral_abscissa(self) -> float:
        """Largest real part (1/s) of the eigenvalues at straight running; not of heading, place."""
        k = self.features.states
        steps = DIFFERENCE * np.vstack([np.eye(k), -np.eye(k)])
        no_input = np.zeros((2 * k, self.features.inputs))
        columns = feature_columns(self.features, steps, no_input, self.parameters)
        rates = columns @ self.coefficients[:, :k]
        jacobian = (rates[:k] - rates[k:]).T / (2.0 * DIFFERENCE)
        return float(np.linalg.eigvals(jacobian).real.max())

    @cached_property
    def equations(self) -> ReducedSystem:
        """The compiled equations with the ways there and back."""
        x, y, heading = self.model.definition.planar
        arrays = self.parameters, self.coefficients, self.error_scale
        system = feature_system(self.features, *arrays, np.zeros(self.features.states))
        return ReducedSystem(
            self.model,
            system,
            whole_space(self.effective_rank),
            self.effective_rank,
            self.offline,
            self.solver,
            self.tolerance,
            self.encoded,
            self._lifted,
            self._judged,
            slopes=self.lift.slopes,
            names=(*(f"z{i}" for i in range(self.features.states)), heading, x, y),
        )

    @property
    def state_space(self) -> ReducedSystem:
        """The reduced equations: a state tells nothing of what has decayed after the start."""
        return self.equations

    def _lifted(self, run: Run, inputs: np.ndarray) -> np.ndarray:
        return self.lift.states(run.times, run.path, inputs, NOTHING_EXCITED)[0]

    def _judged(self, run: Run, inputs: np.ndarray) -> Trust | None:
        """Of states one by one: they tell neither how long a run has lasted nor of its start."""
        watched = self.lift.features.watched
        used = self._lifted(run, inputs)[:, self.lift.layout.size :]
        return trust_of(run.times, used, [name for _, name in watched]) if watched else None

    def encoded(self, state: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Reduced state (states + 3,) of a full one and the inputs (inputs,) at that time."""
        return self.encoded_path(state[None], inputs[None])[0]

    def encoded_path(self, states: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Reduced states (samples, states + 3) of full ones at inputs (samples, inputs)."""
        deviations = self.shape.of(states) - self.shape.reference
        x, y, heading = self.model.planar
        z = deviations @ self.encoding.T - inputs @ self.feedthrough.T
        return np.hstack([z, states[:, [heading, x, y]]])

    @cached_property
    def lift(self) -> Lifting:
        """The compiled way back to full states."""
        shape, features = self.shape, self.lifted_features or self.features
        of_shape = self.lifting, shape.reference, shape.layout
        return Lifting(features, self.parameters, *of_shape, self.transient, self.reach)

    def path(
        self, maneuver: Maneuver, start: Start, times: np.ndarray | None = None
    ) -> np.ndarray | None:
        """Reduced states (samples, states + 3), if the run comes to its end."""
        run = self.equations.run(maneuver, start, times)
        return None if run.failure or not np.isfinite(run.path).all() else run.path

    def simulate(
        self, maneuver: Maneuver, start: Start, outputs: tuple[str, ...] | None = None
    ) -> Trajectory:
        """Integrate the reduced equations, then lift to states at the maneuver's output times."""
        maneuver, inputs, driven = self._driven(maneuver)
        known = self.known(start, inputs[0])
        run = self.equations.run(maneuver, start, direct_until=known.until)
        states, trust = self.lift.of_run(run, inputs, known.excited, (*known.told, *driven))
        if not len(run.places) or run.places[0, 1] < 0.0:
            # The start is known better than its slow part.
            states[0, : len(known.state)] = known.state
        found = self.model.recorded(maneuver, run, inputs, states, trust, outputs)
        run.give_back()
        return found

    @cached_property
    def _driven(self) -> Callable[[Maneuver], tuple[Maneuver, np.ndarray, tuple[float, float]]]:
        """Of the last maneuvers: checked, inputs at the output times, how far these go."""

        def made(maneuver: Maneuver) -> tuple[Maneuver, np.ndarray, tuple[float, float]]:
            maneuver = checked_maneuver(maneuver, self.model.definition)
            return maneuver, recorded_inputs(maneuver)[1], self.reach.driven(maneuver)

        return lru_cache(MOST_STARTS)(made)

    def excited(self, state: np.ndarray) -> np.ndarray:
        """What of the transient a full state excites, see `Lifting.excited`."""
        return self.lift.excited(self.shape.of(state[None])[0] - self.shape.reference)

    def remainder(
        self, states: np.ndarray, inputs: np.ndarray, excited: np.ndarray = NOTHING_EXCITED
    ) -> np.ndarray:
        """What of the shapes (samples, n) of full states their own reduced states don't give."""
        path = self.encoded_path(states, inputs)
        lifted, _ = self.lift.states(np.zeros(len(path)), path, inputs, excited)
        return self.shape.of(states) - self.shape.of(lifted[:, : states.shape[1]])

    def known(self, start: Start, inputs: np.ndarray) -> KnownStart:
        """A start with what it excites, at inputs; kept by its name or its numbers."""
        name = start if isinstance(start, str) else self.model.start(start).tobytes()
        key = name, inputs.tobytes()
        found = self._starts.get(key)
        if found is None:
            state = self.model.start(start)
            excited = self.excited(state)
            unlike = self.reach.unlike(self.remainder(state[None], inputs[None], excited)[0])
            if len(self._starts) >= MOST_STARTS:
                self._starts.clear()
            told = self.reach.settled(excited), unlike, 1.0
            found = self._starts[key] = KnownStart(state, excited, decayed(excited), told)
        return found

    @cached_property
    def _starts(self) -> dict[tuple[str | bytes, bytes], KnownStart]:
        return {}

    def best_approximation(self, states: np.ndarray) -> None:  # noqa: ARG002
        """Lifted shapes lie on no subspace."""
        return
