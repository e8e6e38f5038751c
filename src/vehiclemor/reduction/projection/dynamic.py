"""Reduced dynamic models on one affine subspace in each time window.

Masoudi, Uchida, McPhee (2015), section 3, steps 1 to 6, with the choices that the paper leaves open
as settings: which equations are projected (formulation), and in which inner product snapshots are
compared.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Literal

import numpy as np
from pydantic import Field

from vehiclemor.arguments import require
from vehiclemor.reduction.interface import OfflineCost, offline_cost
from vehiclemor.reduction.projection.bases import (
    Basis,
    Rank,
    RankTolerance,
    Snapshots,
    by_window,
    check_pod,
    pod_basis,
)
from vehiclemor.reduction.reduced_system import ReducedSystem
from vehiclemor.reduction.settings import ProjectedSolver, Settings, Tolerance
from vehiclemor.reduction.training import Training
from vehiclemor.simulation.control_periods import ControlPeriods
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.evaluation import STATE
from vehiclemor.simulation.stepping import Sensitivity
from vehiclemor.simulation.system import System

# A state whose range is below this share of the largest one is noise, not motion.
SMALLEST_RANGE = 1e-6


class DynamicPodSettings(Settings):
    """POD subspaces of equations of motion.

    The defaults are chosen by measurement, on the nominal runs that are then compared with the
    paper: they keep the published errors from both starts, as states weighed by energy do too, and
    the projected equations keep the model's energy.
    """

    integration = ("solver", "tolerance")
    solver: ProjectedSolver = "dopri5"
    tolerance: Tolerance = 1e-6
    rank: Rank = 3
    snapshots: Snapshots = 10
    rank_tolerance: RankTolerance = 1e-6
    formulation: Literal["coordinates", "state", "paired"] = Field(
        "coordinates",
        description="coordinates: V^T M V qh'' = V^T F; state: all states in one basis (the "
        "paper's words); paired: first order, the coordinates' basis for speeds too",
    )
    inner_product: Literal["euclidean", "energy", "range"] = Field(
        "energy",
        description="of the snapshots: euclidean, energy (mass matrix), range (each state by its "
        "range)",
    )


class ConstrainedPodSettings(DynamicPodSettings):
    """POD subspaces of equations of motion with constraints: the paper's rank and snapshots.

    One mode of the states holds position and speed together, so that one coordinate can follow a
    maneuver; weighed by energy it keeps the published errors from both starts, and no rank makes
    the reduced equations unstable.
    """

    rank: Rank = 1
    snapshots: Snapshots = 5
    formulation: Literal["coordinates", "state", "paired"] = Field(
        "state", description="as for a model without constraints"
    )


@dataclass(frozen=True, eq=False)
class DynamicProjection(ReducedSystem):
    """Projected equations of motion on affine subspaces, one in each window."""

    model: DynamicModel
    spaces: ControlPeriods
    offline: OfflineCost
    solver: str
    tolerance: float
    # Basis of each window, orthonormal in its inner product: of the states for `state`, else of the
    # coordinates; `spaces` are the same for the compiled loops.
    bases: tuple[Basis, ...] = ()

    def check_sizes(self) -> None:
        """Raise `ValueError` if the subspaces are of other states than the model's."""
        require(self.spaces.formulation != "full", "formulation")
        require(self.spaces.means.shape[1] == 2 * len(self.model.coordinates), "spaces")

    @property
    def system(self) -> System:
        """The equations of the model."""
        return self.model.system

    @property
    def order(self) -> int:
        """Largest number of basis vectors in any window."""
        return max(basis.rank for basis in self.bases)

    def best_approximation(self, states: np.ndarray) -> np.ndarray:
        """Projection of states (samples of equidistant times, 2 n) onto the subspaces."""
        return by_window(states, self.spaces.edges, self._projected)

    def _projected(self, states: np.ndarray, window: int) -> np.ndarray:
        spaces, n = self.spaces, len(self.model.coordinates)
        mean, rank = spaces.means[window], spaces.ranks[window]
        trial, test = spaces.trial_basis[window], spaces.test_basis[window]
        if spaces.formulation == "state":
            return mean + (states - mean) @ test[:rank].T @ trial[:rank]
        trial, test = trial[: rank // 2, :n], test[: rank // 2, :n]
        inputs = np.zeros((len(states), len(self.model.inputs)))
        rates = self.model.rhs_at(states, inputs)[:, :n]
        result = np.empty_like(states)
        result[:, :n] = mean[:n] + (states[:, :n] - mean[:n]) @ test.T @ trial
        result[:, n:] = rates @ test.T @ trial
        for row in result:
            row[n:] = self.model.speeds_of_rates(row)
        return result

    @cached_property
    def spectral_abscissas(self) -> np.ndarray:
        """Largest real part of an eigenvalue of each window's reduced Jacobian (windows,), 1/s.

        At the mean of the window's snapshots, without steering.  One far above that of the full
        model says that the projection is unstable.  NaN where the training was at
        rest: a window of rank 0 has no eigenvalue.
        """
        spaces, rates = self.spaces, np.full(len(self.bases), np.nan)
        middles = 0.5 * (spaces.edges[1:] + spaces.edges[:-1])
        no_input, by_state = self.model.inputs_at_rest, Sensitivity(STATE)
        for k in np.flatnonzero(spaces.ranks).tolist():
            jacobian = self.rate_sensitivities(spaces.means[k], no_input, middles[k], by_state)
            eigenvalues = np.linalg.eigvals(jacobian)
            # The others are zero: nothing moves out of the subspace.
            within = np.argsort(np.abs(eigenvalues))[-spaces.ranks[k] :]
            rates[k] = eigenvalues[within].real.max()
        return rates

    @property
    def spectral_abscissa(self) -> float:
        """Largest spectral abscissa in any window, 1/s; NaN if all windows are at rest."""
        return float(np.fmax.reduce(self.spectral_abscissas))


def fit_windows(
    model: DynamicModel, training: Training, edges: np.ndarray, settings: DynamicPodSettings
) -> DynamicProjection:
    """POD subspaces, between edges (windows + 1,) in s, of equidistant snapshots of all runs."""
    began = time.process_time()
    count = settings.snapshots
    snapshot_times = np.concatenate([np.linspace(a, b, count) for a, b in pairwise(edges)])
    # The same time twice, at inner edges, needs one sample.
    unique, indices = np.unique(snapshot_times, return_inverse=True)
    histories = [run.at(unique) for run in training]
    states = np.array([history.states[indices] for history in histories])
    weight = _weight(model, settings, states.reshape(-1, states.shape[-1]), edges)
    windows = [slice(k * count, (k + 1) * count) for k in range(len(edges) - 1)]
    snapshots = [states[:, window].reshape(-1, states.shape[-1]) for window in windows]
    root, bases = np.linalg.cholesky(weight), []
    for part in (part[:, : len(weight)] for part in snapshots):
        scaled = pod_basis((part @ root).T, settings.rank, settings.rank_tolerance)
        vectors = np.linalg.solve(root.T, scaled.vectors)
        bases.append(Basis(part.mean(axis=0), vectors, scaled.singular_values))
    means = np.array([part.mean(axis=0) for part in snapshots])
    spaces = _spaces(model, edges, means, bases, (weight, settings.formulation))
    offline = offline_cost(began, model, histories)
    how = settings.solver, settings.tolerance, tuple(bases)
    return DynamicProjection(model, spaces, offline, *how)


def _spaces(
    model: DynamicModel,
    edges: np.ndarray,
    means: np.ndarray,
    bases: Sequence[Basis],
    how: tuple[np.ndarray, str],
) -> ControlPeriods:
    """Subspaces around the means (windows, 2 n), by a weight and a formulation, for the loops."""
    (weight, formulation), n, windows = how, len(model.coordinates), len(bases)
    rows = max(basis.rank for basis in bases) * (2 if formulation == "paired" else 1)
    trial, test = np.zeros((windows, rows, 2 * n)), np.zeros((windows, rows, 2 * n))
    ranks = np.empty(windows, dtype=np.int64)
    # The speeds that go with rates of the coordinates, where angles are small.
    turn = speeds_per_rates(model) if formulation == "paired" else np.eye(n)
    back = np.linalg.inv(turn)
    for k, basis in enumerate(bases):
        r, width = basis.rank, len(weight)
        up, down = basis.vectors.T, basis.vectors.T @ weight
        trial[k, :r, :width], test[k, :r, :width] = up, down
        if formulation == "paired":
            trial[k, r : 2 * r, n:], test[k, r : 2 * r, n:] = up @ turn.T, down @ back
        ranks[k] = r if formulation == "state" else 2 * r
    form = "coordinates" if formulation == "coordinates" else "state"
    return ControlPeriods(form, edges, means, trial, test, ranks)


def speeds_per_rates(model: DynamicModel) -> np.ndarray:
    """Matrix (n, n) that turns rates of the coordinates into speeds at the first start."""
    n = len(model.coordinates)
    states = np.hstack([np.tile(model.start()[:n], (n, 1)), np.eye(n)])
    return np.column_stack([model.speeds_of_rates(state) for state in states])


def _weight(
    model: DynamicModel, settings: DynamicPodSettings, states: np.ndarray, edges: np.ndarray
) -> np.ndarray:
    """Weight W of the inner product <a, b> = a^T W b: of all states or of the coordinates.

    `energy` is the mass matrix M at the first start; of states blkdiag(M / tau^2, M), tau the
    length of a window, where M of the speeds follows from the map of rates to speeds there.
    `range` is one over the square of each state's range.
    """
    n, of_states = len(model.coordinates), settings.formulation == "state"
    states = states if of_states else states[:, :n]
    if settings.inner_product == "euclidean":
        return np.eye(states.shape[1])
    if settings.inner_product == "range":
        ranges = np.ptp(states, axis=0)
        return np.diag(1.0 / np.maximum(ranges, SMALLEST_RANGE * ranges.max()) ** 2)
    mass = model.mass_matrix(model.start())
    if not of_states:
        return mass
    weight = np.zeros((2 * n, 2 * n))
    weight[:n, :n] = mass / float(edges[1] - edges[0]) ** 2
    inverse = np.linalg.inv(speeds_per_rates(model))
    weight[n:, n:] = inverse.T @ mass @ inverse
    return weight


def further_states_refused(model: DynamicModel) -> str:
    """Why a model, or its definition, can't be projected; empty if it can."""
    if not model.further_states:
        return ""
    return f"{model.name} has further states; only coordinates and speeds can be projected"


def check_subspace(model: DynamicModel, settings: DynamicPodSettings) -> None:
    """Raise `InputError` if the settings don't fit the model."""
    formulation, energy = settings.formulation, settings.inner_product == "energy"
    if formulation == "coordinates" or energy:
        model.require("second_order")
    if formulation != "state" or energy:
        model.require("speeds")
    states, kind = len(model.coordinates), "coordinates"
    if formulation == "state":
        states, kind = 2 * states, "states"
    check_pod(settings.rank, settings.snapshots, states, f"{kind} of {model.name}")
