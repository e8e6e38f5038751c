"""Wrong input from Python: one clear line that names it, never a traceback, never nonsense."""

import datetime
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import vehiclemor as vm
from tests.models import CAR, FIDELITY, WISHBONE
from tests.refusing import refused
from vehiclemor.inputs.maneuver import Maneuver

STEER = vm.Signal.from_samples([0.0, 0.1, 0.2], [0.0, 0.01, 0.0], inputs=["delta"])
TRUCK, LIMITS = "flexible_truck", (2**63, 5e-324, 0.0, np.nan, "1")
MASKED = np.ma.array([1.0, 2.0], mask=[True, False])
DATE = datetime.date(2020, 1, 1)
NONE = (None, set(), range(0))
WRONG = ([1], {"a": 1}, [[1.0]], np.ones(3), np.zeros(0), np.ones((3, 3)), 10**400)
# What only looks like a number.
NO_NUMBERS = ("1", b"1", 1j, np.complex128(1), np.True_, np.ma.masked, DATE, [[1.0]], 10**400)
NO_PATHS = (None, 3, "", "a\nb", ["paper"], *WRONG)
NO_JOBS = ("2", 0, 1.5, True, 10**39, np.timedelta64(3, "s"), *WRONG)
NO_FLAGS = (1, "yes", np.nan, *NONE, *WRONG)


class NoText:
    """An object that can't be printed as a text."""

    def __str__(self):
        raise ValueError


@cache
def car():
    return vm.model(CAR)


def simulated(name):
    """A call of `simulate` with one argument."""
    return lambda value: vm.simulate(**{"model": WISHBONE, "method": "pod", name: value})


def trained(points):
    return vm.simulate(WISHBONE, "pod", training="set", training_set=points)


@pytest.mark.parametrize(
    ("call", "values", "word"),
    [
        (simulated("model"), [3, [WISHBONE], None, {}], "unknown model"),
        (simulated("method"), [None, ["pod"]], "unknown method"),
        (simulated("maneuver"), [3, np.sin, "", "lane_change"], "maneuver"),
        (simulated("start"), ["", [0.0] * 8], "start"),
        (simulated("training"), [3, [], "nomnal", "sine_travl"], "training"),
        (simulated("training"), [["nominal", 3], "lane_change"], "maneuver"),
        (simulated("training"), [range(10**12)], "training is range"),
        (simulated("maneuver"), ["n" * 10**5], "unknown maneuver 'nnn"),
        (simulated("training_set"), [[(1, 1)]], "'set' needs training_set"),
        (simulated("frequency"), [*NO_NUMBERS, -1.0, np.nan, 1e-9, 1e6], "frequency factor"),
        # 0.1 Hz times the factor at 100 output times per second: at least three a period.
        (simulated("frequency"), [400.0, 900.0, 1e3], "output times 0.01 s apart"),
        (simulated("amplitude"), [*NO_NUMBERS, None, np.inf], "amplitude factor"),
        (simulated("errors"), [b"x", *NONE, *WRONG], "errors is"),
        (trained, [3, [1.0, 2.0], [(1, 2, 3)], ["ab"], [(1, 1j)]], "training_set"),
        (trained, [[(1, np.nan)]], "amplitude factor"),
        (vm.model, [None, {}, NoText()], "unknown model"),
        (lambda v: vm.model(CAR, v), [[1], {1: 2}, *WRONG], "parameter"),
        (lambda v: vm.model(CAR, {"sprung_mass": v}), [*NO_NUMBERS, None, [2.0]], "sprung_mass"),
        (
            lambda v: vm.model(CAR, {v: 1e300}),
            ["PCX1", "front_stiffness", "front_damping", "nominal_load", "load_scale"],
            "above the largest allowed",
        ),
        # The sprung mass hangs over an axle: the wheels at the other end had to hold it down.
        (lambda v: vm.model(CAR, {"front_axle_distance": v}), [0.05], "rear wheels leave the"),
        (lambda v: vm.model(FIDELITY, {"tie_rod_outer": v}), [[-150, 770, -120]], "millimetres"),
        # No body has them: the largest moment is at most the sum of the others.
        (
            lambda v: vm.model(CAR, v),
            [{"roll_inertia": 1e-6}, {"pitch_inertia": 1e6}, {"product_of_inertia": 600.0}],
            "no body has the principal moments",
        ),
        (lambda v: vm.model(CAR, None, v), NO_PATHS[1:], "is not a path"),
        (lambda v: vm.reduce(car(), "full_order").for_parameters(v), WRONG, "parameter"),
        (lambda v: car().driving(v), [3, [1], np.ones(3)], "inputs is"),
        (lambda v: vm.metrics(car().simulate(STEER), v), [np.zeros(0), *WRONG], "maneuver with"),
        (vm.describe, NO_PATHS, "name: "),
        (vm.run_study, [*NO_PATHS, "a\udcff.toml", "a" * 10**5], "study"),
        (vm.run_study, [f"{'n' * 200}.toml"], "its name has more than 180"),
        (lambda v: vm.run_study("paper", jobs=v), NO_JOBS, "jobs is"),
        (lambda v: vm.run_study("paper", results=v), NO_PATHS, "results: "),
        (lambda v: vm.run_study("paper", progress=v), [3], "progress is 3"),
        (lambda v: vm.run_study("paper", scheduler=v), WRONG, "scheduler is"),
        (lambda v: vm.status("figure-12", seed=v), ["7", -1, 1.5], "seed is"),
        (vm.compare, [xr.Dataset(), *NO_PATHS], "what: "),
        (vm.compare, ["papr", Path("papr")], "unknown comparison 'papr'"),
        (lambda v: vm.compare(WISHBONE, jobs=v), NO_JOBS, "jobs is"),
        (lambda v: vm.write_report(WISHBONE, jobs=v), NO_JOBS, "jobs is"),
        (vm.figures, [3, np.ones(3), range(10**12)], "only is"),
        (vm.figures, [[5], [[]], b"x"], "only: "),
        (vm.write_report, [3, np.ones(3), range(10**12)], "studies is"),
        (lambda v: vm.rom(CAR).save("a.nc", overwrite=v), NO_FLAGS, "overwrite is"),
        (lambda v: vm.export(car(), "c", overwrite=v), NO_FLAGS, "overwrite is"),
        (lambda v: vm.rom(CAR).outputs(v, 0.0), [[[1], [1, 2]], range(10**12)], "state"),
        (lambda v: vm.Signal.from_csv("a.csv", time=v), [3, np.ones(3)], "time is"),
        (lambda v: vm.figures(["figure-11"], out=v), [3], "out: 3"),
        (lambda v: vm.figures(["figure-11"], jobs=v), NO_JOBS[:4], "jobs is"),
        (lambda v: car().simulate(STEER, solver=v), [{}, "", 0, *WRONG], "unknown solver"),
        (lambda v: car().simulate(STEER, tolerance=v), WRONG, "tolerance is"),
        (lambda v: car().simulate(STEER, begin=v), [*NONE, *WRONG], "begin: "),
        (lambda v: car().simulate(v), [None, "x"], "maneuver"),
        (vm.plot, [3], "result is 3"),
        (lambda v: vm.plot(xr.Dataset({"status": "ok"}), rank=v), [3], "'rank'"),
        (vm.plot, [xr.Dataset({"a": 1.0})], "neither a run nor a study"),
        (vm.plot, ["figure-99"], "unknown study"),
        (vm.plot, ["a" * 10**5, "\udcff"], "is not a path"),
        (vm.plot, ["figure-11"], "vehiclemor run figure-11"),
        (vm.plot, ["paper"], "is a collection"),
        (lambda v: vm.rom(CAR).rhs(vm.rom(CAR).state(), v), [1e308], "is not finite"),
        (lambda v: vm.rom(CAR).rhs(vm.rom(CAR).state(), [0], v), [*NONE, np.nan, *WRONG], "time: "),
        (lambda v: vm.model(TRUCK).simulate(vm.road("C"), tolerance=v), LIMITS, "tolerance: "),
        (lambda v: vm.Signal.from_samples([0, 1], [0, 1], v), ["cubics", *WRONG], "unknown hold"),
        (lambda v: vm.Signal.from_samples(v, [0, 1]), [range(10**12)], "signal: range(0, "),
        (lambda v: vm.Signal.from_samples([0, 1], [0, 1], name=v), [None, ""], "name is"),
        (lambda v: STEER.perturbed(amplitude=v), WRONG, "amplitude factor"),
        (lambda v: STEER.perturbed(frequency=v), [0.0, *WRONG], "frequency factor"),
        (lambda v: vm.export(car(), v), WRONG, "unknown target"),
        (lambda v: vm.export(car(), "c", "none/c", step=v), [1e5, 1e-300, *WRONG], "step"),
        (lambda v: vm.simulate_many(car(), v), [range(10**12), [3]], "signals"),
        (lambda v: vm.simulate_many(car(), [STEER], outputs=v), [{}, *WRONG], "output"),
        (lambda v: vm.simulate_many(car(), [STEER], v), [np.array(1.0), 10**400], "start"),
        (lambda v: vm.simulate_many(car(), [STEER], jobs=v), NO_JOBS, "jobs is"),
        (lambda v: vm.model(WISHBONE).residual(v, [0.0, 0.0]), [np.zeros(7)], "q has shape (7,)"),
        (lambda v: vm.model(WISHBONE).jacobian(np.zeros(8), v), [[0.0, np.nan]], "u[1]"),
        (lambda v: vm.model(WISHBONE).solve_path([0.0, 0.5], v), [np.zeros((2, 1))], "inputs"),
        (lambda v: car().rhs(v, 0.0), [np.zeros(27)], "x has shape (27,)"),
        (lambda v: car().rhs(np.zeros(28), v), [None, *NO_NUMBERS[:-2]], "u is"),
        (lambda v: car().start(v), [[1.0, [2.0]], {}, ["0"] * 28, MASKED, 3, "nothing"], "start"),
        (lambda v: vm.simulate(car(), start=v), [[1.0, 2.0], np.full(28, np.nan)], "start"),
        # The tires hold up to some angle of steering.
        (lambda v: vm.simulate(car(), amplitude=v), [100.0], "holds from -1.066 to 1.066 rad"),
        (lambda v: vm.simulate(car(), "replay", amplitude=v), [100.0], "rad at t ="),
    ],
)
def test_functions(call, values, word, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for value in values:
        refused(lambda value=value: call(value), word)
    assert list(tmp_path.iterdir()) == []


def test_what_is_just_allowed_is_run():
    dropped = vm.simulate(car(), start="dropped")
    for state in (car().start("dropped"), car().start("dropped").tolist()):
        own = vm.simulate(car(), start=state)
        np.testing.assert_array_equal(own["outputs"], dropped["outputs"])
    assert not np.array_equal(vm.simulate(car())["outputs"], dropped["outputs"])
    lane_change = vm.maneuver("lane_change")
    largest = np.abs(lane_change.at(lane_change.times)).max()
    vm.simulate(car(), amplitude=1.066 / largest * 0.999)
    assert vm.simulate(WISHBONE, frequency=300.0)["status"].item() == "ok"


def maneuver(name, value):
    good = {
        "name": "mine",
        "summary": "",
        "signal": lambda t, *_: np.zeros((len(t), 1)),
        "inputs": ("delta",),
        "duration": 5.0,
        "samples": 51,
        "corners": lambda _: (),
    }
    return Maneuver(**good | {name: value})


@pytest.mark.parametrize(
    ("name", "values", "word"),
    [
        ("name", [3], "name of a maneuver is 3"),
        ("duration", [-1.0, "5", 1e300], "duration"),
        ("samples", [0, 2.5, 10**12], "samples is"),
        ("inputs", [3, ["delta", 1]], "inputs is"),
    ],
)
def test_maneuvers_that_are_none(name, values, word):
    for value in values:
        refused(lambda value=value: maneuver(name, value), word)


@pytest.mark.parametrize(
    ("name", "value", "word"),
    [
        ("signal", lambda t, *_: np.zeros(len(t)), "maneuver 'mine': signal gives an array"),
        ("signal", lambda t: t[:, None], "signal: TypeError"),
        ("corners", lambda _: 1 / 0, "maneuver 'mine': corners: ZeroDivisionError"),
        ("corners", lambda _: (np.nan,), "corners are"),
        ("corners", lambda _: range(10**9), "more than 10000 corners"),
        ("signal", lambda t, *_: np.where(t < 2.0, 0.0, np.nan)[:, None], "not finite at t = 2 s"),
        ("signal", lambda t, *_: np.where(t < 2.0, 0.0, 0.1)[:, None], "times of its corners"),
        ("inputs", ("rudder",), "gives inputs rudder"),
    ],
)
def test_maneuvers_that_break_when_they_are_used(name, value, word):
    broken = maneuver(name, value)
    refused(lambda: vm.simulate(car(), maneuver=broken), word)
    refused(lambda: car().simulate(broken), word)
