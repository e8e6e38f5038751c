"""A vehicle whose equations stand in other states than the model's, with a compiled way back."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType

import numpy as np

from vehiclemor.reduction.interface import Offline
from vehiclemor.reduction.reduced_system import ReducedSystem
from vehiclemor.reduction.settings import OnlineSettings
from vehiclemor.simulation.checks import loop_array
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.spaces import whole_space
from vehiclemor.simulation.system import Run, System


def transformed_vehicle(
    model: DynamicModel,
    system: System,
    encode: Callable[[np.ndarray, np.ndarray], np.ndarray],
    offline: Offline,
    settings: OnlineSettings,
) -> ReducedSystem:
    """Equations in other states than the model's.

    Parameters
    ----------
    system
        The equations; its second kernel gives the full state of a transformed one.
    encode
        (full state (2 n,), inputs) -> transformed state (dim,).
    """
    dim = len(system.reference)

    def lift(run: Run, inputs: np.ndarray, _: np.ndarray) -> np.ndarray:
        states = np.empty((len(run.times), 2 * len(model.coordinates)))
        system.loops.output_path(run.path, loop_array(inputs), system.machine, states)
        return states

    return ReducedSystem(
        model,
        system,
        whole_space(dim),
        encode,
        lift,
        dim,
        offline,
        settings.solver,
        settings.tolerance,
    )


def kernel_addresses(kernels: ModuleType) -> np.ndarray:
    """Addresses of the right-hand side and of the way back, as the loops want them."""
    machines = (kernels._derivative_machine, kernels._full_state_machine)
    return np.array([*(machine.address for machine in machines), 0, 0], dtype=np.int64)
