"""Derivatives of whole runs by parameters: tangents of all states beside the run itself.

Forward sensitivities (A. C. Hindmarsh et al., SUNDIALS, ACM Trans. Math. Softw. 31 (2005), section
2.5): the tangents of the states along each parameter are integrated with the states, by the tangent
of the model's own kernel, and the step size control covers both.  Mechanisms have theirs at each
sample by the implicit function theorem.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vehiclemor.arguments import quoted
from vehiclemor.errors import ConvergenceError, InputError
from vehiclemor.maneuver import Maneuver
from vehiclemor.parameters import AXES, parameter_and_axis
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.simulation.checks import loop_array
from vehiclemor.simulation.constants import SMALLEST, constants_along, starts_along
from vehiclemor.simulation.constants import components as numbers_of
from vehiclemor.simulation.dynamic import REFERENCE_TOLERANCE, DynamicModel
from vehiclemor.simulation.input_polynomials import recorded_inputs
from vehiclemor.simulation.kernel_derivatives import address_of_tangent, lanes_of
from vehiclemor.simulation.maneuver_checks import checked_maneuver
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.paths import path_loops, results
from vehiclemor.simulation.projection_windows import whole_space
from vehiclemor.simulation.run_plans import Solver
from vehiclemor.simulation.trajectory import Start, Trajectory


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


class Tangents(NamedTuple):
    """What the tangents of a run start with.

    Attributes
    ----------
    start
        Derivatives (components, states) of the start.
    directions
        Derivatives (components, constants) of the hoisted constants.
    sizes
        Magnitudes (components,) of the parameters, for the control of errors.
    """

    start: np.ndarray
    directions: np.ndarray
    sizes: np.ndarray


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
        As of `Model.simulate`; of derivatives times the size of the parameter.

    Raises
    ------
    InputError
        If a name or the start is wrong.
    ConvergenceError
        If the run fails.
    """
    along = components(model, names)
    numbers, flat = [component.number for component in along], model.parameters.flat()
    directions = constants_along(model.definition, flat, model.equations, numbers)
    if isinstance(model, AlgebraicModel):
        run = model.simulate(maneuver, start, tolerance=tolerance)
        moved = _implicit(model, run, directions)
    else:
        assert isinstance(model, DynamicModel)
        begun = np.zeros((len(along), len(model.definition.states)))
        if start is None or isinstance(start, str):
            model.start(start)
            starts = starts_along(model.definition, flat, model.equations, numbers)
            begun = starts[start or model.starts[0]]
        sizes = np.array([max(abs(component.value), SMALLEST) for component in along])
        chosen = REFERENCE_TOLERANCE if tolerance is None else tolerance
        run, moved = _integrated(
            model, maneuver, model.start(start), chosen, Tangents(begun, directions, sizes)
        )
    path = np.hstack((run.states, moved.reshape(len(moved), -1)))
    outputs = _tangents(model, "outputs", path, run.inputs, directions)
    return Sensitivities(run, along, moved, outputs)


def _integrated(
    model: DynamicModel, maneuver: Maneuver, state: np.ndarray, tolerance: float, tangents: Tangents
) -> tuple[Trajectory, np.ndarray]:
    """A run and its tangents (samples, components, states)."""
    n, count = len(state), len(tangents.sizes)
    scale = np.concatenate([[1.0], 1.0 / tangents.sizes])[:, None] * model.error_scale
    start = np.concatenate([state, tangents.start.ravel()])
    system = replace(
        model.system,
        reference=start,
        error_scale=scale.ravel(),
        directions=tangents.directions,
    )
    windows = replace(whole_space(len(start)), formulation="sensitivities")
    maneuver = checked_maneuver(maneuver, model.definition)
    run = system.run(maneuver, start, windows, Solver("dopri5", tolerance))
    path, inputs = run.path, recorded_inputs(maneuver)[1]
    found = model.trajectory(run.times, inputs, path[:, :n], run.counts, run.seconds, run.failure)
    if found.status != "ok":
        raise ConvergenceError(f"{model.name}: {found.message}", found)
    return found, path[:, n:].reshape(-1, count, n)


def _implicit(model: AlgebraicModel, run: Trajectory, directions: np.ndarray) -> np.ndarray:
    """Derivatives (samples, components, n) of coordinates: dq = -Phi_q^-1 Phi_p dp."""
    samples, n = run.coordinates.shape
    held = np.hstack((run.coordinates, np.zeros((samples, n * len(directions)))))
    change = _tangents(model, "residual", held, run.inputs, directions)
    paths = run.coordinates, run.inputs
    parts = results(model.kernels, "residual_jacobian", model.constants, paths, n * (n + 1))
    jacobians = parts.reshape(samples, n, n + 1)[:, :, :n]
    moved = -np.linalg.solve(jacobians, change.swapaxes(1, 2))
    return np.ascontiguousarray(moved.swapaxes(1, 2))


def _tangents(
    model: Model, function: str, path: np.ndarray, inputs: np.ndarray, directions: np.ndarray
) -> np.ndarray:
    """Derivatives (samples, components, size) of a function of the equations along a run.

    Parameters
    ----------
    path
        States and, after them, their derivatives by each component.
    """
    lanes, size = lanes_of(len(directions)), model.equations.shapes[function][0]
    kernel = np.array([address_of_tangent(model.kernels, function, lanes)], dtype=np.int64)
    found = np.empty((len(path), len(directions), size))
    given = loop_array(path), loop_array(inputs), kernel, model.constants, directions
    path_loops()["tangent_path"](*given, found, lanes)
    return found
