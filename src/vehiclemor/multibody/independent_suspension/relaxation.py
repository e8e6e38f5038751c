"""The 14-DOF vehicle with relaxation of its tires: eight states more, down to standstill.

The equations are those of the vehicle beside it; the slips of each wheel follow from two
deflections of its contact, see `components.tires.relaxed_slip`.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from vehiclemor.multibody.independent_suspension.definition import DEFINITION as RIGID_CONTACT
from vehiclemor.multibody.independent_suspension.definition import starts as rigid_starts
from vehiclemor.multibody.quantities import declared, equations_of

DECLARED = declared("relaxation_vehicle")
# Longitudinal speed in m/s: it may roll backwards.
SLOWEST = -5.0


def starts(p: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Initial states (36,) by name, without deflections: as the 14-DOF vehicle, and at rest."""
    relaxed = np.zeros(len(DECLARED["further_states"]))
    states = {name: np.append(state, relaxed) for name, state in rigid_starts(p).items()}
    standing = states["equilibrium"].copy()
    standing[len(RIGID_CONTACT.coordinates) :] = 0.0
    return {**states, "standing": standing}


DEFINITION = replace(
    RIGID_CONTACT,
    name="relaxation_vehicle",
    summary="14-DOF vehicle whose tires relax: it stops, stands and starts (ODE)",
    further_states=DECLARED["further_states"],
    parameters={**RIGID_CONTACT.parameters, **DECLARED["parameters"]},
    derive=equations_of("independent_suspension", "derive_relaxed"),
    starts=starts,
    # A deflection of 1 cm is large.
    error_scale={quantity.name: 0.01 for quantity in DECLARED["further_states"]},
    validity={**RIGID_CONTACT.validity, "longitudinal_speed": (SLOWEST, math.inf)},
    standstill=(),
)
