"""Numbers of the standards: handling, by `data/handling/metrics.toml`, and ride comfort."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.arguments import quoted, real_array
from vehiclemor.exceptions import InputError
from vehiclemor.files import data_folder
from vehiclemor.handling import open_loop_tests
from vehiclemor.handling.open_loop_tests import Motion
from vehiclemor.inputs.maneuver import registered
from vehiclemor.reduction.reduced_model import ReducedOrderModel
from vehiclemor.registry import choice, names
from vehiclemor.simulation.trajectory import Trajectory
from vehiclemor.toml_files import toml_content

if TYPE_CHECKING:
    import xarray as xr

# Of ride comfort, in Hz: high pass and low pass (Butterworth), transition from acceleration to
# velocity, upward step.
HIGH_PASS, LOW_PASS, TRANSITION, STEP = 0.4, 100.0, 12.5, (2.37, 3.35)
# Resonant quality factors.
BUTTERWORTH, TRANSITION_QUALITY, STEP_QUALITY = 0.5**0.5, 0.63, 0.91
# Hz: frequencies of a response that are printed.
PRINTED = (0.5, 1.0)
# Maneuvers of the rack are those of the steering angle.
RACK = "rack_"
# Maneuver -> its numbers by name.
TESTS: dict[str, Callable[[Motion], Mapping[str, Any]]] = {
    "slow_ramp_steer": open_loop_tests.steady_turn,
    "step_steer": open_loop_tests.step,
    "sine_sweep": open_loop_tests.frequency_response,
    "weave": open_loop_tests.weave,
    "sine_with_dwell": open_loop_tests.sine_with_dwell,
    "straight_braking": open_loop_tests.straight_braking,
    "braking_in_turn": open_loop_tests.braking_in_turn,
    "split_friction": open_loop_tests.split_friction,
    "power_in_turn": open_loop_tests.power_in_turn,
    "bump": open_loop_tests.bump,
}


@cache
def declared() -> dict[str, dict[str, Any]]:
    """Standards of the maneuvers, and of their numbers [unit, definition]."""
    return toml_content(data_folder() / "handling" / "metrics.toml")


def metrics(run: Trajectory, maneuver: str | None = None) -> xr.Dataset:
    """Numbers of the standards of a handling test, of a full or a reduced vehicle.

    What a run does not reach is not a number.

    Parameters
    ----------
    run
        A run of one of these maneuvers, by steering angle or rack.
    maneuver
        Name of the maneuver that the run is of, for an input of another name, such as a log.

    Returns
    -------
    xarray.Dataset
        Numbers by name, each with `units`, `long_name` (its definition) and `standard`; `speed` at
        the start in m/s.  A frequency response is over `frequency` in Hz.

    Raises
    ------
    InputError
        If the run or its input is of no such maneuver, it is of no vehicle, or has not ended.

    Notes
    -----
    Simplified: motion is that of the sprung body's centre of mass along chassis axes (ISO 8855 has
    horizontal ones), steering is the angle of the front wheels, and begins and ends at 5 % of its
    largest value (49 CFR 571.126: 5 degrees of the steering wheel, zero).  The frequency response
    is a fitted difference equation (ISO 7401: Fourier spectra).  ISO numbers follow common
    definitions, since the standards are not public.
    """
    import xarray as xr

    if not isinstance(run, Trajectory):
        raise InputError(f"run is {quoted(run)}, not a run as `simulate` gives it")
    test = test_of(run.maneuver if maneuver is None else maneuver)
    motion, standard = motion_of(run), declared()["standards"][test]
    variables: dict[str, tuple] = {}
    coordinates: dict[str, tuple] = {}
    for name, value in TESTS[test](motion).items():
        unit, definition = declared()["numbers"][test][name]
        attributes = {"units": unit, "long_name": definition, "standard": standard}
        variables[name] = ("frequency" if np.ndim(value) else (), value, attributes)
        if np.ndim(value):
            hertz = {"units": "Hz", "long_name": "frequency of the steering"}
            coordinates["frequency"] = "frequency", open_loop_tests.FREQUENCIES, hertz
    speed = {"units": "m/s", "long_name": "speed at the start"}
    variables["speed"] = (), motion.speed[0], speed
    return xr.Dataset(variables, coordinates, {"maneuver": test})


def test_of(maneuver: str) -> str:
    """The test that a maneuver is; `InputError` if it is none."""
    name = maneuver.removeprefix(RACK) if isinstance(maneuver, str) else maneuver
    if isinstance(name, str) and not name:
        raise InputError(f"the run is of no registered maneuver: name one of {', '.join(TESTS)}")
    return choice("maneuver with numbers", name, TESTS)


def motion_of(run: Trajectory) -> Motion:
    """Motion of a run until it ends or the vehicle stops."""
    n, model = run.samples_to_stop, run.model
    inputs = zip(model.inputs, run.inputs[:n].T, strict=True)
    outputs = zip(run.names or model.outputs, run.outputs[:n].T, strict=True)
    wheelbase = model.definition.wheelbase
    length = np.nan if wheelbase is None else float(wheelbase(model.parameters.values()))
    return Motion(run.times[:n], dict([*inputs, *outputs]), length)


def weighted_rms(times: Any, acceleration: Any) -> float:
    """Frequency-weighted RMS of a vertical acceleration in m/s^2: ride comfort of a seated person.

    Weighting Wk of ISO 2631-1:1997 by its transfer functions (annex A), from 0.4 to 100 Hz: what is
    faster than half the sampling rate is not in it.

    Parameters
    ----------
    times
        Equidistant (n,) in s.
    acceleration
        At these times (n,) in m/s^2.

    Raises
    ------
    InputError
        If there are fewer than two samples, times aren't equidistant, or a value isn't finite.
    """
    try:
        t, a = real_array(times), real_array(acceleration)
    except (TypeError, ValueError):
        raise InputError("times and acceleration must be lists of numbers") from None
    if t.ndim != 1 or a.shape != t.shape or len(t) < 2:
        raise InputError(
            f"times of shape {t.shape} and acceleration of shape {a.shape}: "
            f"both must be (n,) with two samples at least"
        )
    if not (np.isfinite(t).all() and np.isfinite(a).all()):
        raise InputError("times and acceleration must be finite")
    step = (t[-1] - t[0]) / (len(t) - 1)
    if step <= 0.0 or np.abs(np.diff(t) - step).max() > 1e-6 * step:
        raise InputError("times must increase in equal steps")
    # Zeros after the end, so that nothing comes round to the beginning.
    padded = 2 * len(t)
    spectrum = np.fft.rfft(a, padded) * _weighting(np.fft.rfftfreq(padded, step))
    return float(np.sqrt(np.mean(np.fft.irfft(spectrum, padded)[: len(t)] ** 2)))


def _weighting(hertz: np.ndarray) -> np.ndarray:
    """Wk at frequencies (n,) in Hz, with its phase."""
    s = 1j * hertz

    def resonance(corner: float, quality: float) -> np.ndarray:
        return 1.0 + s / (quality * corner) + (s / corner) ** 2

    low, high = STEP
    limits = (s / HIGH_PASS) ** 2 / resonance(HIGH_PASS, BUTTERWORTH)
    limits /= resonance(LOW_PASS, BUTTERWORTH)
    transition = (1.0 + s / TRANSITION) / resonance(TRANSITION, TRANSITION_QUALITY)
    step = (low / high) ** 2 * resonance(low, STEP_QUALITY) / resonance(high, STEP_QUALITY)
    return limits * transition * step


# Full and reduced models side by side.


def maneuvers_of(full: ReducedOrderModel, reduced: Iterable[ReducedOrderModel]) -> list[str]:
    """Registered maneuvers with numbers, whose inputs all models have, in the order of the tests.

    The full model has its optional inputs too.  `InputError` if there are none.
    """
    definition = full.model.definition
    every = (*definition.inputs, *definition.optional_inputs)
    shared = {quantity.name for quantity in every}.intersection(*(r.inputs for r in reduced))
    known = {*names("maneuver")}
    wanted = [name for test in TESTS for name in (test, RACK + test) if name in known]
    fitting = [name for name in wanted if shared.issuperset(registered(name).inputs)]
    if not fitting:
        raise InputError(f"{definition.name} is no vehicle of the tests: {', '.join(TESTS)}")
    return fitting


def handling_rows(
    models: Mapping[str, ReducedOrderModel], maneuvers: Iterable[str], amplitude: float
) -> list[dict[str, Any]]:
    """A row for each number, with a column for each model by its name.

    The first model is the full one: all runs start from its state, and by default all maneuvers are
    taken whose inputs all models have.
    """
    first, *reduced = models.values()
    start, speed = first.model.start(), first.parameters.get("initial_speed", np.nan)
    chosen = list(maneuvers) or maneuvers_of(first, reduced)
    standards = {name: declared()["standards"][test_of(name)] for name in chosen}
    rows: list[dict[str, Any]] = []
    for name, standard in standards.items():
        maneuver = registered(name).perturbed(amplitude=amplitude)
        runs = {key: model.simulate(maneuver, start) for key, model in models.items()}
        remarks = [f"{key}: {run.message}" for key, run in runs.items() if run.message]
        test = "; ".join([f"{name} ({standard}), {speed:.4g} m/s", *remarks])
        values = {key: _values(run) for key, run in runs.items() if run.finished}
        # Names and units, in the order of the first run that has come to its end.
        for number, unit in next(iter(values.values()), [("no numbers", "")]):
            columns = {key: values.get(key, {}).get((number, unit), np.nan) for key in models}
            rows.append({"test": test, "number": number, "unit": unit} | columns)
    return rows


def _values(run: Trajectory) -> dict[tuple[str, str], float]:
    """Name, with its frequency if there is one, and unit of a number -> value."""
    values: dict[tuple[str, str], float] = {}
    for key, number in metrics(run).drop_vars("speed").data_vars.items():
        name, unit = str(key).replace("_", " "), str(number.attrs["units"])
        if not number.dims:
            values[name, unit] = float(number)
            continue
        for hertz in PRINTED:
            at = number.sel(frequency=hertz, method="nearest")
            values[f"{name} at {hertz:g} Hz", unit] = float(at)
    return values
