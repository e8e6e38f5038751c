"""Runs of systems with tangents of their states, and tangents of kernels along such runs.

Forward sensitivities (A. C. Hindmarsh et al., SUNDIALS, ACM Trans. Math. Softw. 31 (2005), section
2.5): the tangents of the states along each parameter are integrated with the states, by the tangent
of the system's own kernel, and the step size control covers both.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vehiclemor.codegen.kernels import Kernels
from vehiclemor.errors import InputError
from vehiclemor.maneuver import Maneuver
from vehiclemor.simulation.checks import loop_array
from vehiclemor.simulation.kernel_derivatives import address_of_tangent, lanes_of
from vehiclemor.simulation.paths import path_loops
from vehiclemor.simulation.projection_windows import ProjectionWindows
from vehiclemor.simulation.run_plans import Run, Solver
from vehiclemor.simulation.system import System

# Formulation of a system -> the same with tangents, and what integrates it.
WITH_TANGENTS = {
    "full": ("sensitivities", "exponential_adams"),
    "state": ("state_sensitivities", "dopri5"),
}


class Tangents(NamedTuple):
    """Tangents of a run, where they begin.

    Attributes
    ----------
    start
        Derivatives (directions, states) of the start.
    directions
        Derivatives (directions, constants) of the system's constants.
    sizes
        Magnitudes (directions,) of what derivatives are by: a tangent times its own counts as an
        error of the state does.
    """

    start: np.ndarray
    directions: np.ndarray
    sizes: np.ndarray


def tangent_run(
    system: System,
    windows: ProjectionWindows,
    maneuver: Maneuver,
    state: np.ndarray,
    tangents: Tangents,
    tolerance: float,
) -> Run:
    """A run from a state (n,) whose path has n columns, and n for each tangent after them.

    Raises
    ------
    InputError
        As of `with_tangents`, or if the tolerance is out of bounds.
    """
    formulation, solver = with_tangents(windows)
    parts = 1 + len(tangents.sizes)
    scale = np.concatenate([[1.0], 1.0 / tangents.sizes])[:, None] * system.error_scale
    start = np.concatenate([state, tangents.start.ravel()])
    wide = replace(system, error_scale=scale.ravel(), directions=tangents.directions)
    spaces = replace(windows, formulation=formulation, ranks=windows.ranks * parts)
    return wide.run(maneuver, start, spaces, Solver(solver, tolerance))


def with_tangents(windows: ProjectionWindows) -> tuple[str, str]:
    """Formulation of a system with tangents and its integrator; `InputError` if there is none."""
    if windows.formulation not in WITH_TANGENTS:
        raise InputError(
            f"the projection of {windows.formulation} has no tangents: choose formulation='state'"
        )
    return WITH_TANGENTS[windows.formulation]


def tangents_along(
    kernels: Kernels,
    name: str,
    constants: tuple[np.ndarray, np.ndarray],
    paths: tuple[np.ndarray, np.ndarray],
    size: int,
) -> np.ndarray:
    """Derivatives (samples, directions, size) of a kernel's results along a run.

    Parameters
    ----------
    constants
        Of the kernel, and their derivatives (directions, constants).
    paths
        States with their tangents after them, and inputs, by sample.
    """
    own, directions = constants
    lanes = lanes_of(len(directions))
    kernel = np.array([address_of_tangent(kernels, name, lanes)], dtype=np.int64)
    states, inputs = (loop_array(path) for path in paths)
    found = np.empty((len(states), len(directions), size))
    path_loops()["tangent_path"](states, inputs, kernel, own, directions, found, lanes)
    return found


def side_by_side(states: np.ndarray, moved: np.ndarray) -> np.ndarray:
    """States (samples, n) with tangents (samples, directions, n) after them."""
    return np.hstack((states, moved.reshape(len(moved), -1)))


def apart(path: np.ndarray, directions: int) -> tuple[np.ndarray, np.ndarray]:
    """States (samples, n) and tangents (samples, directions, n) of a path of both."""
    parts = path.reshape(len(path), 1 + directions, -1)
    return parts[:, 0], parts[:, 1:]
