"""Roads are those of ISO 8608, quick and exact; families of maneuvers; weighted RMS of ISO 2631."""

import pickle
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

import vehiclemor as vm
from vehiclemor.exceptions import InputError, PlugInError
from vehiclemor.inputs import road as roads
from vehiclemor.inputs.checks import check_resolved
from vehiclemor.registry import component
from vehiclemor.study.scenario import Scenario

CONSTANTS = {"A": 16e-6, "B": 64e-6, "C": 256e-6, "D": 1024e-6, "E": 4096e-6}
LENGTH = 500.0


def spectrum(seed):
    """Wave numbers (cycles/m), and the Fourier coefficients of both tracks over their period."""
    x = np.arange(4096) * LENGTH / 4096
    return np.arange(2049) / LENGTH, np.fft.rfft(roads.tracks(seed, x)[0], axis=0) / 2048


@pytest.mark.parametrize("road_class", "ABCDE")
def test_density_of_every_class_is_the_standards_in_every_octave(road_class):
    factor = vm.road(road_class).amplitude_factor
    for seed in (1, 2):
        n, lines = spectrum(seed)
        density = factor**2 * np.abs(lines) ** 2 / 2.0 * LENGTH
        assert not density[(n < 0.011) | (n > 2.831)].max() > 1e-20
        for low in 0.02 * 2.0 ** np.arange(7):
            octave = (n >= low) & (n < 2.0 * low)
            mean = CONSTANTS[road_class] * 0.1**2 / (2.0 * low**2)
            np.testing.assert_allclose(density[octave].mean(axis=0), mean, rtol=0.08)


def test_left_and_right_are_one_in_long_waves_and_two_in_short_ones():
    seeds = range(60)
    n = spectrum(0)[0]
    lines = np.array([spectrum(seed)[1] for seed in seeds])
    cross = (lines[..., 0] * lines[..., 1].conj()).mean(axis=0)
    coherence = (cross / np.maximum(np.abs(lines[0, :, 0]) ** 2, 1e-30)).real
    # x K1(x) at x = 2 pi n 2.07 m (Abramowitz and Stegun, table 9.8).
    for low, high, middle, expected in ((0.011, 0.013, 0.156, 0.969), (0.0719, 0.0819, 1.0, 0.602)):
        assert 2.0 * np.pi * 2.07 * (low + high) / 2.0 == pytest.approx(middle, rel=0.01)
        assert coherence[(n > low) & (n < high)].mean() == pytest.approx(expected, abs=0.09)
    assert np.abs(coherence[(n > 0.6) & (n < 2.8)].mean()) < 0.02


@pytest.mark.parametrize("frequency", [0.5, 1.0, 1.25])
def test_rear_wheels_follow_and_rates_are_derivatives_also_in_the_ramp(frequency):
    road, delay = vm.maneuver("road:5", frequency=frequency), 4.5 / (20.0 * frequency)
    times = np.linspace(0.8, 10.0, 500)
    front, rear = road.at(times - delay), road.at(times)
    late = times - delay > 0.5
    for side in (0, 1, 4, 5):
        scale = np.ptp(front[:, side])
        assert np.abs(rear[late, side + 2] - front[late, side]).max() < 1e-10 * scale
    h, weights = 5e-4, np.array([-1.0, 9.0, -45.0, 0.0, 45.0, -9.0, 1.0]) / 60.0
    for times in (np.linspace(0.01, 0.49, 200), np.linspace(0.51, 9.9, 500)):
        shifted = [w * road.at(times + k * h)[:, :4] for k, w in enumerate(weights, start=-3)]
        rates = road.at(times)[:, 4:]
        assert np.abs(sum(shifted) / h - rates).max() < 2e-6 * np.ptp(rates)
    # Heights and rates set in from rest and without a jump.
    onset = road.at(np.array([0.0, 1e-6, 0.5 - 1e-9, 0.5 + 1e-9]))
    assert not onset[0].any()
    assert np.abs(onset[1]).max() < 1e-8
    assert np.abs(onset[3] - onset[2]).max() < 1e-6
    check_resolved(road)


def test_a_road_is_the_sum_of_its_waves_at_every_time():
    seed, times = 17, np.sort(np.random.default_rng(0).uniform(0.6, 10.0, 300))
    amplitudes = roads.waves(seed)
    n = roads.WAVES / LENGTH
    np.testing.assert_allclose(np.abs(amplitudes[:, 1]), np.sqrt(2 * 256e-6 * 0.1**2 / n**2 / 500))
    angle = np.exp(2j * np.pi * np.outer(20.0 * times, n))
    heights, rates = (
        (angle @ (a * amplitudes)).real for a in (1.0, (2j * np.pi * n * 20.0)[:, None])
    )
    found = vm.maneuver(f"road:{seed}").at(times)
    for direct, columns in ((heights, [0, 1]), (rates, [4, 5])):
        assert np.abs(found[:, columns] - direct).max() < 1e-11 * np.ptp(direct)


def test_speed_amplitude_and_seed():
    times = np.linspace(0.7, 9.0, 200)
    slow, fast = vm.road("C", 3, 10.0), vm.road("E", 3, 20.0)
    assert fast == component("maneuver", "road:3").perturbed(1.0, 4.0)
    heights = 4.0 * slow.at(2.0 * times)[:, :2]
    np.testing.assert_allclose(fast.at(times)[:, :2], heights, rtol=0, atol=1e-13)
    rates = 8.0 * slow.at(2.0 * times)[:, 4:6]
    np.testing.assert_allclose(fast.at(times)[:, 4:6], rates, rtol=0, atol=1e-11)
    same, other = vm.maneuver("road:3").at(times), vm.maneuver("road:4").at(times)
    np.testing.assert_array_equal(same * 4.0, fast.at(times))
    assert np.abs(np.corrcoef(same[:, 4], other[:, 4])[0, 1]) < 0.3
    # The same bits in another process, where nothing was used before.
    code = "import vehiclemor as vm, numpy as np, sys; t = np.linspace(0.7, 9.0, 200)"
    code += "; sys.stdout.write(vm.maneuver('road:3').at(t).tobytes().hex())"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == same.tobytes().hex()
    travel = vm.maneuver("road_travel:3")
    np.testing.assert_array_equal(travel.at(times), np.column_stack([same[:, 0], 0.0 * times]))


# Families


def test_members_have_names_and_are_sent_by_them():
    member = component("maneuver", "road:17")
    assert member.name == "road:17"
    assert component("maneuver", "road:17") is member
    sent = member.perturbed(0.8, 2.0)
    scenario = Scenario.of("road:17", (0.8, 2.0), "equilibrium")
    assert len(pickle.dumps(scenario)) < 300
    # Of two batches it is one, by which a worker finds what it has fitted.
    one, other = (pickle.loads(pickle.dumps(scenario)).maneuver for _ in "12")  # noqa: S301
    assert one == sent
    assert one is other
    assert vm.describe("road:17")["maneuver"] == "road:17"


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: vm.maneuver("raod:3"), "unknown maneuver 'raod'.* road"),
        (lambda: vm.maneuver("road:x"), "unknown maneuver 'road:x'"),
        (lambda: vm.maneuver("sine_travel:3"), "'sine_travel:3'; sine_travel is no family"),
        (lambda: vm.maneuver("road:1000000"), "seed of road is 1000000; .* at most 999999"),
        (lambda: vm.road("F"), "unknown road class 'F'"),
        (lambda: vm.road("C", 1.0), "seed of road is 1.0"),
        (lambda: vm.road("C", 1, 41.0), "speed: 41 m/s is above 40 m/s"),
        (lambda: replace(vm.road(), member=3), "member is not a function"),
        (lambda: vm.weighted_rms([0, 1, 3], [1.0, 2.0, 0.0]), "equal steps"),
        (lambda: vm.weighted_rms([2, 1, 0], [1.0, 2.0, 0.0]), "must increase"),
        (lambda: vm.weighted_rms([0, 1], [1.0, np.nan]), "finite"),
    ],
)
def test_what_is_wrong_is_one_line(call, words):
    with pytest.raises(InputError, match=words):
        call()


@pytest.mark.parametrize("given", [lambda _: vm.maneuver("road"), lambda number: 1 // (number - 2)])
def test_a_family_that_gives_something_else_is_named(monkeypatch, given):
    monkeypatch.setattr(roads, "roads", replace(roads.roads, member=given))
    with pytest.raises(PlugInError, match=r"maneuver 'road:2' \(vehiclemor.inputs.road:roads\)"):
        component("maneuver", "road:2")


# Frequency weighting; ISO 2631-1:1997, table 3


@pytest.mark.parametrize(
    ("hertz", "weight"),
    [(0.5, 0.418), (1.0, 0.482), (4.0, 0.967), (8.0, 1.036), (16.0, 0.768), (31.5, 0.405)],
)
def test_weights_are_those_of_the_standards_table(hertz, weight):
    times = np.arange(100_000) / 500.0
    wave = np.sqrt(2.0) * np.sin(2.0 * np.pi * hertz * times)
    assert vm.weighted_rms(times, wave) == pytest.approx(weight, rel=0.005)
    assert vm.weighted_rms(times + 7.0, -3.0 * wave) == pytest.approx(3.0 * weight, rel=0.005)
    # What begins at the end of a record does not come round to its beginning.
    first, last = np.eye(1, 1000), np.eye(1, 1000, 999)
    early, late = (vm.weighted_rms(times[:1000], pulse[0]) for pulse in (first, last))
    assert late < 0.5 * early
