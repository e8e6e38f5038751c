"""The kernel of whole steps does what the formulas of its method say."""

import numpy as np
import pytest

from tests.models import VEHICLES
from vehiclemor.codegen.kernels import Kernels
from vehiclemor.reduction.vehicle.features import FeatureListing, feature_system
from vehiclemor.simulation.build import build
from vehiclemor.simulation.integrators import catalogue, etdrk4
from vehiclemor.simulation.integrators.etdrk4 import phi_functions
from vehiclemor.simulation.integrators.step_kernels import exponential_step
from vehiclemor.simulation.system import System

# With pairs that turn with the heading and without; in the mirror image's two blocks.
PLACE = 60
H = catalogue.STEP_SIZES[PLACE]


def reduced_vehicle() -> System:
    """A damped oscillator and a decay, pushed by the inputs and by cubic terms; heading, place."""
    listing = FeatureListing(3, 1)
    z, alone = listing.z, [(value,) for value in (*listing.z, *listing.u)]
    products = ((z[0] * z[0] - z[2], z[1]), tuple(z), (listing.number(1.0),))
    features = listing.features([*alone, *products])
    c = np.zeros((7, 6))
    c[:2, :2] = [[-1.0, -4.0], [4.0, -1.0]]
    c[2, 2] = -9.0
    c[4:6, 3:] = [[1.0, 0.5, -0.4], [1.0, 0.3, 0.7]]
    c[3, 0], c[4, 0], c[5, 1], c[5, 2] = 0.6, 0.9, -0.8, 0.7
    return feature_system(features, np.zeros(0), c, np.ones(6), np.zeros(3), np.zeros(1))


def in_frame(system: System, y: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """A function of the frozen Jacobian as it is at the heading of a state."""
    turn = np.eye(len(y))
    if len(system.rotating):
        cosine, sine = np.cos(y[system.rotating[0]]), np.sin(y[system.rotating[0]])
        for pair in system.rotating[1:].reshape(-1, 2):
            turn[np.ix_(pair, pair)] = [[cosine, -sine], [sine, cosine]]
    return turn @ matrix @ turn.T


def dense_step(system: System, rhs, y, u, y_past, f_past, stretch, weights):
    """New state, rates there and error of `etdrk4` in dense matrices."""
    jacobian = in_frame(system, y, stretch * system.frozen_jacobian)
    _, half_1, half_2, _ = phi_functions(0.5 * H * jacobian)
    _, one, two, three = phi_functions(H * jacobian)
    f, last, d = rhs(y, u[0]), 4.0 * three - two, []

    def rest(v, inputs):
        d.append(rhs(y + v, inputs) - f - jacobian @ v)

    rest(0.5 * H * half_1 @ f, u[1])
    rest(0.5 * H * half_1 @ f + H * half_2 @ d[0], u[1])
    rest(H * one @ f + 2.0 * H * two @ d[1], u[2])
    v = H * (one @ f + (2.0 * two - 4.0 * three) @ (d[0] + d[1]) + last @ d[2])
    rest(v, u[2])
    before = (f - f_past) - jacobian @ (y - y_past)
    change = weights[0] * before + weights[1] * 0.5 * (d[0] + d[1]) + weights[2] * d[3]
    error = H * last @ (etdrk4.ERROR_SHARE * (d[3] - d[2]) + change)
    half, whole = 0.5 * half_1 @ f, one @ f
    middle = weights[3] * (half - 0.5 * whole + 0.125 * H * jacobian @ whole)
    return y + v, rhs(y + v, u[2]), abs(error) + abs(middle)


@pytest.mark.parametrize("name", [*VEHICLES, "reduced"])
def test_a_step_as_one_kernel_is_the_step_of_the_formulas(name):
    if name == "reduced":
        system, start, blocks = reduced_vehicle(), np.array([0.1, -0.2, 0.05, 0.0, 0.0, 0.0]), 1
    else:
        model, blocks = build(name), 2
        system, start = model.system, model.start()
    assert len(system.frame.blocks) == blocks
    rng, n = np.random.default_rng(1), len(start)
    y, y_past = start + 1e-3 * rng.normal(size=(2, n))
    if len(system.rotating):
        y[system.rotating[0]] = 0.7
    u = 1e-3 * rng.normal(size=(4, system.inputs))

    def rhs(x, inputs):
        return system.values_at("derivative", x[None], inputs[None], n)[0]

    f, stretch = rhs(y, u[0]), 1.1
    weights, f_past = [0.3, -4.0, 1.7, 0.9 * H], rhs(y_past, u[0])
    given = [y, f, y_past, f_past, [H, stretch], weights, u[1:3].ravel()]
    wanted = dense_step(system, rhs, y, u, y_past, f_past, stretch, weights)
    # The functions of a step that is stretched so are those of the nearest in the grid.
    diagonal = system.frame.diagonal(system.frozen_jacobian)
    tables = [etdrk4.exponential_tables(block, [stretch * H]) for block in diagonal]
    operators = system.frame.packed(tables).ravel()
    kernel = exponential_step(system.frame, system.inputs)
    # Behind the results there is room for what it works in.
    result = np.zeros((40, -(-n // 4) * 4))
    addresses = np.array(system.called("full", "etdrk4").bundle.kernels).view(float)
    kernels = Kernels([kernel])
    kernels.call(
        kernel.name, np.concatenate(given), operators, system.constants, result.ravel(), addresses
    )
    for found, exact in zip(result, wanted, strict=False):
        np.testing.assert_allclose(found[:n], exact, rtol=1e-8, atol=1e-9 * abs(exact).max())
