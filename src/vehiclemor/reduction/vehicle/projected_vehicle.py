"""A vehicle's own equations on one affine subspace for all times and inputs."""

from __future__ import annotations

import numpy as np

from vehiclemor.reduction.interface import Offline
from vehiclemor.reduction.reduced_system import ReducedSystem
from vehiclemor.reduction.settings import ProjectedSettings
from vehiclemor.reduction.vehicle.heading_frame import heading_frame
from vehiclemor.reduction.vehicle.shape import VehicleShape, turned
from vehiclemor.simulation.projection_windows import ProjectionWindows
from vehiclemor.simulation.system import Run


def projected_vehicle(
    shape: VehicleShape,
    spaces: ProjectionWindows,
    effective_rank: int,
    offline: Offline,
    settings: ProjectedSettings,
) -> ReducedSystem:
    """The vehicle's equations with speeds in the heading frame, see `heading_frame`, projected.

    Parameters
    ----------
    spaces
        One window for all times, formulation `state`.
    """
    heading = shape.model.planar[2]

    def to_heading_frame(states: np.ndarray) -> np.ndarray:
        return turned(states, shape.pairs, -states[:, heading])

    def from_heading_frame(states: np.ndarray) -> np.ndarray:
        return turned(states, shape.pairs, states[:, heading])

    def encode(state: np.ndarray, _: np.ndarray) -> np.ndarray:
        return to_heading_frame(state[None])[0]

    def lift(run: Run, _: np.ndarray, __: np.ndarray) -> np.ndarray:
        return from_heading_frame(run.path)

    def project(states: np.ndarray) -> np.ndarray:
        # Oblique projection, along the directions that the test basis does not see.
        mean, basis, test = spaces.means[0], spaces.trial_basis[0], spaces.test_basis[0]
        there = to_heading_frame(states)
        return from_heading_frame(mean + (there - mean) @ test.T @ basis)

    return ReducedSystem(
        shape.model,
        heading_frame(shape),
        spaces,
        encode,
        lift,
        effective_rank,
        offline,
        settings.solver,
        settings.tolerance,
        project,
    )


def one_window(
    mean: np.ndarray, trial_basis: np.ndarray, test_basis: np.ndarray
) -> ProjectionWindows:
    """Subspace for all times: mean (2 n,), basis by rows and projection (r, 2 n)."""
    ranks = np.array([len(trial_basis)], dtype=np.int64)
    edges = np.array([0.0, np.inf])
    return ProjectionWindows("state", edges, mean[None], trial_basis[None], test_basis[None], ranks)
