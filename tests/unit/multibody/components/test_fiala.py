"""Fiala forces and tilted wheels against their definitions by cases, and what must hold for any."""

from collections.abc import Callable

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.unit.programs import function_of
from vehiclemor.multibody.components import tilted_wheel, tires
from vehiclemor.multibody.components.tire_coefficients import FIALA
from vehiclemor.symbolic.geometry import vector
from vehiclemor.symbolic.tape import Tape

ALONG, ACROSS, MOST, LEAST, WIDTH = COEFFICIENTS = (115e3, 117e3, 0.75, 0.2, 0.32)

loads = st.floats(1.0, 9000.0)
slips = st.floats(-3.0, 3.0)


def by_cases(load: float, kappa: float, t: float) -> tuple[float, float, float]:
    """Fx, Fy and Mz as the law is written down."""
    slip = min(1.0, np.hypot(kappa, t))
    grip = (MOST - (MOST - LEAST) * slip) * load
    if abs(kappa) <= grip / (2 * ALONG):
        fx = ALONG * kappa
    else:
        fx = np.sign(kappa) * (grip - grip**2 / (4 * abs(kappa) * ALONG))
    if ACROSS * abs(t) > 3 * grip:
        return fx, -np.sign(t) * grip, 0.0
    if grip == 0.0:
        return fx, 0.0, 0.0
    h = 1 - ACROSS * abs(t) / (3 * grip)
    fy = -np.sign(t) * grip * (1 - h**3)
    return fx, fy, np.sign(t) * grip * WIDTH * (1 - h) * h**3


def friction(kappa: float, t: float) -> float:
    return MOST - (MOST - LEAST) * min(1.0, np.hypot(kappa, t))


def compiled() -> Callable:
    """(load, slip ratio, tangent of the slip angle) -> (Fx, Fy, Mz)."""
    tape, symbols = Tape(), sp.symbols("load kappa t", real=True)
    named = zip(FIALA, COEFFICIENTS, strict=True)
    coefficients = {name: sp.Float(value, 17) for name, value in named}
    forces = tires.fiala(tape, coefficients, *symbols)
    return function_of(
        tape, symbols, [forces.longitudinal, forces.lateral, forces.aligning], "math"
    )


tire = compiled()


def random_slips(rng: np.random.Generator, number: int) -> np.ndarray:
    """Loads and slips of any sign, from creeping to sliding."""
    size = 10.0 ** rng.uniform(-5.0, 0.7, (number, 2)) * rng.choice([-1.0, 1.0], (number, 2))
    size[rng.random((number, 2)) < 0.05] = 0.0
    return np.column_stack([10.0 ** rng.uniform(-1.0, 4.0, number), size])


def test_forces_are_those_of_the_cases(rng):
    cases = random_slips(rng, 4000)
    found = np.array([tire(*case) for case in cases])
    expected = np.array([by_cases(*case) for case in cases])
    scale = cases[:, :1] * MOST
    # Near the longitudinal branch and where H vanishes, cancellation leaves some rounding.
    np.testing.assert_allclose(found / scale, expected / scale, rtol=1e-12, atol=1e-14)
    load, kappa, t = cases.T
    grip = load * np.array([friction(*case[1:]) for case in cases])
    for side in (
        abs(kappa) <= grip / (2 * ALONG),
        ACROSS * abs(t) <= 3 * grip,
        np.hypot(kappa, t) < 1.0,
    ):
        assert 0.2 < side.mean() < 0.9


@settings(max_examples=25)
@given(kappa=slips, t=slips)
def test_an_unloaded_tire_has_no_force(kappa, t):
    # No load, and no slip in one or both directions: nothing is divided by zero.
    for slip in ((kappa, t), (0.0, 0.0), (kappa, 0.0), (0.0, t)):
        assert tire(0.0, *slip) == [0.0, 0.0, 0.0]


@settings(max_examples=25)
@given(load=loads, kappa=slips, t=slips)
def test_forces_are_odd_in_their_own_slip_and_even_in_the_other(load, kappa, t):
    fx, fy, mz = tire(load, kappa, t)
    assert tire(load, kappa, -t) == [fx, -fy, -mz]
    assert tire(load, -kappa, t) == [-fx, fy, mz]


@settings(max_examples=25)
@given(load=st.one_of(loads, st.just(1e-9)), kappa=slips, t=slips)
def test_forces_act_against_the_sliding_and_within_friction(load, kappa, t):
    fx, fy, mz = tire(load, kappa, t)
    grip = friction(kappa, t) * load
    assert fx * kappa >= 0.0
    assert fy * t <= 0.0
    # The trail lies behind the middle of the contact: the moment turns the wheel out of its slip.
    # Where all of it slides, rounding alone is left.
    assert mz * t >= -1e-30 * load
    assert max(abs(fx), abs(fy)) <= grip * (1 + 1e-14)
    # (1 - H) H^3 is largest at H = 3/4.
    assert abs(mz) <= grip * WIDTH * 27 / 256 * (1 + 1e-14)


@settings(max_examples=25)
@given(load=loads)
def test_stiffnesses_are_the_slopes_without_slip(load):
    h = 1e-9 * load / ACROSS
    fx, _, _ = tire(load, h, 0.0)
    _, fy, mz = tire(load, 0.0, h)
    assert fx / h == pytest.approx(ALONG, rel=1e-12)
    assert fy / h == pytest.approx(-ACROSS, rel=1e-8)
    # Pneumatic trail of a parabola's pressure: a third of the contact.
    assert mz / -fy == pytest.approx(WIDTH / 3, rel=1e-7)


two = sp.symbols("a b", real=True)
tape = Tape()
extremes = function_of(tape, two, [tires.maximum(tape, *two), tires.minimum(tape, *two)], "math")


@settings(max_examples=25)
@given(a=st.floats(-1e6, 1e6), b=st.floats(-1e6, 1e6))
def test_maximum_and_minimum_without_a_branch(a, b):
    rounding = 1e-15 * max(abs(a), abs(b)) + 1e-300
    for other in (a, b):
        assert extremes(a, other) == pytest.approx([max(a, other), min(a, other)], abs=rounding)


# Tilted wheels


RADIUS, STIFFNESS, DAMPING, SLOW = 0.33, 280e3, 2000.0, 0.5
WHEEL = {
    "tire_radius": RADIUS,
    "tire_stiffness": STIFFNESS,
    "tire_damping": DAMPING,
    "slip_speed": SLOW,
} | dict(zip(FIALA, COEFFICIENTS, strict=True))
FIELDS = ("arm", "heading", "leftward", "up", "load", "slip_ratio", "tan_slip")


def compiled_wheel() -> Callable:
    """(up, height, axle, velocity, turning, spin) -> contact by name, tire forces, loads."""
    tape, p = Tape(), {name: sp.Float(value, 17) for name, value in WHEEL.items()}
    up, axle, velocity, turning = (vector(sp.symbols(f"{n}x {n}y {n}z", real=True)) for n in "navw")
    height, spin = sp.symbols("height spin", real=True)
    contact = tilted_wheel.tilted_contact(tape, up, height, axle, velocity, turning, spin, p)
    tire = tilted_wheel.tire_on(tape, contact, p)
    results = [getattr(contact, name) for name in FIELDS]
    results += [(tire.longitudinal, tire.lateral, tire.aligning), *contact.loads(tape, tire)]
    function = function_of(
        tape,
        [list(up), height, list(axle), list(velocity), list(turning), spin],
        [[r] if isinstance(r, sp.Expr) else list(r) for r in results],
    )

    def evaluate(*given) -> dict:
        found = [np.squeeze(np.array(value)) for value in function(*given)]
        return dict(zip((*FIELDS, "tire", "force", "moment"), found, strict=True))

    return evaluate


wheel = compiled_wheel()


def unit(a: np.ndarray) -> np.ndarray:
    return a / np.linalg.norm(a)


def random_wheel(rng: np.random.Generator) -> tuple:
    """A wheel with steering and camber of up to 40 degrees on a road that is tilted as well."""
    up = unit(np.array([0.0, 0.0, 1.0]) + rng.uniform(-0.3, 0.3, 3))
    axle = np.array([0.0, 1.0, 0.0]) + rng.uniform(-0.5, 0.5, 3)
    axle = unit(axle)
    height = RADIUS * np.linalg.norm(np.cross(axle, up)) + rng.uniform(-0.04, 0.02)
    velocity = rng.uniform([-20.0, -5.0, -2.0], [20.0, 5.0, 2.0]) * rng.choice([0.02, 1.0])
    return up, height, axle, velocity, rng.uniform(-3.0, 3.0, 3), rng.uniform(-60.0, 60.0)


def rolling_wheel(rng: np.random.Generator) -> tuple:
    """A wheel on the road that slips a little, so that no contact slides as a whole."""
    up, height, axle, _, turning, _ = random_wheel(rng)
    height -= 0.03
    across = np.cross(axle, up)
    velocity = 15.0 * unit(across) + rng.uniform(-0.2, 0.2, 3)
    spin = 15.0 / (height / np.linalg.norm(across))
    return up, height, axle, velocity, 0.1 * turning, spin * rng.uniform(0.99, 1.01)


def test_the_contact_point_lies_on_the_road_and_in_the_wheels_plane(rng):
    for _ in range(100):
        case = random_wheel(rng)
        up, height, axle = case[:3]
        found = wheel(*case)
        arm, heading, leftward = (found[name] for name in ("arm", "heading", "leftward"))
        assert height + arm @ up == pytest.approx(0.0, abs=1e-15)
        assert arm @ axle == pytest.approx(0.0, abs=1e-15)
        camber = np.arcsin(axle @ up)
        assert np.linalg.norm(arm) == pytest.approx(height / np.cos(camber), rel=1e-14)
        # It is the lowest point of a circle of that radius about the axle.
        around = [unit(arm), np.cross(axle, unit(arm))]
        phases = np.linspace(-np.pi, np.pi, 201)
        rim = np.outer(np.cos(phases), around[0]) + np.outer(np.sin(phases), around[1])
        assert np.argmin(rim @ up) == 100
        # Along the wheel, across it in the road, and upwards.
        axes = np.array([heading, leftward, up])
        np.testing.assert_allclose(axes @ axes.T, np.eye(3), rtol=0, atol=1e-14)
        assert np.linalg.det(axes) == pytest.approx(1.0)
        assert heading @ axle == pytest.approx(0.0, abs=1e-15)
        assert leftward @ axle > 0.0
        assert heading[0] > 0.0
        np.testing.assert_array_equal(found["up"], up)


def test_the_damping_follows_the_rate_of_the_loaded_radius(rng):
    """Of a wheel that moves and tilts on: the radius by plain geometry, differentiated."""
    loaded = 0
    for _ in range(300):
        up, height, axle, velocity, turning, _ = case = random_wheel(rng)

        def radius(step, up=up, height=height, axle=axle, velocity=velocity, turning=turning):
            axle = axle + step * np.cross(turning, axle)
            return (height + step * velocity @ up) / np.sqrt(1 - (axle @ up) ** 2)

        step = 1e-30j
        r, r_dot = radius(0.0), radius(step).imag / 1e-30
        elastic = STIFFNESS * max(RADIUS - r, 0.0)
        damping = -DAMPING * r_dot
        expected = elastic + min(elastic, damping) if elastic + damping > 0.0 else 0.0
        found = wheel(*case)["load"]
        assert found >= 0.0
        assert found == pytest.approx(expected, rel=1e-11, abs=1e-9)
        loaded += expected > 0.0
    assert 100 < loaded < 250


def level(height: float, rise: float) -> tuple:
    x, y, z = np.eye(3)
    return z, height, y, 10.0 * x + rise * z, 0 * x, 10.0 / RADIUS


@pytest.mark.parametrize(
    ("height", "rise", "expected"),
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
def test_load_of_an_upright_wheel(height, rise, expected):
    found = wheel(*level(height, rise))
    assert found["load"] == pytest.approx(expected, abs=1e-9)
    if expected == 0.0:
        assert found["load"] == 0.0
        for name in ("tire", "force", "moment"):
            assert not found[name].any(), name


def test_slips_are_those_of_the_carriers_point_at_the_contact(rng):
    slow = 0
    for _ in range(200):
        _, _, _, velocity, turning, spin = case = random_wheel(rng)
        found = wheel(*case)
        sliding = velocity + np.cross(turning, found["arm"])
        forward, lateral = sliding @ found["heading"], sliding @ found["leftward"]
        speed = abs(forward) if abs(forward) > SLOW else SLOW
        slow += abs(forward) < SLOW
        rolling = spin * np.linalg.norm(found["arm"])
        assert found["slip_ratio"] == pytest.approx((rolling - forward) / speed, rel=1e-12)
        assert found["tan_slip"] == pytest.approx(lateral / speed, rel=1e-12)
    assert 30 < slow < 170


def test_an_upright_wheel_that_rolls_ahead_does_not_slip():
    x, y, z = np.eye(3)
    # With the axle to the left, positive spin rolls forward.
    found = wheel(z, 0.32, y, 20.0 * x, 0 * x, 20.0 / 0.32)
    np.testing.assert_allclose(found["arm"], [0.0, 0.0, -0.32], atol=1e-16)
    assert found["slip_ratio"] == pytest.approx(0.0, abs=1e-15)
    assert found["tan_slip"] == 0.0
    found = wheel(z, 0.32, y, 20.0 * x + 0.4 * y, 0 * x, 20.1 / 0.32)
    assert found["slip_ratio"] == pytest.approx(0.005)
    assert found["tan_slip"] == pytest.approx(0.02)
    # Driven forward, pushed to the right, and turned out of the slip (to the left).
    assert found["force"] @ x > 0.0 > found["force"] @ y
    assert found["tire"][2] > 0.0


def test_loads_have_the_power_of_the_tire_forces_at_the_contact(rng):
    for _ in range(50):
        _, _, _, velocity, turning, _ = case = rolling_wheel(rng)
        found = wheel(*case)
        fx, fy, mz = found["tire"]
        assert min(abs(fx), abs(fy), abs(mz), found["load"]) > 1e-3
        at_contact = velocity + np.cross(turning, found["arm"])
        power = fx * at_contact @ found["heading"] + fy * at_contact @ found["leftward"]
        power += found["load"] * at_contact @ found["up"] + mz * turning @ found["up"]
        total = found["force"] @ velocity + found["moment"] @ turning
        assert total == pytest.approx(power, rel=1e-11, abs=1e-9)


def test_tires_are_fialas_at_the_contacts_load_and_slips(rng):
    for k in range(100):
        found = wheel(*(random_wheel, rolling_wheel)[k % 2](rng))
        expected = by_cases(*(float(found[name]) for name in FIELDS[4:]))
        np.testing.assert_allclose(found["tire"], expected, rtol=1e-11, atol=1e-9)
