"""Objectives: values of motions that are known, and how they move with their histories."""

import numpy as np
import pytest
import xarray as xr

import vehiclemor as vm
from tests.oracles.differences import extrapolated
from vehiclemor.errors import InputError
from vehiclemor.study.objectives import OBJECTIVES, overshoot, peak, settling_time, slope

TIME = np.linspace(0.0, 12.0, 601)
# A second-order system after a step: damping ratio, natural frequency in rad/s, gain.
DAMPED = {"damping": 0.3, "rate": 2.5, "gain": -0.4}


def answer(damping, rate, gain):
    """Step response of a damped oscillator."""
    part = np.sqrt(1.0 - damping**2)
    angle = rate * part * TIME
    decay = np.exp(-damping * rate * TIME)
    return gain * (1.0 - decay * (np.cos(angle) + damping / part * np.sin(angle)))


def steady_of(y):
    """Mean of the last tenth."""
    last = 0.9 * TIME[-1]
    return y[last <= TIME].mean()


def test_a_peak_lies_between_samples():
    coarse = np.linspace(0.0, 3.0, 61)
    found = peak(coarse, -1.7 * np.sin(1.3 * coarse + 0.1))
    assert found.value == pytest.approx(1.7, rel=1e-8)
    assert found.remark == ""
    assert peak(coarse, coarse).value == pytest.approx(3.0)


def test_an_oscillator_overshoots_as_its_damping_says():
    y, zeta = answer(**DAMPED), DAMPED["damping"]
    steady = steady_of(y)
    expected = np.exp(-np.pi * zeta / np.sqrt(1.0 - zeta**2))
    assert overshoot(TIME, y).value == pytest.approx(
        (1.0 + expected) * DAMPED["gain"] / steady - 1.0, rel=1e-6
    )
    assert overshoot(TIME, y).value == pytest.approx(expected, rel=1e-3)


def test_it_settles_where_it_is_last_outside():
    y = answer(**DAMPED)
    found, steady = settling_time(TIME, y), steady_of(y)
    later = np.abs(y[found.value < TIME] - steady)
    assert later.max() <= 0.05 * abs(steady)
    before = np.interp(found.value - 1e-3, TIME, np.abs(y - steady))
    assert before > 0.05 * abs(steady)


@pytest.mark.parametrize("measure", [peak, overshoot, settling_time])
@pytest.mark.parametrize("name", list(DAMPED))
def test_derivatives_are_those_of_moved_histories(measure, name):
    def value(part):
        return measure(TIME, answer(**DAMPED | {name: DAMPED[name] * (1.0 + part)})).value

    (weights,) = measure(TIME, answer(**DAMPED)).weights
    moved = extrapolated(lambda part: answer(**DAMPED | {name: DAMPED[name] * (1 + part)}), 1e-3)
    assert weights @ moved == pytest.approx(extrapolated(value, 1e-3), rel=1e-6, abs=1e-8)


def test_a_slope_is_that_of_the_straight_line():
    travel = 0.1 * np.sin(TIME)
    y = 0.3 + 2.0 * travel + 5.0 * travel**2
    found = slope(TIME, y, travel)
    assert found.value == pytest.approx(np.polyfit(travel, y, 1)[0], rel=1e-12)
    for place, history in enumerate((y, travel)):
        change = np.random.default_rng(1).normal(size=len(TIME)) * history

        def value(h, place=place, change=change):
            return slope(TIME, *(a + h * change * (k == place) for k, a in enumerate((y, travel))))

        expected = extrapolated(lambda h, value=value: value(h).value, 1e-3)
        assert found.weights[place] @ change == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ("measure", "history", "words"),
    [
        (peak, np.sin(TIME), "almost equal"),
        (peak, TIME - 1.0, "at an end of the run"),
        (overshoot, 1.0 - np.exp(-TIME), "hardly any overshoot"),
        (settling_time, np.ones_like(TIME), "never leaves the band"),
        (settling_time, np.exp(TIME), "does not settle"),
        (settling_time, np.where(TIME < 4.0, 0.0, 1.0 + 0.04999 * np.sin(TIME)), "almost leaves"),
    ],
)
def test_kinks_and_jumps_are_named(measure, history, words):
    assert words in measure(TIME, history).remark


def test_a_run_that_ends_at_rest_has_no_overshoot():
    with pytest.raises(InputError, match="ends at rest"):
        overshoot(TIME, np.exp(-((TIME - 3.0) ** 2)))
    with pytest.raises(InputError, match="does not travel"):
        slope(TIME, TIME, np.ones_like(TIME))


def runs(values):
    """Dataset of runs (run, time) of a roll angle."""
    output = {"output": ["roll"], "time": TIME, "run": np.arange(len(values))}
    return xr.Dataset({"values": (("run", "time", "output"), values[:, :, None])}, output)


def test_many_runs_have_many_values():
    found = vm.objective("peak_roll")(runs(np.array([np.sin(TIME), 2.0 * np.sin(TIME)])))
    np.testing.assert_allclose(found, [1.0, 2.0], rtol=1e-9)
    failed = np.array([np.where(TIME > 5.0, np.nan, TIME), np.sin(TIME)])
    assert np.isnan(vm.objective("peak_roll")(runs(failed)).values).tolist() == [True, False]


def test_every_objective_says_what_it_is():
    assert vm.objectives().keys() == OBJECTIVES.keys()
    for objective in OBJECTIVES.values():
        assert objective.text
        assert objective.source


@pytest.mark.parametrize(
    ("call", "line"),
    [
        (lambda: vm.objective("peak_rol"), "did you mean peak_roll"),
        (lambda: vm.objective("peak_roll")(3), "result is 3, not a dataset"),
        (lambda: vm.objective("bump_steer")(runs(TIME[None])), "bump_steer needs toe"),
        (lambda: vm.objective("peak_roll").gradient(runs(TIME[None])), "has no derivatives"),
    ],
)
def test_wrong_input_is_one_line(call, line):
    with pytest.raises(InputError) as error:
        call()
    assert line in str(error.value)
    assert "\n" not in str(error.value)
