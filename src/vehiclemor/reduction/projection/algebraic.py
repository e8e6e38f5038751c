"""Reduced algebraic equations on one affine subspace in each time window."""

import time
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from pydantic import Field

from vehiclemor.arguments import check_shapes, require
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.reduction.interface import OfflineCost, offline_cost
from vehiclemor.reduction.projection.algebraic_loops import Windows
from vehiclemor.reduction.projection.bases import (
    Basis,
    Rank,
    RankTolerance,
    Snapshots,
    by_window,
    check_pod,
    first_samples,
    pod_basis,
    project,
)
from vehiclemor.reduction.reduced_system import ReducedMechanism
from vehiclemor.reduction.settings import Settings, StepTolerance
from vehiclemor.reduction.training import Training
from vehiclemor.registry import choice
from vehiclemor.simulation.algebraic import AlgebraicModel, kinematic_loop, new_counts
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.newton_loops import Iteration, Solution
from vehiclemor.simulation.run_timer import timed
from vehiclemor.simulation.trajectory import Start, Trajectory

ITERATION_LIMIT = 50


class AlgebraicPodSettings(Settings):
    """POD subspaces of algebraic equations.

    Least squares, the default, does not depend on the order and signs in which the equations are
    written (Galerkin does, by orders of magnitude), and the rank cut keeps directions out that
    rounding chooses.
    """

    rank: Rank = 3
    snapshots: Snapshots = 10
    rank_tolerance: RankTolerance = 1e-10
    test_space: Literal["least_squares", "galerkin"] = Field(
        "least_squares",
        description="least_squares: Gauss-Newton on the residual; galerkin: U^T Phi = 0 "
        "(paper, step 6)",
    )
    equation_seed: int = Field(
        0,
        ge=0,
        description="galerkin: seed of a random order and signs of the equations; 0: natural",
    )
    reversed_coordinates: str = Field(
        "", description="galerkin: coordinates counted the other way round, separated by commas"
    )
    integration = ("tolerance",)
    tolerance: StepTolerance = 1e-12
    rounding_seed: int = Field(
        0, ge=0, description="seed of a relative noise of 2^-52 on the snapshots; 0: none"
    )


@dataclass(frozen=True)
class AlgebraicProjection(ReducedMechanism):
    """Reduced model on affine subspaces, one in each window between edges (windows + 1,) in s.

    Test bases (n, r) of the windows are none for least squares; the tolerance is the largest step
    of the last iteration in reduced coordinates.
    """

    model: AlgebraicModel
    edges: np.ndarray
    bases: tuple[Basis, ...]
    tests: tuple[np.ndarray, ...] | None
    offline: OfflineCost
    tolerance: float

    def check_sizes(self) -> None:
        """Raise `ValueError` if there is no basis of the model's coordinates for each window."""
        n, windows = len(self.model.coordinates), len(self.bases)
        check_shapes("edges", (self.edges, windows + 1))
        require(all(len(basis.mean) == n for basis in self.bases), "bases")

    @property
    def order(self) -> int:
        """Largest number of reduced coordinates in any window."""
        return max(basis.rank for basis in self.bases)

    def solved_at(self, times: np.ndarray, inputs: np.ndarray, state: np.ndarray) -> Trajectory:
        """Solve the reduced equations at some times, beginning at a state (n,)."""
        model = self.model
        n, windows = len(model.coordinates), len(self.bases)
        bases, tests = np.zeros((windows, n, n)), np.zeros((windows, n, n))
        for k, basis in enumerate(self.bases):
            bases[k, : basis.rank] = basis.vectors.T
            if self.tests is not None:
                tests[k, : basis.rank] = self.tests[k].T
        means = np.array([basis.mean for basis in self.bases])
        ranks = np.array([basis.rank for basis in self.bases])
        least_squares = int(self.tests is None)
        samples = first_samples(times, self.edges)
        subspaces = Windows(samples, means, bases, tests, ranks, least_squares)
        iteration = Iteration(self.tolerance, ITERATION_LIMIT, np.inf)
        kernels = model.addresses("jacobian_entries", "jacobian_product")
        given = (state, subspaces, inputs, model.constants, kernels, iteration)
        loop = kinematic_loop("projected_path", "reduction.projection.algebraic_loops")
        buffer = np.empty(3 * n + 3 * n * (n + 1) + len(model.inputs))
        path, counts = np.full((len(times), n), np.nan), new_counts()
        status, seconds = timed(loop.prepared(*given, Solution(path, counts), buffer))
        return model.trajectory(times, inputs, path, counts.tolist(), seconds, status)

    def simulate(self, maneuver: Excitation, start: Start) -> Trajectory:
        """Solve the reduced equations at the maneuver's output times."""
        times, inputs, _ = self.model.sampled(maneuver)
        return self.solved_at(times, inputs, self.model.start(start))

    def solved(self, time: float, inputs: np.ndarray, state: np.ndarray) -> Trajectory:
        """Solution at one time, in the window that it is in."""
        return self.solved_at(np.array([time]), inputs, state)

    def best_approximation(self, states: np.ndarray) -> np.ndarray:
        """Projection of states (samples of equidistant times, n) onto the subspaces."""
        return by_window(states, self.edges, lambda part, k: project(part, self.bases[k]))


def fit_windows(
    model: AlgebraicModel, training: Training, edges: np.ndarray, settings: AlgebraicPodSettings
) -> AlgebraicProjection:
    """POD subspaces between edges (windows + 1,) in s, of snapshots as in `dynamic.fit_windows`."""
    began = time.process_time()
    count, rank = settings.snapshots, settings.rank
    snapshot_times = [np.linspace(a, b, count) for a, b in pairwise(edges)]
    histories = [run.at(np.concatenate(snapshot_times)) for run in training]
    bases = []
    for k in range(len(snapshot_times)):
        part = slice(k * count, (k + 1) * count)
        snapshots = np.concatenate([history.coordinates[part] for history in histories]).T
        if seed := settings.rounding_seed:
            noise = np.random.default_rng(seed).standard_normal(snapshots.shape)
            snapshots = snapshots * (1.0 + np.finfo(float).eps * noise)
        bases.append(pod_basis(snapshots, rank, settings.rank_tolerance))
    tests = None
    if settings.test_space == "galerkin":
        pairing = _pairing(model, settings)
        tests = tuple(pairing @ basis.vectors for basis in bases)
    offline = offline_cost(began, model, histories)
    return AlgebraicProjection(model, edges, tuple(bases), tests, offline, settings.tolerance)


def check_subspace(model: Model, settings: AlgebraicPodSettings) -> None:
    """Raise `InputError` if rank, snapshots or coordinate names don't fit the model."""
    whose = f"coordinates of {model.name}"
    check_pod(settings.rank, settings.snapshots, len(model.coordinates), whose)
    _reversed(model, settings)


def _reversed(model: Model, settings: AlgebraicPodSettings) -> list[int]:
    known, names = model.coordinates, filter(None, settings.reversed_coordinates.split(","))
    return [known.index(choice("coordinate in reversed_coordinates", n, known)) for n in names]


def _pairing(model: AlgebraicModel, settings: AlgebraicPodSettings) -> np.ndarray:
    """Matrix P such that the Galerkin test basis is P U.

    Equations reordered and with other signs are D Phi with a signed permutation D, so that
    U^T D Phi = 0 tests with D^T U.  Coordinates with signs S have the basis S U: the same as
    changed signs of the equations with the same numbers.
    """
    n = len(model.coordinates)
    pairing = np.eye(n)
    seed = settings.equation_seed
    if seed:
        generator = np.random.default_rng(seed)
        order = generator.permutation(n)
        signs = generator.choice([-1.0, 1.0], size=n)
        pairing = (signs[:, None] * np.eye(n)[order]).T
    for index in _reversed(model, settings):
        pairing[:, index] *= -1.0
    return pairing
