"""A vehicle's own equations on one affine subspace for all times and inputs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vehiclemor.maneuvers import Maneuver
from vehiclemor.reduction.interface import Offline
from vehiclemor.reduction.online_settings import (
    PROJECTED_SOLVERS,
    PROJECTED_TEXT,
    online_settings,
)
from vehiclemor.reduction.vehicle.shape import VehicleShape
from vehiclemor.simulation.checks import check_inputs
from vehiclemor.simulation.spaces import Spaces
from vehiclemor.simulation.system import System
from vehiclemor.simulation.system_loops import STATE
from vehiclemor.simulation.trajectory import Start, Trajectory

PROJECTED_SETTINGS = online_settings("explicit", 1e-4, PROJECTED_TEXT, PROJECTED_SOLVERS)


@dataclass(frozen=True, eq=False)
class ProjectedVehicle:
    """The vehicle's equations with speeds in the heading frame, on one affine subspace.

    Attributes
    ----------
    shape
        Of the full-order model.
    system
        The equations in the heading frame, see `heading_frame`.
    spaces
        One window for all times, form STATE.
    effective_rank
        Coordinates or modes that stand for the vehicle's.
    """

    shape: VehicleShape
    system: System
    spaces: Spaces
    effective_rank: int
    offline: Offline
    solver: str
    tolerance: float

    def simulate(self, maneuver: Maneuver, start: Start) -> Trajectory:
        """Integrate the projected equations, then turn the speeds back."""
        model = self.shape.model
        check_inputs(maneuver, model.name, model.inputs)
        state = self._turned(model.start(start)[None], -1.0)[0]
        run = self.system.run(maneuver, state, self.spaces, self.solver, self.tolerance)
        states, inputs = self._turned(run.path, 1.0), maneuver.at(run.times)
        return model.recorded(maneuver, run, inputs, states)

    def best_approximation(self, states: np.ndarray) -> np.ndarray:
        """Projection of states (samples, 2 n), along the equations that are left out."""
        mean, lift, drop = self.spaces.means[0], self.spaces.lifts[0], self.spaces.drops[0]
        there = self._turned(states, -1.0)
        return self._turned(mean + (there - mean) @ drop.T @ lift, 1.0)

    def _turned(self, states: np.ndarray, sign: float) -> np.ndarray:
        """States (samples, 2 n) with speeds turned into (-1) or out of (1) the heading frame."""
        turned = states.copy()
        angle = sign * states[:, self.shape.model.planar[2]]
        cosine, sine = np.cos(angle), np.sin(angle)
        for a, b in self.shape.pairs:
            turned[:, a] = cosine * states[:, a] - sine * states[:, b]
            turned[:, b] = sine * states[:, a] + cosine * states[:, b]
        return turned


def one_window(mean: np.ndarray, lift: np.ndarray, drop: np.ndarray) -> Spaces:
    """Subspace for all times: mean (2 n,), basis by rows and projection (r, 2 n)."""
    ranks = np.array([len(lift)], dtype=np.int64)
    return Spaces(STATE, np.array([0.0, np.inf]), mean[None], lift[None], drop[None], ranks)
