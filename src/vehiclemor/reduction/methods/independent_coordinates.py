"""Exact elimination of the constraints: the high-fidelity vehicle in 14 coordinates.

Coordinate partitioning (R. Wehage, E. Haug, J. Mech. Des. 104 (1982), 247-255) with the dependent
coordinates in closed form: each front corner closes by two equations A cos + B sin = C.  Nothing is
approximated, and nothing is trained; no constraint is left to be stabilised.  See
`multibody/high_fidelity/independent.py`.
"""

import time
from dataclasses import dataclass

import numpy as np

from vehiclemor.reduction.interface import Method, Offline
from vehiclemor.reduction.reduced_system import ReducedSystem, transformed_system
from vehiclemor.reduction.settings import OnlineSettings
from vehiclemor.reduction.training import Training
from vehiclemor.reduction.vehicle.acceptance import no_closed_forms
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.mirror_image import partners
from vehiclemor.simulation.system import System


def fit(model: DynamicModel, training: Training, settings: OnlineSettings) -> ReducedSystem:
    """The exact equations; no training run is looked at."""
    # Derived symbolically where they are not on disk.
    from vehiclemor.multibody.high_fidelity.quantities import PLACES
    from vehiclemor.reduction.high_fidelity.independent_kernels import independent_kernels

    began = time.process_time()
    made, constants = independent_kernels(model)
    n = len(model.coordinates)
    chosen = np.array([*PLACES, *(n + place for place in PLACES)])
    whole = list(chosen)
    names = [model.definition.states[i] for i in whole]

    system = System(
        made.kernels,
        constants,
        len(model.inputs),
        model.start()[chosen],
        model.error_scale[chosen],
        np.array([whole.index(i) for i in model.active if i in whole]),
        np.array([whole.index(i) for i in model.rotating], dtype=np.int64),
        partners=partners(names),
    )
    cost = Offline(time.process_time() - began)
    return transformed_system(model, system, Chosen(chosen).encode, cost, settings, names)


@dataclass(frozen=True, eq=False)
class Chosen(ShortRepr):
    """States of the full model, by their numbers, that are those of another one."""

    numbers: np.ndarray

    def encode(self, state: np.ndarray, _: np.ndarray) -> np.ndarray:
        """These of a full state."""
        return state[self.numbers]


METHOD = Method(
    name="independent_coordinates",
    summary="constraints eliminated in closed form, 14 coordinates (exact, high-fidelity vehicle)",
    reference="10.1115/1.3256318",
    settings={"dae": OnlineSettings},
    refusal=no_closed_forms,
    fit=fit,
    learns_from="inputs",
    own_limits=True,
)
