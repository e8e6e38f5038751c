"""Exact elimination of the constraints: the high-fidelity vehicle in 14 coordinates.

Coordinate partitioning (R. Wehage, E. Haug, J. Mech. Des. 104 (1982), 247-255) with the dependent
coordinates in closed form: each front corner closes by two equations A cos + B sin = C.  Nothing is
approximated, and nothing is trained; no constraint is left to be stabilised.  See
`models/high_fidelity/independent.py`.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence

import numpy as np

from vehiclemor.models.high_fidelity.definition import DEFINITION
from vehiclemor.reduction.interface import Offline
from vehiclemor.reduction.online_settings import ONLINE_SETTINGS
from vehiclemor.reduction.settings import Setting, Value
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.reduction.vehicle.transformed import RewrittenVehicle, kernel_addresses
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.system import System

SUMMARY = "constraints eliminated in closed form, 14 coordinates (exact, high-fidelity vehicle)"
REFERENCE = "10.1115/1.3256318"


def settings(kind: str) -> Mapping[str, Setting]:
    """Settings for models of that kind."""
    return ONLINE_SETTINGS if kind == "dae" else {}


def presets(model: Model) -> Mapping[str, Mapping[str, Value]]:
    """Presets; the same for every model."""
    del model
    return {"recommended": {}}


def accepts(model: Model) -> tuple[bool, str]:
    """The one model whose constraints have been solved by hand."""
    return model.name == DEFINITION.name, f"closed forms are known for {DEFINITION.name} alone"


def check(model: Model, settings: Mapping[str, Value]) -> None:
    """All validated settings fit."""
    del model, settings


def fit(
    model: Model, training: Sequence[TrainingRun], settings: Mapping[str, Value]
) -> RewrittenVehicle:
    """The exact equations; no training run is looked at."""
    # Derived symbolically where they are not on disk.
    from vehiclemor.models.high_fidelity.quantities import PLACES
    from vehiclemor.reduction.vehicle.independent import independent_kernels

    del training
    assert isinstance(model, DynamicModel)
    began = time.perf_counter()
    kernels, constants = independent_kernels(model)
    n = len(model.coordinates)
    chosen = np.array([*PLACES, *(n + place for place in PLACES)])
    whole = list(chosen)

    def encode(state: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        del inputs
        return state[chosen].copy()

    system = System(
        (constants, kernel_addresses(kernels)),
        len(model.inputs),
        model.start()[chosen],
        model.typical[chosen],
        np.array([whole.index(i) for i in model.active if i in whole]),
        np.array([whole.index(i) for i in model.turning], dtype=np.int64),
    )
    return RewrittenVehicle(
        model,
        system,
        encode,
        Offline(time.perf_counter() - began, 0),
        str(settings["solver"]),
        float(settings["tolerance"]),
    )
