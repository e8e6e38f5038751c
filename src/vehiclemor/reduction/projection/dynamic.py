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

import numpy as np

from vehiclemor.errors import InputError
from vehiclemor.reduction.interface import Offline, offline_cost
from vehiclemor.reduction.projection.bases import Basis, check_pod, pod_basis
from vehiclemor.reduction.projection.inner_products import coordinate_weight, state_weight
from vehiclemor.reduction.projection.pod_settings import DynamicPodSettings
from vehiclemor.reduction.projection.windows import by_window
from vehiclemor.reduction.reduced_system import ReducedSystem
from vehiclemor.reduction.settings import ProjectedSettings
from vehiclemor.reduction.training import Training
from vehiclemor.simulation import linearisation
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.projection_windows import ProjectionWindows


@dataclass(frozen=True, eq=False)
class DynamicProjection(ReducedSystem):
    """Projected equations of motion on affine subspaces, one in each window.

    Attributes
    ----------
    bases
        Basis of each window, orthonormal in its inner product: of the states for `state`, else of
        the coordinates; `spaces` are the same for the compiled loops.  Each window starts where the
        one before has ended.
    """

    bases: tuple[Basis, ...] = ()

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
        rates = self.model.derivatives_at(states, inputs)[:, :n]
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
        model says that the projection has made the system unstable.  NaN where the training was at
        rest: a window of rank 0 has no eigenvalue.
        """
        model, spaces = self.model, self.spaces
        rates = np.full(len(self.bases), np.nan)
        for k in np.flatnonzero(spaces.ranks).tolist():
            y = self._at_mean(k)[: spaces.ranks[k]]
            jacobian = linearisation.reduced_jacobian(model, spaces, k, y)
            rates[k] = np.linalg.eigvals(jacobian).real.max()
        return rates

    def _at_mean(self, window: int) -> np.ndarray:
        """Reduced coordinates of the mean; rates too, where these are coordinates of their own."""
        y = np.zeros(self.spaces.ranks.max())
        if self.spaces.formulation == "coordinates":
            rank = self.spaces.ranks[window] // 2
            y[rank : 2 * rank] = self.spaces.test_basis[window, :rank, :] @ self._mean_rates[window]
        return y

    @cached_property
    def _mean_rates(self) -> np.ndarray:
        n = len(self.model.coordinates)
        inputs = np.zeros((len(self.bases), len(self.model.inputs)))
        rates = np.zeros_like(self.spaces.means)
        rates[:, :n] = self.model.derivatives_at(self.spaces.means, inputs)[:, :n]
        return rates

    @property
    def spectral_abscissa(self) -> float:
        """Largest spectral abscissa in any window, 1/s; NaN if all windows are at rest."""
        return float(np.fmax.reduce(self.spectral_abscissas))


def fit_windows(
    model: DynamicModel, training: Training, edges: np.ndarray, settings: DynamicPodSettings
) -> DynamicProjection:
    """POD subspaces of equidistant snapshots (both ends included) of all runs.

    Windows lie between edges (windows + 1,) in s.

    Raises
    ------
    InputError
        If the training runs differ in duration.
    """
    durations = sorted({run.maneuver.duration for run in training})
    if len(durations) > 1:
        lengths = ", ".join(f"{duration:g}" for duration in durations)
        raise InputError(f"windows in time need training runs of one duration, not {lengths} s")
    began = time.process_time()
    count = settings.snapshots
    moments = np.concatenate([np.linspace(a, b, count) for a, b in pairwise(edges)])
    # The same time twice, at inner edges, needs one sample.
    unique, places = np.unique(moments, return_inverse=True)
    histories = [run.at(unique) for run in training]
    states = np.array([history.states[places] for history in histories])
    weight = _weight(model, settings, states.reshape(-1, states.shape[-1]), edges)
    windows = [slice(k * count, (k + 1) * count) for k in range(len(edges) - 1)]
    snapshots = [states[:, window].reshape(-1, states.shape[-1]) for window in windows]
    bases = [_basis(part[:, : len(weight)], weight, settings) for part in snapshots]
    means = np.array([part.mean(axis=0) for part in snapshots])
    spaces = _spaces(model, edges, means, bases, (weight, settings.formulation))
    return projected_equations(
        model, spaces, bases, offline_cost(began, model, histories), settings
    )


def _basis(snapshots: np.ndarray, weight: np.ndarray, settings: DynamicPodSettings) -> Basis:
    """POD basis of snapshots (samples, m), orthonormal by the weight (m, m), and their mean."""
    root = np.linalg.cholesky(weight)
    scaled = pod_basis((snapshots @ root).T, settings.rank, settings.rank_tolerance)
    vectors = np.linalg.solve(root.T, scaled.vectors)
    return Basis(snapshots.mean(axis=0), vectors, scaled.singular_values)


def _spaces(
    model: DynamicModel,
    edges: np.ndarray,
    means: np.ndarray,
    bases: Sequence[Basis],
    how: tuple[np.ndarray, str],
) -> ProjectionWindows:
    """Subspaces around the means (windows, 2 n), by a weight and a formulation, for the loops."""
    (weight, formulation), n, windows = how, len(model.coordinates), len(bases)
    rows = max(basis.rank for basis in bases) * (2 if formulation == "paired" else 1)
    trial, test = np.zeros((windows, rows, 2 * n)), np.zeros((windows, rows, 2 * n))
    ranks = np.empty(windows, dtype=np.int64)
    # The speeds that go with rates of the coordinates, where angles are small.
    turn = (
        linearisation.speeds_per_rates(model, model.start())
        if formulation == "paired"
        else np.eye(n)
    )
    back = np.linalg.inv(turn)
    for k, basis in enumerate(bases):
        r, width = basis.rank, len(weight)
        up, down = basis.vectors.T, basis.vectors.T @ weight
        trial[k, :r, :width], test[k, :r, :width] = up, down
        if formulation == "paired":
            trial[k, r : 2 * r, n:], test[k, r : 2 * r, n:] = up @ turn.T, down @ back
        ranks[k] = r if formulation == "state" else 2 * r
    form = "coordinates" if formulation == "coordinates" else "state"
    return ProjectionWindows(form, edges, means, trial, test, ranks)


def projected_equations(
    model: DynamicModel,
    spaces: ProjectionWindows,
    bases: Sequence[Basis],
    offline: Offline,
    settings: ProjectedSettings,
) -> DynamicProjection:
    """The equations of a model in subspaces, integrated as the settings say."""
    rank = max(basis.rank for basis in bases)
    how = settings.solver, settings.tolerance
    return DynamicProjection(model, model.system, spaces, rank, offline, *how, bases=tuple(bases))


def _weight(
    model: DynamicModel, settings: DynamicPodSettings, states: np.ndarray, edges: np.ndarray
) -> np.ndarray:
    """Weight of the inner product: of all states (2 n, 2 n) or of the coordinates (n, n)."""
    if settings.formulation == "state":
        return state_weight(model, settings.inner_product, states, float(edges[1] - edges[0]))
    coordinates = states[:, : len(model.coordinates)]
    return coordinate_weight(model, settings.inner_product, coordinates)


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
