"""Symbolic tires against independent ones, and what must hold for any tire."""

import math

import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

from tests.oracles.high_fidelity_data import PARAMETERS as SPECIFIED
from tests.oracles.high_fidelity_data import brush, fiala
from tests.oracles.vehicle_lagrange import PARAMETERS, magic_formula, magic_formula_on
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
    """(load, slip ratio, slip angle or its tangent, friction) -> (Fx, Fy, Mz)."""
    tape, names = Tape(), "load kappa slip cosine friction"
    load, kappa, slip, cosine, friction = symbols = sp.symbols(names, real=True)
    if name != "magic formula":
        own = exact(dict(zip(FIALA, COEFFICIENTS, strict=True)))
        arguments = (friction,) if name == "brush" else ()
        forces = getattr(tires, name)(tape, own, load, tires.Slip(kappa, slip), *arguments)
    else:
        own = exact(PARAMETERS | {"tire_radius": PARAMETERS["R0"]})
        reference = sp.Float(REFERENCE_LOAD, 17)
        forces = tires.magic_formula(tape, own, load, reference, kappa, slip, cosine, friction)
    results = [forces.longitudinal, forces.lateral, forces.aligning]
    function = function_of(tape, symbols, results, "math")

    def forces_at(load: float, kappa: float, slip: float, friction: float = 1.0) -> np.ndarray:
        return np.array(function(load, kappa, slip, math.cos(slip), friction))

    return forces_at


TIRES = {name: compiled(name) for name in ("fiala", "brush", "magic formula")}
# Tires that bear slip in both directions.
combined = pytest.mark.parametrize("name", ["brush", "magic formula"])
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


@given(load=loads, kappa=slips, slip=st.floats(-1.2, 1.2), friction=st.floats(0.05, 1.5))
def test_friction_acts_on_independent_tires_alike(load, kappa, slip, friction):
    for name, expected in (
        ("brush", brush(friction, load, kappa, slip, SPECIFIED)),
        ("magic formula", magic_formula_on(friction, load, kappa, slip, PARAMETERS)),
    ):
        found = TIRES[name](load, kappa, slip, friction)
        assert found == pytest.approx([float(f) for f in expected], rel=1e-9, abs=1e-8)


@given(load=loads, slip=st.floats(-3.0, 3.0))
def test_without_longitudinal_slip_the_brush_is_fialas_tire(load, slip):
    assert TIRES["brush"](load, 0.0, slip) == pytest.approx(TIRES["fiala"](load, 0.0, slip))


@combined
@pytest.mark.parametrize("friction", [0.3, 0.6, 1.0])
def test_combined_slip_takes_energy_and_uses_the_friction_once(name, friction):
    """Of the friction ellipse the published weights of the Magic Formula use 1.07 at most."""
    for load in (1500.0, 4000.0, 6000.0):
        d = load / REFERENCE_LOAD - 1.0
        peaks = [PARAMETERS[f"{k}1"] + PARAMETERS[f"{k}2"] * d for k in ("PDX", "PDY")]
        peaks, most = ([MOST, MOST], 1.0 + 1e-12) if name == "brush" else (peaks, 1.08)
        for kappa in np.linspace(-1.0, 3.0, 41):
            for angle in np.radians(np.linspace(-60.0, 60.0, 41)):
                slip = angle if name == "magic formula" else math.tan(angle)
                fx, fy, _ = TIRES[name](load, kappa, slip, friction)
                # Sliding is by -kappa forwards and tan(alpha) to the left, per speed.
                assert fy * math.tan(angle) - fx * kappa <= 1e-9
                used = math.hypot(fx / peaks[0], fy / peaks[1]) / (friction * load)
                assert used < most


@combined
@pytest.mark.parametrize(("friction", "degrees"), [(0.3, 7.2), (0.6, 6.0), (1.0, 6.0)])
def test_a_locked_wheel_is_dragged_against_its_sliding(name, friction, degrees):
    """Sliding up to 45 degrees aside; with little friction similarity turns the force further."""
    for angle in np.radians(np.linspace(-45.0, 45.0, 91)):
        slip = angle if name == "magic formula" else math.tan(angle)
        fx, fy, _ = TIRES[name](4000.0, -1.0, slip, friction)
        assert abs(math.degrees(math.atan2(-fy, -fx) - angle)) < degrees


@pytest.mark.parametrize(
    ("radius", "rate", "expected"),
    [
        (0.32, 0.0, 2800.0),
        (0.32, -1.0, 4800.0),
        # However quickly it is pressed, the damper adds at most the spring's force.
        (0.32, -9.0, 5600.0),
        # A wheel that rises quickly is not pulled.
        (0.32, 1.5, 0.0),
        # In the air there is no damping either.
        (0.4, -5.0, 0.0),
    ],
)
def test_a_wheel_pushes_and_never_pulls(radius, rate, expected):
    p = exact({"tire_radius": 0.33, "tire_stiffness": 280e3, "tire_damping": 2000.0})
    tape, (r, r_dot) = Tape(), sp.symbols("r r_dot", real=True)
    load = tires.vertical_load(tape, r, r_dot, p)
    found = function_of(tape, (r, r_dot), [load], "math")(radius, rate)[0]
    assert found == pytest.approx(expected, abs=1e-9)
    assert found == 0.0 or expected
