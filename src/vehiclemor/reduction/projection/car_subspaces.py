"""Subspaces that cars share, or that are interpolated between cars, for the equations of each."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vehiclemor.reduction.cars import Cars
from vehiclemor.reduction.projection.bases import Basis
from vehiclemor.reduction.projection.grassmann import along, interpolation_weights, tangent
from vehiclemor.reduction.projection.inner_products import mass_weight
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation import linearisation
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.projection_windows import ProjectionWindows


@dataclass(frozen=True)
class LocalBases(ShortRepr):
    """POD bases of a time window, in coordinates times a root of the weight: orthonormal there.

    Attributes
    ----------
    means
        Means of the states (m, 2 n), of all cars together or of each.
    origin
        Vectors (w, r) of the first.
    tangents
        Tangents (m, w, r) at their span, towards those of each.
    singular_values
        Of the first.
    """

    means: np.ndarray
    origin: np.ndarray
    tangents: np.ndarray
    singular_values: np.ndarray

    def between(self, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean (2 n,) and vectors (w, r) for weights (m,) of the cars."""
        if len(weights) == 1:
            return self.means[0], self.origin
        return weights @ self.means, along(self.origin, np.tensordot(weights, self.tangents, 1))


def local_bases(found: Sequence[Basis]) -> LocalBases:
    """Bases of some cars, with the means of all states; as many vectors as all of them have."""
    rank = min(basis.rank for basis in found)
    origin = found[0].vectors[:, :rank]
    tangents = [tangent(origin, basis.vectors[:, :rank]) for basis in found[1:]]
    return LocalBases(
        np.array([basis.mean for basis in found]),
        origin,
        np.array([np.zeros_like(origin), *tangents]),
        found[0].singular_values,
    )


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
        Bases of each window.
    formulation, inner_product
        As in the settings.
    weight
        Weight (m, m) of the inner product of the snapshots.
    """

    cars: Cars
    edges: np.ndarray
    local: tuple[LocalBases, ...]
    formulation: str
    inner_product: str
    weight: np.ndarray

    def of(self, model: DynamicModel) -> tuple[ProjectionWindows, tuple[Basis, ...]]:
        """Windows and bases of a car, orthonormal in its own inner product."""
        weights = np.ones(1)
        if len(self.local[0].means) > 1:
            places = self.cars.places(self.cars.values)
            weights = interpolation_weights(places, self.cars.place(model))
        weight = self.weight
        if self.inner_product == "energy":
            period = float(self.edges[1] - self.edges[0])
            weight = mass_weight(model, period if self.formulation == "state" else None)
        root, means, bases = np.linalg.cholesky(self.weight), [], []
        for local in self.local:
            mean, scaled = local.between(weights)
            vectors = np.linalg.solve(root.T, scaled)
            if not np.array_equal(weight, self.weight):
                gram = np.linalg.cholesky(vectors.T @ weight @ vectors)
                vectors = np.linalg.solve(gram, vectors.T).T
            means.append(mean)
            bases.append(Basis(mean[: len(weight)], vectors, local.singular_values))
        return self._spaces(model, means, bases, weight), tuple(bases)

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
