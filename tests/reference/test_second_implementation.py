"""Errors that a separate implementation of the same specification found, to two digits."""

import numpy as np
import pytest

from tests.reducing import figure_errors, fitted
from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.simulation.algebraic import AlgebraicModel

# Test space, frequency and amplitude factor, RMS of spindle y (m) and second Euler angle (rad);
# three coordinates, bases of the unperturbed run.
FOUND = [
    ("galerkin", 1.0, 1.0, 6.0e-7, 2.9e-6),
    ("galerkin", 1.0, 1.2, 9.4e-6, 2.7e-5),
    ("galerkin", 1.2, 1.0, 1.5e-4, 3.6e-4),
    ("galerkin", 2.0, 1.0, 2.6e-4, 8.5e-4),
    ("least_squares", 1.0, 1.0, 4.9e-7, 3.9e-6),
    ("least_squares", 1.0, 1.2, 4.2e-6, 3.7e-5),
    ("least_squares", 1.2, 1.0, 5.3e-5, 4.1e-4),
    ("least_squares", 2.0, 1.0, 1.3e-4, 9.3e-4),
]


@pytest.mark.parametrize(("test_space", "frequency", "amplitude", "displacement", "angle"), FOUND)
def test_errors_of_three_coordinates(
    model: AlgebraicModel,
    nominal: Maneuver,
    test_space: str,
    frequency: float,
    amplitude: float,
    displacement: float,
    angle: float,
) -> None:
    maneuver = nominal.perturbed(frequency, amplitude)
    reduced = fitted(model, maneuver, "pod", "nominal", rank=3, test_space=test_space)
    run = reduced.simulate(maneuver, model.starts[0])
    errors = figure_errors(model, run.outputs, model.simulate(maneuver))
    np.testing.assert_array_equal([float(f"{e:.1e}") for e in errors], [displacement, angle])


def test_reversed_arms_change_the_errors_of_galerkin(
    model: AlgebraicModel, nominal: Maneuver
) -> None:
    reduced = fitted(
        model, nominal, "pod", test_space="galerkin", reversed_coordinates="theta_u,theta_l"
    )
    run = reduced.simulate(nominal, model.starts[0])
    errors = figure_errors(model, run.outputs, model.simulate(nominal))
    np.testing.assert_array_equal([float(f"{e:.1e}") for e in errors], [3.2e-6, 1.6e-5])
