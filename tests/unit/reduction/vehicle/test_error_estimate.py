"""Errors of a vehicle's run estimated from the residual of the full equations."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from vehiclemor.metrics import max_abs, rms
from vehiclemor.reduction.vehicle.error_estimate import estimated_errors
from vehiclemor.registry import component
from vehiclemor.simulation.build import build

MANEUVERS = {
    "independent_suspension_vehicle": "sine_sweep",
    "high_fidelity_vehicle": "rack_sine_sweep",
}
CHANGED = {
    "independent_suspension_vehicle": "whole_car_yaw_inertia",
    "high_fidelity_vehicle": "cornering_stiffness",
}
OUTPUTS = ("lateral_position", "yaw", "lateral_speed", "yaw_rate")


@cache
def runs(name, amplitude):
    """A vehicle, its run, and the run of one with another yaw inertia or tire."""
    maneuver = component("maneuver", MANEUVERS[name]).perturbed(1.0, amplitude)
    model = build(name)
    other = build(name, overrides={CHANGED[name]: 1.02 * model.parameters[CHANGED[name]]})
    wrong = other.simulate(maneuver, model.start())
    states, inputs = wrong.states, wrong.inputs
    return model, model.simulate(maneuver), replace(wrong, outputs=model.outputs_at(states, inputs))


@pytest.mark.parametrize("name", MANEUVERS)
@pytest.mark.parametrize("amplitude", [0.1, 1.0])
def test_the_error_of_a_slightly_wrong_model_is_found(name, amplitude):
    model, true, wrong = runs(name, amplitude)
    found = estimated_errors(model, wrong, 200)
    error = wrong.outputs - true.outputs
    for output in OUTPUTS:
        i = model.outputs.index(output)
        assert found.rms[i] == pytest.approx(rms(error)[i], rel=0.1), output
        assert found.largest[i] == pytest.approx(max_abs(error)[i], rel=0.4), output


@pytest.mark.parametrize("name", MANEUVERS)
def test_a_true_run_has_hardly_an_error(name):
    model, true, wrong = runs(name, 1.0)
    found, other = estimated_errors(model, true, 200), estimated_errors(model, wrong, 200)
    chosen = [model.outputs.index(output) for output in OUTPUTS]
    assert np.all(found.rms[chosen] < 0.1 * other.rms[chosen])
