"""Derivatives of whole runs by parameters, by other runs and by a complex step."""

import numpy as np
import pytest

from tests.oracles import complex_step
from tests.oracles.differences import extrapolated
from vehiclemor.errors import InputError
from vehiclemor.registry import component
from vehiclemor.simulation.build import build, reparametrised
from vehiclemor.simulation.constants import values_of
from vehiclemor.simulation.sensitivities import components, sensitivities

CAR, DETAILED = "independent_suspension_vehicle", "high_fidelity_vehicle"
# Forces along the car cancel to a millionth of what they are made of, drifts are rounding.
CANCELLING = ("Fx_", "slip_ratio_", "position_drift", "velocity_drift")


@pytest.fixture(scope="module")
def car():
    return build(CAR)


def runs_of(model, name, maneuver, start, step):
    """Derivatives (samples, outputs) by differences of whole runs, each of another car."""
    value = components(model, name)[0].value

    def outputs(part):
        changed = reparametrised(model, {name: value * (1.0 + part)})
        return changed.simulate(maneuver, start, tolerance=1e-12).outputs

    return extrapolated(outputs, step) / value


def compared(model, found, expected):
    """Largest differences of each output, relative to its largest derivative."""
    kept = [k for k, name in enumerate(model.outputs) if not name.startswith(CANCELLING)]
    sizes = np.abs(expected).max(axis=0)[kept]
    # What stands still does so for both.
    sizes[sizes < 1e-12] = 1.0
    return (np.abs(found - expected).max(axis=0)[kept] / sizes).max()


@pytest.mark.parametrize(
    ("model", "maneuver", "start", "names"),
    [
        (CAR, "step_steer", "dropped", ["front_damping", "sprung_mass", "drop_height"]),
        (DETAILED, "rack_step_steer", "equilibrium", ["chassis_mass"]),
        ("double_wishbone", "sine_travel", None, ["tie_rod_inner.z", "upper_ball_joint.y"]),
    ],
)
def test_derivatives_are_those_of_other_cars(model, maneuver, start, names):
    model, maneuver = build(model), component("maneuver", maneuver)
    found = sensitivities(model, maneuver, names, start, 1e-10 if start else None)
    assert [own.label for own in found.components] == names
    for k, name in enumerate(names):
        expected = runs_of(model, name, maneuver, start, 2e-2 if start else 2e-3)
        assert compared(model, found.outputs[:, k], expected) < 1e-6


def test_many_parameters_are_as_good_as_one(car):
    # Several directions at once are another kernel, and groups of them overlap.
    maneuver = component("maneuver", "step_steer")
    names = ["front_stiffness", "rear_stiffness", "sprung_height", "front_track", "PKY1"]
    together = sensitivities(car, maneuver, names)
    for k in (0, 3, 4):
        alone = sensitivities(car, maneuver, names[k])
        assert compared(car, together.outputs[:, k], alone.outputs[:, 0]) < 1e-6


def test_a_moved_start_moves_the_run(car):
    # Straight ahead the car is where its speed takes it; of a start that is a state nothing moves.
    maneuver = component("maneuver", "straight_ahead")
    place, speed = car.outputs.index("longitudinal_position"), car.coordinates.index("X")
    moved = sensitivities(car, maneuver, "initial_speed")
    np.testing.assert_allclose(moved.outputs[:, 0, place], moved.trajectory.time, atol=2e-5)
    held = sensitivities(car, maneuver, "initial_speed", car.start())
    assert np.abs(held.states[:, 0, speed]).max() == 0.0


def test_derivatives_are_those_of_a_complex_step(car):
    # Every statement of the model over complex numbers, steps of the classical Runge-Kutta method.
    states, steps, h = car.start("dropped"), 40, 5e-4
    sources = car.equations.sources
    flat = car.parameters.flat().astype(complex)
    (own,) = components(car, "front_damping")
    flat[own.number] += 1j * complex_step.TINY
    constants, work = np.zeros(len(car.constants), complex), np.zeros(4096, complex)
    complex_step.kernel_function(sources["constants"].text)(flat, work, constants)
    kernel = complex_step.kernel_function(sources["derivative"].text)

    def rates(x):
        result = np.zeros(len(x), complex)
        kernel(x, np.zeros(1), constants, work, result)
        return result

    x = states.astype(complex)
    for _ in range(steps):
        a = rates(x)
        b = rates(x + 0.5 * h * a)
        c = rates(x + 0.5 * h * b)
        x = x + h / 6.0 * (a + 2.0 * b + 2.0 * c + rates(x + h * c))
    expected = x.imag / complex_step.TINY
    maneuver = component("maneuver", "straight_ahead")
    found = sensitivities(car, maneuver, "front_damping", states, 1e-12)
    assert found.trajectory.time[1] == pytest.approx(steps * h)
    np.testing.assert_allclose(found.states[1, 0], expected, atol=1e-6 * np.abs(expected).max())


def test_tighter_tolerances_tighten_derivatives(car):
    maneuver = component("maneuver", "step_steer")
    best = sensitivities(car, maneuver, "front_damping", "dropped", 1e-12).outputs[:, 0]
    errors = [
        compared(
            car, sensitivities(car, maneuver, "front_damping", "dropped", t).outputs[:, 0], best
        )
        for t in (1e-4, 1e-6, 1e-8)
    ]
    assert errors[0] > 10.0 * errors[1] > 100.0 * errors[2]


def test_components_of_points_have_names():
    model = build("double_wishbone")
    found = components(model, ["tie_rod_inner", "wheel_centre.y", "tie_rod_inner.z"])
    labels = [f"tie_rod_inner.{axis}" for axis in "xyz"]
    assert [own.label for own in found] == [*labels, "wheel_centre.y"]
    values = values_of(model.definition, model.parameters.flat())
    assert [own.value for own in found[:3]] == values["tie_rod_inner"].tolist()
    assert {own.unit for own in found} == {"m"}


@pytest.mark.parametrize(
    ("names", "line"),
    [
        ("front_stifness", "did you mean front_stiffness"),
        (["sprung_mass", "sprung_mass.z"], "sprung_mass is a number"),
        ([], "parameters are none"),
        (3, "parameters is 3, no list of names"),
        ([3], "no list of names"),
    ],
)
def test_wrong_names_are_one_line(car, names, line):
    with pytest.raises(InputError) as error:
        sensitivities(car, component("maneuver", "step_steer"), names)
    assert line in str(error.value)
    assert "\n" not in str(error.value)
