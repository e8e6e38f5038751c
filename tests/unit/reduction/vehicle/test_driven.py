"""Reduced vehicles that are driven and braked on roads of different friction."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

import vehiclemor as vm
from tests.oracles.high_fidelity_data import brush
from vehiclemor.multibody.quantities import FIALA
from vehiclemor.reduction.vehicle.axle_forces import add_fiala
from vehiclemor.reduction.vehicle.shape import KNOWN, SLIP_OUTPUTS, VehicleInputs, no_vehicle
from vehiclemor.reduction.vehicle.slow_features import SlowFeatures
from vehiclemor.simulation.build import build
from vehiclemor.study.scenario import Scenario

CARS = {"independent_suspension_vehicle": "", "high_fidelity_vehicle": "rack_"}
# Speeds in m/s and, at each, an amplitude factor that uses some 0.6 of the friction.
SPEEDS, AMPLITUDES = (11.0, 14.0, 18.0, 23.0, 28.0), (1.6, 1.2, 0.8, 0.6, 0.4)
TIMES = np.linspace(0.0, 5.0, 251)


@cache
def reduced(name):
    family = f"{CARS[name]}random_drive"
    cases = zip(range(25), 5 * AMPLITUDES, 5 * SPEEDS, strict=True)
    training = [Scenario.of(f"{family}:{k}", (1.0, a), "equilibrium", v) for k, a, v in cases]
    return vm.reduce(name, "slow_manifold", training=training, steps=2, tolerance=1e-5)


@pytest.fixture(params=CARS)
def rom(request):
    return reduced(request.param)


def signal(rom, **inputs):
    """A signal of inputs by name, values or functions of the time."""
    values = [u(TIMES) if callable(u) else np.full(len(TIMES), u) for u in inputs.values()]
    return vm.Signal.from_samples(TIMES, np.stack(values, axis=1), "linear", inputs=[*inputs])


def rise(size, begin=1.0, length=0.5):
    def values(times):
        part = np.clip((times - begin) / length, 0.0, 1.0)
        return size * part**3 * (10.0 - 15.0 * part + 6.0 * part**2)

    return values


def simulated(rom, maneuver, speed):
    """Outputs by name of the reduced and of the full run."""
    start = build(rom.model.name, overrides={"initial_speed": speed}).start()
    runs = rom.simulate(maneuver, start), rom.model.simulate(maneuver, start)
    return [dict(zip(rom.output_names, run.outputs.T, strict=True)) for run in runs]


def test_speed_is_constant_without_torque_on_any_road(rom):
    for speed, friction in ((13.0, 0.5), (27.0, 0.8)):
        frictions = {f"friction_{wheel}": friction for wheel in ("FL", "FR", "RL", "RR")}
        run, _ = simulated(rom, signal(rom, **frictions), speed)
        assert np.ptp(run["longitudinal_speed"][1:]) < 1e-9
        np.testing.assert_allclose(run["longitudinal_speed"], speed, rtol=0, atol=0.01)
        np.testing.assert_allclose(run["lateral_position"], 0.0, atol=1e-9)


def test_straight_braking_keeps_the_distance(rom):
    brakes = {f"brake_torque_{w}": rise(200.0) for w in ("FL", "FR")}
    brakes |= {f"brake_torque_{w}": rise(100.0) for w in ("RL", "RR")}
    run, full = simulated(rom, signal(rom, **brakes), 25.0)
    assert full["longitudinal_speed"][-1] < 22.0
    error = run["longitudinal_position"] - full["longitudinal_position"]
    assert np.abs(error).max() < 0.05


def test_the_mirror_image_of_a_driven_run_is_one(rom):
    """Left and right change places, steering its sign."""
    steering, size = rom.inputs[0], 0.02 if rom.inputs[0] == "delta" else 0.003
    sides = {"brake_torque_F": (150.0, 60.0), "drive_torque_R": (0.0, 120.0)}
    runs = []
    for sign in (1, -1):
        torques = {
            f"{kind}{side}": rise(torque)
            for kind, pair in sides.items()
            for side, torque in zip("LR"[::sign], pair, strict=True)
        }
        inputs = {steering: rise(sign * size)(TIMES)}
        if f"{steering}_dot" in rom.inputs:
            rate = np.gradient(inputs[steering], TIMES)
            inputs |= {f"{steering}_dot": rate, f"{steering}_ddot": np.gradient(rate, TIMES)}
        runs.append(simulated(rom, signal(rom, **inputs, **torques), 20.0)[0])
    one, other = runs
    assert np.abs(one["lateral_position"]).max() > 1.0
    for name in ("lateral_position", "yaw", "roll", "lateral_speed"):
        np.testing.assert_allclose(one[name], -other[name], rtol=0, atol=1e-9)
    for name in ("longitudinal_position", "pitch", "longitudinal_speed"):
        np.testing.assert_allclose(one[name], other[name], rtol=0, atol=1e-9)


def test_torques_of_one_side_turn_the_vehicle(rom):
    """No training run has them: what they do is that of the linearised vehicle."""
    torques = {"drive_torque_RR": rise(60.0), "brake_torque_RL": rise(60.0)}
    run, full = simulated(rom, signal(rom, **torques), 20.0)
    assert np.abs(full["yaw"]).max() > 0.01
    assert np.abs(run["yaw"] - full["yaw"]).max() < 0.05 * np.abs(full["yaw"]).max()


def test_random_driving_is_near_that_of_the_vehicle(rom):
    for seed, amplitude, speed in ((100, 0.6, 21.0), (103, 1.0, 15.0)):
        family = f"{CARS[rom.model.name]}random_drive"
        case = Scenario.of(f"{family}:{seed}", (1.0, amplitude), "equilibrium", speed)
        run, full = simulated(rom, case.maneuver, speed)
        assert np.ptp(full["longitudinal_speed"]) > 1.0
        for name in ("longitudinal_position", "lateral_position"):
            assert np.abs(run[name] - full[name]).max() < 0.3


def test_a_vehicle_that_is_not_steered_is_refused():
    cart = SimpleNamespace(name="cart", planar="xyz", outputs=SLIP_OUTPUTS, inputs=KNOWN)
    assert no_vehicle(cart) == "the inputs of cart are not a steering and its derivatives"


def test_the_tire_is_the_brush_of_the_vehicle():
    values = build("high_fidelity_vehicle").parameters
    parameters = {name: float(values[name]) for name in FIALA}
    short = ("c_long", "c_alpha", "mu_max", "mu_min", "width")
    of_oracle = {f"tyre.{key}": parameters[name] for key, name in zip(short, FIALA, strict=True)}
    made = SlowFeatures(3, 0, VehicleInputs(("friction_FL",)))
    tire = parameters | {"static_load": 1e3}
    force, moment, _ = add_fiala(made, tire, "FL", *made.z[:3])
    made.line("force", 1000.0 * force)
    made.line("moment", 1000.0 * parameters["tire_width"] * moment)
    random = np.random.default_rng(5)
    tan, kappa = random.uniform(-0.03, 0.03, 50), random.uniform(-0.015, 0.015, 50)
    load, grip = random.uniform(2000.0, 6000.0, 50), random.uniform(0.7, 1.0, 50)
    truth = np.array([brush(*row, of_oracle) for row in zip(grip, load, kappa, tan, strict=True)])
    z = np.column_stack([tan, load, truth[:, 0], np.zeros(50)])
    columns = made.columns([("force",), ("moment",)], z, grip[:, None])
    for found, given in zip(columns.T, truth[:, 1:].T, strict=True):
        np.testing.assert_allclose(found, given, rtol=0, atol=0.03 * np.abs(given).max())
