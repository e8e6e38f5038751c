"""Subspaces that cars share, or that are interpolated between cars, for the equations of each."""

from dataclasses import dataclass, replace

import numpy as np

from vehiclemor.reduction.cars import Cars
from vehiclemor.reduction.projection.bases import Basis
from vehiclemor.reduction.projection.grassmann import interpolated, interpolation_weights
from vehiclemor.reduction.projection.inner_products import mass_weight
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation import linearisation
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.projection_windows import ProjectionWindows


@dataclass(frozen=True)
class LocalBasis(ShortRepr):
    """POD basis of a time window: mean of the states (2 n,), vectors (m, r), singular values.

    The vectors are orthonormal: those of the states or coordinates times a root of the weight.
    """

    mean: np.ndarray
    vectors: np.ndarray
    singular_values: np.ndarray


@dataclass(frozen=True, eq=False)
class Subspaces(ShortRepr):
    """What the subspaces of any car follow from.

    Attributes
    ----------
    cars
        Those of the training runs.
    edges
        Window edges (windows + 1,) in s.
    local
        By window the basis of all cars, or one for each.
    formulation, inner_product
        As in the settings.
    weight
        Weight (m, m) of the inner product of the snapshots.
    """

    cars: Cars
    edges: np.ndarray
    local: tuple[tuple[LocalBasis, ...], ...]
    formulation: str
    inner_product: str
    weight: np.ndarray

    def of(self, model: DynamicModel) -> tuple[ProjectionWindows, tuple[Basis, ...]]:
        """Windows and bases of a car, orthonormal in its own inner product."""
        weights = np.ones(1)
        if len(self.local[0]) > 1:
            places = self.cars.places(self.cars.values)
            weights = interpolation_weights(places, self.cars.place(model))
        window = [_between(local, weights) for local in self.local]
        weight = self.weight
        if self.inner_product == "energy":
            period = float(self.edges[1] - self.edges[0])
            weight = mass_weight(model, period if self.formulation == "state" else None)
        root = np.linalg.cholesky(self.weight)
        bases = []
        for found in window:
            vectors = np.linalg.solve(root.T, found.vectors)
            if not np.array_equal(weight, self.weight):
                gram = np.linalg.cholesky(vectors.T @ weight @ vectors)
                vectors = np.linalg.solve(gram, vectors.T).T
            bases.append(Basis(found.mean[: len(weight)], vectors, found.singular_values))
        return self._spaces(model, [found.mean for found in window], bases, weight), tuple(bases)

    def _spaces(
        self,
        model: DynamicModel,
        means: list[np.ndarray],
        bases: list[Basis],
        weight: np.ndarray,
    ) -> ProjectionWindows:
        formulation = self.formulation
        n, windows = len(model.coordinates), len(bases)
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
            r, width = basis.rank, len(basis.mean)
            up, down = basis.vectors.T, basis.vectors.T @ weight
            trial[k, :r, :width], test[k, :r, :width] = up, down
            if formulation == "paired":
                trial[k, r : 2 * r, n:], test[k, r : 2 * r, n:] = up @ turn.T, down @ back
            ranks[k] = r if formulation == "state" else 2 * r
        form = "coordinates" if formulation == "coordinates" else "state"
        return ProjectionWindows(form, self.edges, np.array(means), trial, test, ranks)


def _between(local: tuple[LocalBasis, ...], weights: np.ndarray) -> LocalBasis:
    """The bases of some cars, weighted; as many vectors as all of them have."""
    if len(local) == 1:
        return local[0]
    rank = min(basis.vectors.shape[1] for basis in local)
    vectors = interpolated(np.array([basis.vectors[:, :rank] for basis in local]), weights)
    mean = np.tensordot(weights, [basis.mean for basis in local], 1)
    return replace(local[0], mean=mean, vectors=vectors)
