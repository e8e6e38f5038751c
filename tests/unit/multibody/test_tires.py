"""Symbolic tires against independent ones, and what must hold for any tire."""

import math

import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

from tests.oracles.high_fidelity_data import PARAMETERS as SPECIFIED
from tests.oracles.high_fidelity_data import fiala
from tests.oracles.vehicle_lagrange import PARAMETERS, magic_formula
from tests.unit.programs import function_of
from vehiclemor.multibody.components import tires
from vehiclemor.multibody.quantities import FIALA
from vehiclemor.symbolic.tape import Tape

ALONG, ACROSS, MOST, LEAST, _ = COEFFICIENTS = [
    SPECIFIED[f"tyre.{name}"] for name in ("c_long", "c_alpha", "mu_max", "mu_min", "width")
]
REFERENCE_LOAD = PARAMETERS["FNOMIN"] * PARAMETERS["LFZO"]


def exact(values: dict[str, float]) -> dict[str, sp.Float]:
    return {name: sp.Float(value, 17) for name, value in values.items()}


def compiled(name: str):
    """(load, slip ratio, slip angle or its tangent) -> (Fx, Fy, Mz)."""
    tape = Tape()
    load, kappa, slip, cosine = symbols = sp.symbols("load kappa slip cosine", real=True)
    if name == "fiala":
        own = exact(dict(zip(FIALA, COEFFICIENTS, strict=True)))
        forces = tires.fiala(tape, own, load, kappa, slip)
    else:
        own = exact(PARAMETERS)
        sizes = sp.Float(REFERENCE_LOAD, 17), sp.Float(PARAMETERS["R0"], 17)
        forces = tires.magic_formula(tape, own, load, *sizes, kappa, slip, cosine)
    results = [forces.longitudinal, forces.lateral, forces.aligning]
    function = function_of(tape, symbols, results, "math")
    return lambda load, kappa, slip: np.array(function(load, kappa, slip, math.cos(slip)))


TIRES = {name: compiled(name) for name in ("fiala", "magic formula")}
each = pytest.mark.parametrize("tire", TIRES.values(), ids=TIRES)
loads, slips = st.floats(50.0, 9000.0), st.floats(-1.0, 1.0)


def test_fialas_forces_are_those_of_the_cases(rng):
    size = 10.0 ** rng.uniform(-5.0, 0.7, (4000, 2)) * rng.choice([-1.0, 1.0], (4000, 2))
    size[rng.random((4000, 2)) < 0.05] = 0.0
    cases = np.column_stack([10.0 ** rng.uniform(-1.0, 4.0, 4000), size])
    found = np.array([TIRES["fiala"](*case) for case in cases])
    expected = np.array([fiala(*case, SPECIFIED) for case in cases])
    scale = cases[:, :1] * MOST
    # Near the longitudinal branch and where H vanishes, cancellation leaves some rounding.
    np.testing.assert_allclose(found / scale, expected / scale, rtol=1e-12, atol=1e-14)
    load, kappa, t = cases.T
    grip = load * (MOST - (MOST - LEAST) * np.minimum(1.0, np.hypot(kappa, t)))
    for side in (
        abs(kappa) <= grip / (2 * ALONG),
        ACROSS * abs(t) <= 3 * grip,
        grip > LEAST * load,
    ):
        assert 0.2 < side.mean() < 0.9


@given(load=loads, kappa=slips, alpha=st.floats(-1.2, 1.2))
def test_forces_equal_an_independent_magic_formula(load, kappa, alpha):
    fx, fy, _ = found = TIRES["magic formula"](load, kappa, alpha)
    expected = [float(f) for f in magic_formula(load, kappa, alpha, PARAMETERS)]
    assert found == pytest.approx(expected, rel=1e-11, abs=1e-9)
    # Combined slip never adds force, and none exceeds its peak.
    pure = TIRES["magic formula"](load, kappa, 0.0)[0], TIRES["magic formula"](load, 0.0, alpha)[1]
    d = load / REFERENCE_LOAD - 1.0
    for force, alone, name in ((fx, pure[0], "PDX"), (fy, pure[1], "PDY")):
        peak = load * (PARAMETERS[f"{name}1"] + PARAMETERS[f"{name}2"] * d)
        assert abs(force) <= min(abs(alone), peak) * (1 + 1e-12)


@each
@given(kappa=slips, slip=slips)
def test_an_unloaded_tire_has_no_force(tire, kappa, slip):
    # No load, and no slip in one or both directions: nothing is divided by zero.
    for slipping in ((kappa, slip), (0.0, 0.0), (kappa, 0.0), (0.0, slip)):
        assert not tire(0.0, *slipping).any()


@pytest.mark.parametrize(
    ("radius", "rate", "expected"),
    [
        (0.32, 0.0, 2800.0),
        (0.32, -1.0, 4800.0),
        # However quickly it is pressed, the damper adds at most the spring's force.
        (0.32, -9.0, 5600.0),
        (0.32, 1.0, 800.0),
        # A wheel that rises quickly is not pulled.
        (0.32, 1.5, 0.0),
        (0.33, 0.0, 0.0),
        # In the air there is no damping either.
        (0.4, -5.0, 0.0),
        (0.4, 5.0, 0.0),
    ],
)
def test_a_wheel_pushes_and_never_pulls(radius, rate, expected):
    p = exact({"tire_radius": 0.33, "tire_stiffness": 280e3, "tire_damping": 2000.0})
    tape, (r, r_dot) = Tape(), sp.symbols("r r_dot", real=True)
    load = tires.vertical_load(tape, r, r_dot, p)
    found = function_of(tape, (r, r_dot), [load], "math")(radius, rate)[0]
    assert found == pytest.approx(expected, abs=1e-9)
    assert found == 0.0 or expected
