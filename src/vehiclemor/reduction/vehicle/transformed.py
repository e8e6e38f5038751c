"""A vehicle whose equations stand in other states than the model's, with a compiled way back."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vehiclemor.reduction.interface import Offline
from vehiclemor.reduction.reduced_system import ReducedSystem
from vehiclemor.reduction.settings import OnlineSettings
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.projection_windows import whole_space
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
        The equations; its kernel `full_state` gives the full state of a transformed one.
    encode
        (full state (2 n,), inputs) -> transformed state (dim,).
    """
    dim = len(system.reference)

    def lift(run: Run, inputs: np.ndarray, _: np.ndarray) -> np.ndarray:
        return system.along("full_state", run.path, inputs, 2 * len(model.coordinates))

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
