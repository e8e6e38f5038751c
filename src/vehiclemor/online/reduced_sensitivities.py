"""Derivatives of a reduced model's runs by the parameters of its car.

The reduced equations are integrated with their tangents.  How their constants and the start follow
from the parameters is only known by making the model of another car: that part is by differences of
order 4.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from vehiclemor.errors import InputError
from vehiclemor.maneuver import Maneuver
from vehiclemor.online.rom import ReducedOrderModel
from vehiclemor.reduction.reduced_system import ReducedSystem
from vehiclemor.simulation.constants import differences
from vehiclemor.simulation.input_polynomials import recorded_inputs
from vehiclemor.simulation.maneuver_checks import checked_maneuver
from vehiclemor.simulation.sensitivities import (
    TOLERANCE,
    Component,
    Sensitivities,
    components,
    directions_of,
    outputs_along,
    recorded,
    sizes_of,
)
from vehiclemor.simulation.tangent_runs import (
    Tangents,
    apart,
    tangent_run,
    with_tangents,
)
from vehiclemor.simulation.trajectory import Start


def reduced_sensitivities(
    reduced: ReducedOrderModel,
    maneuver: Maneuver,
    names: str | Sequence[str],
    start: Start | None,
    tolerance: float | None,
) -> Sensitivities:
    """As `simulation.sensitivities` of the full model.

    Raises
    ------
    InputError
        Moreover if the reduced model has no state, is trained on runs, or has other states than the
        model.
    """
    model, own = reduced.model, reduced.state_space
    along = components(model, names)
    if not isinstance(own, ReducedSystem) or own.slopes is not None:
        raise InputError(
            f"{reduced.method}: its runs have no derivatives by parameters; those of "
            f"softened_slip have"
        )
    with_tangents(own.spaces)
    maneuver = checked_maneuver(maneuver, model.definition)
    begun = model.starts[0] if start is None else start
    first = recorded_inputs(maneuver)[1][0]
    constants, starts = _of_cars(reduced, along, begun, first)
    tangents = Tangents(starts, constants, sizes_of(along))
    state = own.encode(model.start(begun), first)
    chosen = TOLERANCE if tolerance is None else tolerance
    run = tangent_run(own.system, own.spaces, maneuver, state, tangents, chosen)
    states, moved = apart(run.path, len(along))
    found = recorded(own.model, maneuver, run, states)
    trusted = found.judged(reduced.simulate(maneuver, begun).trust)
    outputs = outputs_along(model, trusted, moved, directions_of(model, along))
    return Sensitivities(trusted, along, moved, outputs)


def _of_cars(
    reduced: ReducedOrderModel, along: Sequence[Component], start: Start, inputs: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives (components, constants) and (components, states) of constants and start."""
    own: Any = reduced.state_space
    flat = np.array([component.value for component in along])

    def made(values: np.ndarray) -> np.ndarray:
        changed = {
            component.label: float(value)
            for component, value in zip(along, values, strict=True)
            if value != component.value
        }
        car: Any = reduced.for_parameters(changed).state_space
        state = car.encode(car.model.start(start), inputs)
        return np.concatenate([car.system.constants, state])

    found = differences(made, flat, range(len(flat)))
    size = len(own.system.constants)
    return np.ascontiguousarray(found[:, :size]), np.ascontiguousarray(found[:, size:])
