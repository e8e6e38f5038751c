"""Proper orthogonal decomposition of snapshots, and projection onto its subspace.

Masoudi, Uchida, McPhee (2015), section 3, steps 1 to 5.
"""

from dataclasses import dataclass

import numpy as np

from vehiclemor.errors import InputError
from vehiclemor.short_repr import ShortRepr
from vehiclemor.sizes import require, shaped

MOST_SNAPSHOTS = 100_000


@dataclass(frozen=True)
class Basis(ShortRepr):
    """Affine subspace mean + span(vectors).

    Attributes
    ----------
    mean
        Mean of the snapshots (n,).
    vectors
        Orthonormal columns (n, r).
    singular_values
        All singular values (min(n, m),) of the centred snapshots, decreasing.
    """

    mean: np.ndarray
    vectors: np.ndarray
    singular_values: np.ndarray

    def check_sizes(self) -> None:
        """Raise `ValueError` if the columns are not as long as the mean, or are more."""
        n = len(self.mean)
        shaped("basis", (self.mean, n), (self.vectors, n, self.rank))
        require(self.rank <= n, "rank")

    @property
    def rank(self) -> int:
        """Number of columns r."""
        return self.vectors.shape[1]


def pod_basis(snapshots: np.ndarray, rank: int, rank_tolerance: float = 0.0) -> Basis:
    """POD basis of snapshots by singular value decomposition, mean subtracted.

    Parameters
    ----------
    snapshots
        One snapshot in each column (n, m).
    rank
        Number of left singular vectors r, at most min(n, m).
    rank_tolerance
        Vectors whose singular value is below it times the first are dropped; 0 keeps all r.

    Returns
    -------
    Basis
        The sign of each vector is fixed: its largest component is positive.
    """
    mean = snapshots.mean(axis=1)
    vectors, values, _ = np.linalg.svd(snapshots - mean[:, None], full_matrices=False)
    kept = rank
    if rank_tolerance > 0.0:
        kept = min(rank, int(np.count_nonzero(values > rank_tolerance * values[0])))
    vectors = vectors[:, :kept]
    largest = np.abs(vectors).argmax(axis=0)
    signs = np.sign(vectors[largest, np.arange(kept)])
    return Basis(mean, vectors * signs, values)


def project(coordinates: np.ndarray, basis: Basis) -> np.ndarray:
    """Best approximation (samples, n) of coordinates (samples, n) in the affine subspace."""
    centred = coordinates - basis.mean
    return basis.mean + (centred @ basis.vectors) @ basis.vectors.T


def check_pod(rank: int, snapshots: int, states: int, whose: str) -> None:
    """Raise `InputError` if a rank is above the number of states or of snapshots, or these many."""
    if rank > states:
        raise InputError(f"rank {rank} is above the {states} {whose}")
    if snapshots > MOST_SNAPSHOTS:
        raise InputError(f"snapshots is {snapshots}; it must be at most {MOST_SNAPSHOTS}")
    if rank > snapshots:
        raise InputError(f"rank {rank} is above the number of snapshots {snapshots}")
