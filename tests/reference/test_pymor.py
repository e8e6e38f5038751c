"""pyMOR's proper orthogonal decomposition spans the same subspaces."""

import numpy as np
import pytest
from pymor.algorithms.pod import pod
from pymor.vectorarrays.numpy import NumpyVectorSpace

from tests.reducing import fitted, two_way_travel
from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.reduction.projection.bases import pod_basis
from vehiclemor.simulation.algebraic import AlgebraicModel


def by_pymor(snapshots: np.ndarray, rank: int) -> tuple[np.ndarray, np.ndarray]:
    """POD modes (n, rank) of the centred snapshots (n, m), and their singular values."""
    centred = snapshots - snapshots.mean(axis=1, keepdims=True)
    array = NumpyVectorSpace(len(snapshots)).from_numpy(centred)
    modes, values, *_ = pod(array, modes=rank, rtol=0.0, atol=0.0)
    return modes.to_numpy(), values


@pytest.mark.parametrize("rank", [1, 3, 6])
def test_same_subspace_for_random_snapshots(rank: int, rng: np.random.Generator) -> None:
    snapshots = rng.standard_normal((8, 20)) * 0.5 ** np.arange(8)[:, None]
    modes, values = by_pymor(snapshots, rank)
    basis = pod_basis(snapshots, rank)
    np.testing.assert_allclose(basis.vectors @ basis.vectors.T, modes @ modes.T, rtol=0, atol=1e-9)
    np.testing.assert_allclose(basis.singular_values[:rank], values, rtol=1e-9)


@pytest.mark.parametrize(("rank", "accuracy"), [(1, 1e-12), (2, 1e-10), (3, 1e-7)])
def test_same_subspace_in_each_control_period(
    model: AlgebraicModel, nominal: Maneuver, rank: int, accuracy: float
) -> None:
    # pyMOR's default takes the eigenvalues of a Gramian, which loses half the digits.
    for maneuver in (nominal, two_way_travel()):
        for k, basis in enumerate(fitted(model, maneuver, "pod", rank=rank).bases):
            times = np.linspace(5.0 * k, 5.0 * k + 5.0, 10)
            modes, _ = by_pymor(model.simulate(maneuver, times=times).coordinates.T, rank)
            difference = basis.vectors @ basis.vectors.T - modes @ modes.T
            assert np.abs(difference).max() < accuracy
