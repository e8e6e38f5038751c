"""The high-fidelity vehicle with its inertia frozen at the design position, exact tires.

In 14 coordinates the mass matrix of the chassis and the arms is taken constant, wheel places and
axles are cubic in the arm's angle and the rack's displacement; the tires, gravity and the motion of
the chassis stay nonlinear.  It needs no training: what is left out is small for a car, whatever the
input.  See `models/high_fidelity/frozen_inertia.py`.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence

import numpy as np

from vehiclemor.reduction.interface import Offline
from vehiclemor.reduction.methods.independent_coordinates import accepts, check, presets, settings
from vehiclemor.reduction.settings import Value
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.reduction.vehicle.transformed import RewrittenVehicle, kernel_addresses
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.system import System

__all__ = ["REFERENCE", "SUMMARY", "accepts", "check", "fit", "presets", "settings"]
SUMMARY = "14 coordinates, inertia frozen at design, exact tires (high-fidelity vehicle)"
REFERENCE = ""
# Magnitudes below which errors count absolutely, by name of the state; 10 otherwise.
TYPICAL = {"psi": 1.0, "r": 1.0}


def fit(
    model: Model, training: Sequence[TrainingRun], settings: Mapping[str, Value]
) -> RewrittenVehicle:
    """Constants from the exact kernels at the design position; no training run is looked at."""
    # Derived symbolically where they are not on disk.
    from vehiclemor.models.high_fidelity import frozen_quantities as frozen
    from vehiclemor.reduction.vehicle.frozen_constants import frozen_encoder, frozen_kernels

    del training
    assert isinstance(model, DynamicModel)
    began = time.perf_counter()
    kernels, constants = frozen_kernels(model)
    encode = frozen_encoder(model)
    names = [quantity.name for quantity in (*frozen.COORDINATES, *frozen.SPEEDS)]
    cyclic = {"x", "y", *(name for name in names if name.startswith("gamma"))}
    system = System(
        (constants, kernel_addresses(kernels)),
        len(model.inputs),
        encode(model.start(), np.zeros(len(model.inputs))),
        np.array([TYPICAL.get(name, 10.0) for name in names]),
        np.array([i for i, name in enumerate(names) if name not in cyclic]),
        np.zeros(0, dtype=np.int64),
    )
    return RewrittenVehicle(
        model,
        system,
        encode,
        Offline(time.perf_counter() - began, 0),
        str(settings["solver"]),
        float(settings["tolerance"]),
    )
