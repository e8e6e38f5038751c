"""Proper orthogonal decomposition of snapshots, and control periods with a subspace each.

Masoudi, Uchida, McPhee (2015), section 3, steps 1 to 5.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

import numpy as np
from pydantic import Field

from vehiclemor.arguments import check_shapes, require
from vehiclemor.exceptions import InputError
from vehiclemor.reduction.settings import AT_MOST_COORDINATES
from vehiclemor.short_repr import ShortRepr

MOST_SNAPSHOTS = 100_000
Rank = Annotated[
    int,
    Field(
        ge=1,
        description="basis vectors in each control period; by default no more than coordinates",
    ),
    AT_MOST_COORDINATES,
]
Snapshots = Annotated[
    int, Field(ge=2, description="snapshots in each control period and training run")
]
RankTolerance = Annotated[
    float,
    Field(
        ge=0.0,
        lt=1.0,
        description="modes with a singular value below it times the first are dropped; 0 keeps all",
    ),
]


@dataclass(frozen=True)
class Basis(ShortRepr):
    """Affine subspace mean (n,) + span of orthonormal columns (n, r).

    Singular values (min(n, m),) are all of the centred snapshots', decreasing.
    """

    mean: np.ndarray
    vectors: np.ndarray
    singular_values: np.ndarray

    def check_sizes(self) -> None:
        """Raise `ValueError` if the columns are not as long as the mean, or are more."""
        n = len(self.mean)
        check_shapes("basis", (self.mean, n), (self.vectors, n, self.rank))
        require(self.rank <= n, "rank")

    @property
    def rank(self) -> int:
        """Number of columns r."""
        return self.vectors.shape[1]


def pod_basis(snapshots: np.ndarray, rank: int, rank_tolerance: float = 0.0) -> Basis:
    """POD basis of snapshots (n, m) by singular value decomposition, mean subtracted.

    Of `rank` left singular vectors those are dropped whose singular value is below the tolerance
    times the first; 0 keeps all.  Signs are fixed: the largest component of each is positive.
    """
    mean = snapshots.mean(axis=1)
    vectors, values, _ = np.linalg.svd(snapshots - mean[:, None], full_matrices=False)
    if rank_tolerance > 0.0:
        rank = min(rank, int(np.count_nonzero(values > rank_tolerance * values[0])))
    vectors = vectors[:, :rank]
    largest = np.abs(vectors).argmax(axis=0)
    signs = np.sign(vectors[largest, np.arange(rank)])
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


def window_edges(duration: float, control_period: float) -> np.ndarray:
    """Edges (windows + 1,) in s of control periods that cover [0, duration].

    The last window is shorter where the period does not divide the duration.
    """
    count = max(1, int(np.ceil(duration / control_period - 1e-9)))
    edges = control_period * np.arange(count + 1)
    edges[-1] = duration
    return edges


def first_samples(times: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Indices (windows + 1,): window k holds the samples from entry k up to entry k + 1.

    A time on an edge belongs to the later window, the end of the run to the last one.
    """
    slack = 1e-9 * (edges[-1] - edges[0])
    inner = np.searchsorted(times, edges[1:-1] - slack)
    return np.concatenate([[0], inner, [len(times)]]).astype(np.int64)


def by_window(
    states: np.ndarray, edges: np.ndarray, project: Callable[[np.ndarray, int], np.ndarray]
) -> np.ndarray:
    """States (samples of equidistant times, n), those of each window by `project(states, k)`."""
    first = first_samples(np.linspace(edges[0], edges[-1], len(states)), edges)
    parts = [project(states[a:b], k) for k, (a, b) in enumerate(pairwise(first))]
    return np.concatenate(parts)
