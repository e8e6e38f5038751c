"""The symbolic Magic Formula against an independent one, and what must hold for any tire."""

import math
from collections.abc import Callable

import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

from tests.oracles.vehicle_data import (
    PARAMETERS,
    cornering_stiffness,
    magic_formula,
    trail_at_rest,
)
from tests.unit.programs import function_of
from vehiclemor.multibody.components import tires
from vehiclemor.multibody.components.tire_coefficients import MAGIC_FORMULA
from vehiclemor.symbolic.tape import Tape

REFERENCE_LOAD = PARAMETERS["FNOMIN"] * PARAMETERS["LFZO"]
RADIUS = PARAMETERS["R0"]

loads = st.floats(50.0, 9000.0)
slips = st.floats(-1.0, 1.0)
angles = st.floats(-1.2, 1.2)


def compiled() -> Callable[[float, float, float], tuple[float, float, float]]:
    """(load, slip ratio, slip angle) -> (Fx, Fy, Mz), of the published coefficients."""
    tape = Tape()
    load, kappa, alpha, cosine = symbols = sp.symbols("load kappa alpha cosine", real=True)
    coefficients = {name: sp.Float(PARAMETERS[name], 17) for name in MAGIC_FORMULA}
    reference, radius = sp.Float(REFERENCE_LOAD, 17), sp.Float(RADIUS, 17)
    forces = tires.magic_formula(tape, coefficients, load, reference, radius, kappa, alpha, cosine)
    results = (forces.longitudinal, forces.lateral, forces.aligning)
    function = function_of(tape, symbols, results, "math")
    return lambda load, kappa, alpha: function(load, kappa, alpha, math.cos(alpha))


tire = compiled()


@given(load=loads, kappa=slips, alpha=angles)
def test_forces_equal_an_independent_magic_formula(load, kappa, alpha):
    expected = [float(f) for f in magic_formula(load, kappa, alpha, PARAMETERS)]
    assert tire(load, kappa, alpha) == pytest.approx(expected, rel=1e-11, abs=1e-9)


@given(kappa=slips, alpha=angles)
def test_an_unloaded_tire_has_no_force(kappa, alpha):
    assert tire(0.0, kappa, alpha) == (0.0, 0.0, 0.0)


@given(load=loads, kappa=slips, alpha=angles)
def test_mirrored_slip_mirrors_lateral_force_and_moment(load, kappa, alpha):
    fx, fy, mz = tire(load, kappa, alpha)
    assert tire(load, kappa, -alpha) == pytest.approx((fx, -fy, -mz), rel=1e-14, abs=1e-12)


@given(load=loads, kappa=slips)
def test_a_tire_that_does_not_slide_sideways_has_a_longitudinal_force_alone(load, kappa):
    fx, fy, mz = tire(load, kappa, 0.0)
    assert (fy, mz) == (0.0, 0.0)
    assert tire(load, -kappa, 0.0)[0] == pytest.approx(-fx, rel=1e-14, abs=1e-12)
    assert fx * kappa >= 0.0


@given(load=loads)
def test_stiffnesses_are_the_slopes_without_slip(load):
    h = 1e-5
    slope = (tire(load, 0.0, h)[1] - tire(load, 0.0, -h)[1]) / (2 * h)
    assert slope == pytest.approx(cornering_stiffness(load, PARAMETERS), rel=1e-6)
    assert slope < 0.0
    moment = (tire(load, 0.0, h)[2] - tire(load, 0.0, -h)[2]) / (2 * h)
    assert moment == pytest.approx(-trail_at_rest(load, PARAMETERS) * slope, rel=1e-6)
    d = load / REFERENCE_LOAD - 1.0
    stiffness = load * (PARAMETERS["PKX1"] + PARAMETERS["PKX2"] * d)
    stiffness *= np.exp(PARAMETERS["PKX3"] * d)
    slope = (tire(load, h, 0.0)[0] - tire(load, -h, 0.0)[0]) / (2 * h)
    assert slope == pytest.approx(stiffness, rel=1e-5)


@given(load=loads, kappa=slips, alpha=angles)
def test_no_force_exceeds_its_peak(load, kappa, alpha):
    fx, fy, _ = tire(load, kappa, alpha)
    d = load / REFERENCE_LOAD - 1.0
    assert abs(fx) <= load * (PARAMETERS["PDX1"] + PARAMETERS["PDX2"] * d) * (1 + 1e-12)
    assert abs(fy) <= load * (PARAMETERS["PDY1"] + PARAMETERS["PDY2"] * d) * (1 + 1e-12)


@given(load=loads, kappa=slips, alpha=angles)
def test_combined_slip_never_adds_force(load, kappa, alpha):
    fx, fy, _ = tire(load, kappa, alpha)
    assert abs(fx) <= abs(tire(load, kappa, 0.0)[0]) * (1 + 1e-12)
    assert abs(fy) <= abs(tire(load, 0.0, alpha)[1]) * (1 + 1e-12)
