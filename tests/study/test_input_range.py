"""Methods that judge nothing themselves are trusted in the range of their training's inputs."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vehiclemor.registry import component
from vehiclemor.simulation.build import build
from vehiclemor.study.evaluate import evaluate
from vehiclemor.study.experiment import complete_settings, make_experiment
from vehiclemor.study.input_range import input_range
from vehiclemor.study.scenario import Scenario

MODELS = {
    "independent_suspension_vehicle": "lane_change",
    "high_fidelity_vehicle": "rack_multisine",
}


def scenario(model, frequency=1.0, amplitude=1.0, speed=20.0):
    maneuver = component("maneuver", MODELS[model]).perturbed(frequency, amplitude)
    return Scenario(maneuver, "equilibrium", speed)


@pytest.mark.parametrize("model", MODELS)
@settings(max_examples=20)
@given(frequency=st.floats(0.5, 2.0), amplitude=st.floats(-2.0, 2.0), speed=st.floats(15.0, 25.0))
def test_a_run_is_trusted_exactly_within_the_range(model, frequency, amplitude, speed):
    training = (scenario(model, 1.0, 1.2, 18.0), scenario(model, 1.3, -0.8, 22.0))
    known = input_range(build(model), training)
    found = known.trust(build(model), scenario(model, frequency, amplitude, speed))
    if abs(amplitude) > 1.201 or not 17.99 < speed < 22.01:
        assert found.indicator > 1.0
        assert found.reason
    # Slower and clearly smaller than a training run.
    elif abs(amplitude) <= 1.0 and frequency <= 1.0:
        assert found.indicator <= 1.0


@pytest.mark.parametrize(
    ("method", "amplitude", "status"),
    [
        ("linear_single_track", 1.0, "ok"),
        ("linear_single_track", 1.5, "untrusted"),
        ("full_order", 1.5, "ok"),
        ("replay", 1.5, "ok"),
    ],
)
def test_no_trained_method_is_silent_beyond_its_training(method, amplitude, status):
    model = build("independent_suspension_vehicle")
    tests = (scenario(model.name, 1.0, amplitude),)
    chosen = complete_settings(model, method)
    training = (scenario(model.name, 1.0, 1.1),)
    found = evaluate(make_experiment(model, method, chosen, training, tests, "errors"))
    assert found["status"].item() == status
    if status == "untrusted":
        assert "input delta is beyond its known range" in found["message"].item()
        assert found["trust_indicator"].item() == pytest.approx(amplitude / 1.1, rel=1e-5)
