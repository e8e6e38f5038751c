"""Derivatives of whole runs of the full models by their parameters.

Equations of motion are integrated with their tangents, see `tangent_runs`.  Mechanisms have theirs
at each sample by the implicit function theorem.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vehiclemor.arguments import quoted
from vehiclemor.errors import ConvergenceError, InputError
from vehiclemor.maneuver import Maneuver
from vehiclemor.parameters import AXES, parameter_and_axis
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.simulation.constants import SMALLEST, constants_along, starts_along
from vehiclemor.simulation.constants import components as numbers_of
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.input_polynomials import recorded_inputs
from vehiclemor.simulation.maneuver_checks import checked_maneuver
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.paths import results
from vehiclemor.simulation.projection_windows import whole_space
from vehiclemor.simulation.run_plans import Run
from vehiclemor.simulation.tangent_runs import (
    Tangents,
    apart,
    side_by_side,
    tangent_run,
    tangents_along,
)
from vehiclemor.simulation.trajectory import Start, Trajectory

# Of runs with tangents, if none is asked for: derivatives are then good to a millionth.
TOLERANCE = 1e-10


class Component(NamedTuple):
    """A number among a model's parameters.

    Attributes
    ----------
    label
        The parameter's name, of a point's component with its axis (`joint.z`).
    unit
        SI unit.
    number
        Its place among all numbers of the parameters.
    value
        In the unit.
    """

    label: str
    unit: str
    number: int
    value: float


class Sensitivities(NamedTuple):
    """A run with its derivatives.

    Attributes
    ----------
    trajectory
        The run itself.
    components
        What derivatives are by.
    states, outputs
        Derivatives (samples, components, states or outputs).
    """

    trajectory: Trajectory
    components: tuple[Component, ...]
    states: np.ndarray
    outputs: np.ndarray


def components(model: Model, names: str | Sequence[str]) -> tuple[Component, ...]:
    """Numbers of parameters by name: all three of a point, or one (`joint.z`).

    Raises
    ------
    InputError
        If a name is none of the model's parameters, or there is none.
    """
    wanted = (names,) if isinstance(names, str) else names
    if not isinstance(wanted, Sequence) or not all(isinstance(name, str) for name in wanted):
        raise InputError(f"parameters is {quoted(names)}, no list of names")
    declared, flat = model.definition.parameters, model.parameters.flat()
    found: dict[int, Component] = {}
    for given in wanted:
        name, axis = parameter_and_axis(model.name, declared, given)
        for k, number in enumerate(numbers_of(model.definition, name)):
            if axis in (None, k):
                label = name if declared[name].size == 1 else f"{name}.{AXES[k]}"
                unit = declared[name].unit
                found[number] = Component(label, unit, number, float(flat[number]))
    if not found:
        raise InputError(f"parameters are none: {model.name} has {', '.join(declared)}")
    return tuple(found.values())


def sensitivities(
    model: Model,
    maneuver: Maneuver,
    names: str | Sequence[str],
    start: Start | None = None,
    tolerance: float | None = None,
) -> Sensitivities:
    """Run of a full model with the derivatives of its states and outputs by parameters.

    Parameters
    ----------
    names
        Of parameters, see `components`.
    start
        Initial condition by name, which moves with the parameters, or a state, which does not.
    tolerance
        Of a dynamic model `TOLERANCE` by default; of derivatives times the parameter's size.

    Raises
    ------
    InputError
        If a name or the start is wrong.
    ConvergenceError
        If the run fails.
    """
    along = components(model, names)
    directions = directions_of(model, along)
    if isinstance(model, AlgebraicModel):
        run = model.simulate(maneuver, start, tolerance=tolerance)
        moved = _implicit(model, run, directions)
    else:
        assert isinstance(model, DynamicModel)
        begun = starts_of(model, along, start), directions, sizes_of(along)
        chosen = TOLERANCE if tolerance is None else tolerance
        maneuver = checked_maneuver(maneuver, model.definition)
        space, tangents = whole_space(len(model.definition.states)), Tangents(*begun)
        found = tangent_run(model.system, space, maneuver, model.start(start), tangents, chosen)
        states, moved = apart(found.path, len(along))
        run = recorded(model, maneuver, found, states)
    outputs = outputs_along(model, run, moved, directions)
    return Sensitivities(run, along, moved, outputs)


def outputs_along(
    model: Model, run: Trajectory, moved: np.ndarray, directions: np.ndarray
) -> np.ndarray:
    """Derivatives (samples, components, outputs) by those of states and constants along a run."""
    paths, constants = (side_by_side(run.states, moved), run.inputs), (model.constants, directions)
    return tangents_along(model.kernels, "outputs", constants, paths, len(model.outputs))


def directions_of(model: Model, along: Sequence[Component]) -> np.ndarray:
    """Derivatives (components, constants) of the model's constants."""
    numbers, flat = [component.number for component in along], model.parameters.flat()
    return constants_along(model.definition, flat, model.equations, numbers)


def sizes_of(along: Sequence[Component]) -> np.ndarray:
    """Magnitudes (components,) of the parameters."""
    return np.array([max(abs(component.value), SMALLEST) for component in along])


def starts_of(model: Model, along: Sequence[Component], start: Start | None) -> np.ndarray:
    """Derivatives (components, states) of a start; none of one that is a state."""
    model.start(start)
    if not (start is None or isinstance(start, str)):
        return np.zeros((len(along), len(model.definition.states)))
    numbers, flat = [component.number for component in along], model.parameters.flat()
    found = starts_along(model.definition, flat, model.equations, numbers)
    return found[start or model.starts[0]]


def recorded(model: DynamicModel, maneuver: Maneuver, run: Run, states: np.ndarray) -> Trajectory:
    """Trajectory of a run; `ConvergenceError` if it has failed."""
    inputs = recorded_inputs(maneuver)[1]
    found = model.trajectory(run.times, inputs, states, run.counts, run.seconds, run.failure)
    if found.status != "ok":
        raise ConvergenceError(f"{model.name}: {found.message}", found)
    return found


def _implicit(model: AlgebraicModel, run: Trajectory, directions: np.ndarray) -> np.ndarray:
    """Derivatives (samples, components, n) of coordinates: dq = -Phi_q^-1 Phi_p dp."""
    samples, n = run.coordinates.shape
    held = np.zeros((samples, len(directions), n))
    paths = side_by_side(run.coordinates, held), run.inputs
    constants = model.constants, directions
    change = tangents_along(model.kernels, "residual", constants, paths, n)
    own = run.coordinates, run.inputs
    parts = results(model.kernels, "residual_jacobian", model.constants, own, n * (n + 1))
    jacobians = parts.reshape(samples, n, n + 1)[:, :, :n]
    moved = -np.linalg.solve(jacobians, change.swapaxes(1, 2))
    return np.ascontiguousarray(moved.swapaxes(1, 2))
