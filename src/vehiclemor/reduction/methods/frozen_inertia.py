"""The high-fidelity vehicle with its inertia frozen at the design position, exact tires.

In 14 coordinates the mass matrix of the chassis and the arms is taken constant, wheel places and
axles are cubic in the arm's angle and the rack's displacement; the tires, gravity and the motion of
the chassis stay nonlinear.  It needs no training: what is left out is small for a car, whatever the
input.  See `multibody/high_fidelity/frozen_inertia.py`.
"""

import time

import numpy as np

from vehiclemor.reduction.interface import Method, Offline
from vehiclemor.reduction.reduced_system import ReducedSystem, transformed_system
from vehiclemor.reduction.settings import OnlineSettings
from vehiclemor.reduction.training import Training
from vehiclemor.reduction.vehicle.acceptance import no_closed_forms
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.mirror_image import partners
from vehiclemor.simulation.system import System

# Magnitudes below which errors count absolutely, by name of the state; 10 otherwise.
ERROR_SCALE = {"psi": 1.0, "r": 1.0}


def fit(model: DynamicModel, training: Training, settings: OnlineSettings) -> ReducedSystem:
    """Constants from the exact kernels at the design position; no training run is looked at."""
    # Derived symbolically where they are not on disk.
    from vehiclemor.multibody.high_fidelity import frozen_quantities as frozen
    from vehiclemor.reduction.high_fidelity.frozen_constants import (
        exact_vehicle,
        frozen_kernels,
        judge,
    )

    began = time.process_time()
    made, constants = frozen_kernels(model)
    encode = exact_vehicle(model).encode
    names = [quantity.name for quantity in (*frozen.COORDINATES, *frozen.SPEEDS)]
    cyclic = {"x", "y", *(name for name in names if name.startswith("gamma"))}
    system = System(
        made.kernels,
        constants,
        len(model.inputs),
        encode(model.start(), np.zeros(len(model.inputs))),
        np.array([ERROR_SCALE.get(name, 10.0) for name in names]),
        np.array([i for i, name in enumerate(names) if name not in cyclic]),
        np.zeros(0, dtype=np.int64),
        partners=partners(names),
    )
    cost = Offline(time.process_time() - began)
    return transformed_system(model, system, encode, cost, settings, names, judge)


METHOD = Method(
    name="frozen_inertia",
    summary="14 coordinates, inertia frozen at design, exact tires (high-fidelity vehicle)",
    settings={"dae": OnlineSettings},
    refusal=no_closed_forms,
    fit=fit,
    learns_from="inputs",
    own_limits=True,
)
