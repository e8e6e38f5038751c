"""Errors that a separate implementation of the same specification found; pyMOR's subspaces."""

import numpy as np
import pytest
from pymor.algorithms.pod import pod
from pymor.vectorarrays.numpy import NumpyVectorSpace

from tests.reducing import figure_errors, fitted, two_way_travel

# Test space, frequency and amplitude factor, RMS of spindle y (m) and second Euler angle (rad), to
# two digits; three coordinates, bases of the unperturbed run.
FOUND = [
    ("galerkin", 1.0, 1.0, 6.0e-7, 2.9e-6),
    ("galerkin", 1.0, 1.2, 9.4e-6, 2.7e-5),
    ("galerkin", 1.2, 1.0, 1.5e-4, 3.6e-4),
    ("galerkin", 2.0, 1.0, 2.6e-4, 8.5e-4),
    ("least_squares", 1.0, 1.0, 4.9e-7, 3.9e-6),
    ("least_squares", 1.0, 1.2, 4.2e-6, 3.7e-5),
    ("least_squares", 1.2, 1.0, 5.3e-5, 4.1e-4),
    ("least_squares", 2.0, 1.0, 1.3e-4, 9.3e-4),
    # With reversed arms.
    ("galerkin", None, 1.0, 3.2e-6, 1.6e-5),
]


@pytest.mark.parametrize(("test_space", "frequency", "amplitude", "displacement", "angle"), FOUND)
def test_errors_of_pod(model, nominal, test_space, frequency, amplitude, displacement, angle):
    maneuver = nominal.perturbed(frequency or 1.0, amplitude)
    settings = {"rank": 3} if frequency else {"reversed_coordinates": "theta_u,theta_l"}
    reduced = fitted(model, maneuver, "pod", "nominal", test_space=test_space, **settings)
    run = reduced.simulate(maneuver, model.starts[0])
    errors = figure_errors(model, run.outputs, model.simulate(maneuver))
    np.testing.assert_array_equal([float(f"{e:.1e}") for e in errors], [displacement, angle])


def by_pymor(snapshots: np.ndarray, rank: int) -> tuple[np.ndarray, np.ndarray]:
    """Projector of the POD modes of the centred snapshots (n, m), and their singular values."""
    centred = snapshots - snapshots.mean(axis=1, keepdims=True)
    array = NumpyVectorSpace(len(snapshots)).from_numpy(centred)
    modes, values, *_ = pod(array, modes=rank, rtol=0.0, atol=0.0)
    return modes.to_numpy() @ modes.to_numpy().T, values


@pytest.mark.parametrize(("rank", "accuracy"), [(1, 1e-12), (2, 1e-10), (3, 1e-7)])
def test_pymor_has_the_same_subspace_in_each_control_period(model, nominal, rank, accuracy):
    # pyMOR's default takes the eigenvalues of a Gramian, which loses half the digits.
    for maneuver in (nominal, two_way_travel()):
        for k, basis in enumerate(fitted(model, maneuver, "pod", rank=rank).bases):
            times = np.linspace(5.0 * k, 5.0 * k + 5.0, 10)
            run = model.simulate(maneuver, times=times)
            projector, _ = by_pymor(run.coordinates.T, rank)
            assert np.abs(basis.vectors @ basis.vectors.T - projector).max() < accuracy
