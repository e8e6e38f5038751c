"""A vehicle whose equations have been rewritten in fewer states, with a compiled way back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType

import numpy as np

from vehiclemor.maneuvers import Maneuver
from vehiclemor.reduction.interface import Offline
from vehiclemor.simulation.checks import check_inputs, loop_array
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.spaces import whole_space
from vehiclemor.simulation.system import System
from vehiclemor.simulation.trajectory import Start, Trajectory


@dataclass(frozen=True, eq=False)
class RewrittenVehicle:
    """Equations in other states than the model's.

    Attributes
    ----------
    model
        The full-order model.
    system
        The equations; its second kernel gives the full state of a rewritten one.
    encode
        (full state (2 n,), inputs) -> rewritten state (dim,).
    solver, tolerance
        Integrator and its tolerance.
    """

    model: DynamicModel
    system: System
    encode: Callable[[np.ndarray, np.ndarray], np.ndarray]
    offline: Offline
    solver: str
    tolerance: float

    @property
    def effective_rank(self) -> int:
        """Number of states."""
        return len(self.system.reference)

    def simulate(self, maneuver: Maneuver, start: Start) -> Trajectory:
        """Integrate, then compute full states at the maneuver's output times."""
        check_inputs(maneuver, self.model.name, self.model.inputs)
        state = self.encode(self.model.start(start), maneuver.at(np.zeros(1))[0])
        space = whole_space(len(state))
        run = self.system.run(maneuver, state, space, self.solver, self.tolerance)
        inputs = maneuver.at(run.times)
        states = np.empty((len(run.times), 2 * len(self.model.coordinates)))
        self.system.loops.output_path(run.path, loop_array(inputs), self.system.machine, states)
        return self.model.recorded(maneuver, run, inputs, states)

    def best_approximation(self, states: np.ndarray) -> None:
        """There is no subspace to project onto."""
        del states


def kernel_addresses(kernels: ModuleType) -> np.ndarray:
    """Addresses of the right-hand side and of the way back, as the loops want them."""
    machines = (kernels._derivative_machine, kernels._full_state_machine)
    return np.array([*(machine.address for machine in machines), 0, 0], dtype=np.int64)
