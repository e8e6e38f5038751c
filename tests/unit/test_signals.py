"""Signals: piecewise polynomials through samples, wherever a maneuver is wanted."""

import tempfile
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline, interp1d

import vehiclemor as vm
from tests.models import CAR
from vehiclemor.exceptions import InputError, VehiclemorError
from vehiclemor.inputs.maneuver import Maneuver

PRESETS = "recommended", "strongest", "paper"
GAPS = st.lists(st.floats(1e-3, 0.5), min_size=1, max_size=30)


def samples(gaps: list[float], columns: int = 1, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Times that begin at zero, and values that stand still for a while."""
    times = np.concatenate([[0.0], np.cumsum(gaps)])
    values = np.random.default_rng(seed).normal(size=(len(times), columns))
    values[1 : len(times) // 2] = values[0]
    return times, values


@settings(max_examples=40)
@given(gaps=GAPS, columns=st.integers(1, 3), seed=st.integers(0, 1000), even=st.booleans())
@pytest.mark.parametrize("hold", ["linear", "zero", "cubic"])
def test_polynomials_are_scipys(hold, gaps, columns, seed, even):
    times, values = samples([0.1] * len(gaps) if even else gaps, columns, seed)
    oracle = {
        "linear": interp1d(times, values, axis=0),
        "zero": interp1d(times, values, "previous", axis=0),
        "cubic": CubicSpline(times, values),
    }[hold]
    signal = vm.Signal.from_samples(times, values, hold)
    places = np.random.default_rng(seed).uniform(0.0, times[-1], 200)
    # Beside a jump both sides are right to rounding.
    places = places[np.abs(places[:, None] - times).min(axis=1) > 1e-9]
    np.testing.assert_allclose(signal.at(places), oracle(places), rtol=1e-9, atol=1e-9)
    # At a jump the value is that after it, however its time was computed.
    rounded = times[:-1] * (1.0 + np.finfo(float).eps * np.array([-1.0, 1.0])[:, None])
    for around in rounded if even else [times[:-1]]:
        np.testing.assert_allclose(signal.at(around), values[:-1], rtol=1e-9, atol=1e-9)


def of_csv(text, **given):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.csv"
        if text is not None:
            path.write_text(text)
        return vm.Signal.from_csv(path, **given)


RACK = "s", "s_dot", "s_ddot"


def of_inputs(values=(0.0, 1.0), **given):
    return vm.Signal.from_samples([0.0, 1.0], values, **given).for_inputs(RACK)


TABLE = "time,delta\n0,1\n1,2\n"
COMMAS = "time;delta\n0,5;90,0\n1,5;180,0\n"
BEYOND = vm.Signal.from_samples([0.0, 1.0], [0.0, 2.0])
SQUARE = vm.Signal.from_samples([0.0, 1.0], np.eye(2))
HUGE = [0.0, 1e-3, 1.0], [-1e308, 1e308, 0.0]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda: vm.Signal.from_samples([0, 2, 1], [0, 0, 0]), r"t\[2\] = 1 s follows 2 s"),
        (lambda: vm.Signal.from_samples([0.0, np.nan], [0.0, 0.0]), r"t\[1\] is not finite"),
        (lambda: vm.Signal.from_samples([0, 1], [0, 1, 2]), r"t has shape \(2,\) and u \(3,\)"),
        (lambda: vm.Signal.from_samples(*HUGE, "cubic"), "polynomials .* are not finite"),
        (lambda: of_inputs(inputs=["s"]), "derivatives of s follow from a cubic hold alone"),
        (of_inputs, "1 columns without names"),
        *[(partial(of_inputs, np.eye(2, 3, -1), inputs=n), "rate s_dot is 0") for n in ((), RACK)],
        (lambda: vm.simulate(CAR, maneuver=BEYOND), r"input delta is 1\.08 rad at t = 0\.54 s"),
        (lambda: of_csv("t,delta\n0,1\n1,2\n"), "no column 'time': set time= to one of t, d"),
        (lambda: of_csv(COMMAS, separator=";"), "'time' holds '0,5', not a number: is decimal=','"),
        (lambda: of_csv(COMMAS), "is separator=';' with decimal=',' meant"),
        (lambda: of_csv("time,delta\n0,1,2\n1,2,3\n"), "no CSV file: .* in line 2"),
        (lambda: of_csv(TABLE, inputs=3), "inputs is 3, not a list of names"),
        (lambda: of_csv(f"{TABLE}2,\n3,1\n"), "log.csv: column 'delta' has no number in row 3"),
        *[(partial(BEYOND.at, t), "list of finite times") for t in (3.0, "t", [np.nan], [1j])],
        *[(partial(SQUARE.for_inputs, n), "not a list of names") for n in (3, [["s"]], np.ones(2))],
        (partial(vm.many_signals, [0, 2], [[0, 1]], output_step=1e-308), "step: 1e-308 s is below"),
    ],
)
def test_bad_samples_are_refused_in_one_line(call, told):
    with pytest.raises(VehiclemorError, match=told):
        call()


@pytest.mark.parametrize("hold", ["linear", "zero", "cubic"])
def test_a_signal_ends_with_its_last_sample(car, hold):
    t = np.linspace(0.0, 10.0, 101)
    signal = vm.Signal.from_samples(t, 0.01 * np.sin(t), hold).perturbed(frequency=2.0)
    np.testing.assert_array_equal(signal.at([5.0 + 1e-12, -1e-12]), signal.at([5.0, 0.0]))
    for time in (-0.1, 5.1, 30.0):
        with pytest.raises(InputError, match=f"lasts from 0 to 5 s: no inputs at {time:g} s"):
            signal.at([1.0, time])
    with pytest.raises(InputError, match="within the run, 0 to 5 s"):
        car.simulate(signal, times=np.array([1.0, 5.1]))


def test_a_log_is_scaled_and_prints_its_file_and_size():
    signal = of_csv(COMMAS, separator=";", decimal=",", unit="deg", ratio=2.0)
    np.testing.assert_allclose(signal.at(np.array([0.0, 1.0]))[:, 0], [np.pi / 4, np.pi / 2])
    assert str(signal) == "signal 'log.csv' (1 s, 2 samples, linear hold; inputs delta)"
    assert str(BEYOND) == "signal (1 s, 2 samples, linear hold; inputs in the model's order)"


def straight(t: np.ndarray) -> np.ndarray:
    """Steering angle (rad) on straight lines: held, turned within 0.4 s, held, turned back."""
    return np.interp(t, [0.0, 1.0, 1.4, 3.0, 3.5, 6.0], [0.0, 0.0, 0.012, 0.012, 0.0, 0.0])


@pytest.fixture(scope="module")
def car():
    return vm.model(CAR)


def test_break_points_are_corners_and_ends_of_quiet():
    t = np.linspace(0.0, 6.0, 601)
    assert vm.Signal.from_samples(t, np.sin(t)).break_points == ()
    corners = vm.Signal.from_samples(t, straight(t)).break_points
    np.testing.assert_allclose(corners, [1.0, 1.4, 3.0, 3.5], atol=1e-12)
    triangle = np.abs((t + 0.5) % 2.0 - 1.0)
    turns = vm.Signal.from_samples(t, triangle, "cubic").break_points
    np.testing.assert_allclose(turns, np.arange(0.5, 6.0, 1.0), atol=1e-12)
    # A pulse without a kink, but after a time in which a step may grow to any length.
    pulse = np.where(t > 4.0, np.clip(t - 4.0, 0.0, 1.0) ** 3, 0.0)
    assert vm.Signal.from_samples(t, pulse).break_points[0] == pytest.approx(4.0)
    noise = np.random.default_rng(0).normal(size=601)
    assert len(vm.Signal.from_samples(t, np.sin(t) + 0.02 * noise).break_points) > 550
    assert vm.Signal.from_samples([0.0, 1.0, 3.0], [0.0, 2.0, 2.0], "zero").break_points == (1.0,)


def test_straight_lines_are_run_as_a_maneuver_of_the_same_lines(car):
    def lines(times, frequency, amplitude):
        return amplitude * straight(frequency * times)[:, None]

    corners = (1.0, 1.4, 3.0, 3.5)
    maneuver = Maneuver("lines", "", lines, ("delta",), 6.0, 301, lambda _: corners)
    wanted = car.simulate(maneuver, "equilibrium", solver="etdrk4", tolerance=1e-4)
    fine = np.linspace(0.0, 6.0, 601)
    uneven = np.unique(np.concatenate([corners, [0.0, 0.31, 0.3100001, 2.2, 6.0]]))
    for t in (fine, uneven):
        signal = vm.Signal.from_samples(t, straight(t))
        found = car.simulate(signal, "equilibrium", solver="etdrk4", tolerance=1e-4)
        assert found.counts == wanted.counts
        # The maneuver's lines are found to 1e-11; step sizes follow what is left.
        np.testing.assert_allclose(found.states, wanted.states, rtol=1e-7, atol=1e-6)
        np.testing.assert_allclose(found.inputs, wanted.inputs, atol=1e-15)


@pytest.mark.parametrize(
    ("name", "duration"),
    [("independent_suspension_vehicle", 300.0), ("high_fidelity_vehicle", 60.0)],
)
def test_a_log_may_be_long_and_noisy(name, duration):
    t = np.arange(0.0, duration + 0.005, 0.01)
    u = 0.002 * np.sin(0.5 * t) + 1e-4 * np.random.default_rng(3).normal(size=len(t))
    full, shipped = vm.model(name), vm.rom(name)
    log = vm.Signal.from_samples(t, u, "cubic", inputs=full.inputs[:1])
    exact = full.simulate(log, outputs=["yaw"])
    for car in (shipped, *(vm.reduce(full, "full_order", preset=p) for p in PRESETS)):
        run = car.simulate(log, outputs=["yaw"])
        assert run.status in ("ok", "untrusted"), run.message
        assert np.abs(run["yaw"] - exact["yaw"]).max() < 0.02


def test_the_run_begins_with_the_first_sample_and_a_car_is_its_own_mirror_image(car):
    t = np.linspace(0.0, 4.0, 129)
    u = 0.01 * np.sin(t) ** 3
    runs = [
        car.simulate(vm.Signal.from_samples(times, values), "equilibrium", solver="etdrk4")
        for times, values in ((t, u), (t, -u), (t + 1024.0, u))
    ]
    np.testing.assert_array_equal(runs[0].states, runs[2].states)
    assert runs[2].times[0] == 0.0
    yaw = car.outputs.index("yaw")
    np.testing.assert_allclose(runs[1].outputs[:, yaw], -runs[0].outputs[:, yaw], atol=1e-9)


@pytest.mark.parametrize("hold", ["linear", "zero", "cubic"])
def test_factors_scale_time_and_values(hold):
    t, u = samples([0.1] * 20 + [0.3] * 7)
    signal = vm.Signal.from_samples(t, u, hold, inputs=["delta"])
    scaled = signal.perturbed(2.0, -3.0)
    wanted = vm.Signal.from_samples(t / 2.0, -3.0 * u, hold)
    assert scaled.duration == pytest.approx(signal.duration / 2.0)
    places = np.linspace(0.0, scaled.duration, 333)
    np.testing.assert_allclose(scaled.at(places), wanted.at(places), atol=1e-12)
    # They are set, and don't pile up.
    assert scaled.perturbed() == signal
    assert scaled.perturbed(2.0, -3.0) is scaled


def test_columns_are_named_and_what_is_not_given_is_zero_or_a_derivative():
    t = np.linspace(0.0, 3.0, 61)
    rack = vm.Signal.from_samples(t, np.sin(t), "cubic", inputs=["s"])
    complete = rack.for_inputs(RACK)
    spline, places = CubicSpline(t, np.sin(t)), np.linspace(0.0, 3.0, 101)
    wanted = np.column_stack([spline(places, order) for order in range(3)])
    np.testing.assert_allclose(complete.at(places), wanted, atol=1e-11)
    # Twice as fast: rates are twice as large.
    faster = complete.perturbed(2.0).at(places / 2.0)
    np.testing.assert_allclose(faster, wanted * [1.0, 2.0, 4.0], atol=1e-10)
    height = vm.Signal.from_samples(t, np.sin(t), inputs=["z"]).for_inputs(("s0", "z"))
    np.testing.assert_allclose(height.at(t)[:, 0], 0.0)
    np.testing.assert_allclose(height.at(t)[:, 1], np.sin(t), atol=1e-14)


def test_a_table_gives_its_signal_back(tmp_path, car):
    t = np.linspace(0.0, 2.0, 101)
    u = np.column_stack([0.01 * np.sin(t), np.cos(t)])
    wanted = vm.Signal.from_samples(t, u[:, 0], inputs="delta")
    table = pd.DataFrame({"time": t, "delta": u[:, 0], "other": u[:, 1]})
    table.to_csv(tmp_path / "log.csv", index=False)
    table.to_csv(tmp_path / "log.txt", sep=";", index=False)
    renamed = {"delta": "steering angle"}
    table.rename(columns=renamed).to_csv(tmp_path / "renamed.csv", index=False)
    labelled = xr.Dataset.from_dataframe(table.set_index("time"))
    found = [
        vm.Signal.from_samples(labelled["time"], labelled["delta"], inputs="delta"),
        vm.Signal.from_csv(tmp_path / "renamed.csv", inputs=renamed),
        # One name may stand alone.
        vm.Signal.from_csv(tmp_path / "log.csv", inputs="delta"),
        vm.Signal.from_csv(tmp_path / "log.txt", separator=";", inputs="delta"),
        vm.Signal.from_function(lambda t: 0.01 * np.sin(t), 2.0, "linear", step=0.02),
    ]
    for signal in found:
        # Text is read to within rounding of values up to one.
        read, written = signal.pieces.coefficients, wanted.pieces.coefficients
        np.testing.assert_allclose(read, written, 1e-12, atol=1e-15)
        np.testing.assert_allclose(car.simulate(signal).inputs, car.simulate(wanted).inputs)
