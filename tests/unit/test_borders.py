"""Wrong input from Python: one clear line that names it, never a traceback, never nonsense."""

import datetime

import numpy as np
import pytest

import vehiclemor as vm
from vehiclemor.errors import VehiclemorError
from vehiclemor.maneuver import Maneuver
from vehiclemor.registry import component
from vehiclemor.study.plans.grid import expand
from vehiclemor.study.plans.study_file import StudyFile
from vehiclemor.toml_files import read_toml

SUSPENSION, CAR = "double_wishbone", "independent_suspension_vehicle"
TRAVEL = component("maneuver", "sine_travel")
MASKED = np.ma.array([1.0, 2.0], mask=[True, False])


def refused(call, *words):
    with pytest.raises(VehiclemorError) as error:
        call()
    text = str(error.value)
    assert "\n" not in text
    assert len(text) < 500
    for word in words:
        assert word in text, text


@pytest.fixture(scope="module")
def car():
    return vm.model(CAR)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"model": 3}, ["unknown model 3"]),
        ({"model": [SUSPENSION]}, ["unknown model ['double_wishbone']"]),
        ({"method": None}, ["unknown method None"]),
        ({"method": ["pod"]}, ["unknown method ['pod']"]),
        ({"maneuver": 3}, ["3 is not a maneuver", "vm.maneuver(name)"]),
        ({"maneuver": np.sin}, ["is not a maneuver"]),
        ({"maneuver": ""}, ["unknown maneuver ''"]),
        ({"maneuver": "lane_change"}, ["gives inputs delta", "needs z, s0"]),
        ({"start": ""}, ["unknown start ''"]),
        ({"start": [0.0] * 8}, ["double_wishbone starts from 'equilibrium' alone"]),
        ({"preset": ["literal"]}, ["unknown preset", "['literal']"]),
        ({"preset": None}, ["unknown preset", "None"]),
        ({"training": 3}, ["training is 3: give names, maneuvers or scenarios"]),
        ({"training": []}, ["training is []"]),
        ({"training": ["nominal", 3]}, ["3 is not a maneuver"]),
        ({"training": ["nominal", [1.0]]}, ["[1.0] is not a maneuver"]),
        ({"training": "nomnal"}, ["unknown training 'nomnal'; did you mean nominal?"]),
        ({"training": "sine_travl"}, ["unknown training", "did you mean sine_travel"]),
        ({"training": "lane_change"}, ["gives inputs delta", "needs z, s0"]),
        ({"training_set": [(1, 1)]}, ["'set' needs training_set", "nothing else"]),
        ({"training_set": 3, "training": "set"}, ["training_set is 3", "pairs"]),
        ({"training_set": [1.0, 2.0], "training": "set"}, ["training_set", "pairs"]),
        ({"training_set": [(1, 2, 3)], "training": "set"}, ["training_set", "pairs"]),
        ({"training_set": ["ab"], "training": "set"}, ["training_set", "pairs"]),
        ({"training_set": [(1, 1j)], "training": "set"}, ["training_set", "pairs"]),
        ({"training_set": [(1, np.nan)], "training": "set"}, ["amplitude factor", "not finite"]),
        ({"training": "set"}, ["needs training_set"]),
        ({"frequency": "1"}, ["frequency factor: '1' is not a number"]),
        ({"frequency": 1j}, ["frequency factor: 1j is not a number"]),
        ({"frequency": np.complex128(1)}, ["frequency factor", "not a number"]),
        ({"frequency": np.True_}, ["frequency factor", "not a number"]),
        ({"frequency": np.ones(2)}, ["frequency factor", "not a number"]),
        ({"frequency": np.ma.masked}, ["frequency factor: masked is not a number"]),
        ({"frequency": 10**400}, ["frequency factor", "not a number"]),
        ({"frequency": 1e-9}, ["frequency factor: 1e-09 is below 0.001"]),
        ({"frequency": 1e6}, ["frequency factor: 1e+06 is above 1000"]),
        ({"frequency": 900.0}, ["input z changes faster than output times 0.01 s apart can show"]),
        ({"rtol": "1e-3"}, ["rtol: '1e-3' is not a number"]),
        ({"rtol": 1e300}, ["tolerance is 1e+300; it must be at most 0.1"]),
        ({"rtol": 1e-3, "tolerance": 1e-4}, ["rtol and tolerance are the same setting"]),
        ({"method": "pod", "rank_tolerance": 2.0}, ["rank_tolerance is 2; it must be below 1"]),
        ({"method": "pod", "rank": np.array([3])}, ["rank is array([3]), not an integer"]),
        ({"method": "pod", "rank": 3 + 0j}, ["rank is (3+0j), not an integer"]),
        ({"method": "pod", "rank": datetime.date(2020, 1, 1)}, ["rank", "not an integer"]),
    ],
)
def test_simulate(arguments, words):
    refused(lambda: vm.simulate(**{"model": SUSPENSION, **arguments}), *words)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("sprung_mass", "1500", ["'1500' is not a number"]),
        ("sprung_mass", datetime.date(2020, 1, 1), ["datetime.date(2020, 1, 1) is not a number"]),
        ("sprung_mass", np.datetime64("2020-01-01"), ["is not a number"]),
        ("sprung_mass", np.timedelta64(3, "s"), ["is not a number"]),
        ("sprung_mass", 1500 + 0j, ["(1500+0j) is not a number"]),
        ("sprung_mass", np.ma.masked, ["masked is not a number"]),
        ("sprung_mass", np.True_, ["is not a number"]),
        ("sprung_mass", b"1500", ["is not a number"]),
        ("sprung_mass", [[1500.0]], ["is not a number"]),
        ("PCX1", 1e300, ["PCX1: 1e+300 is above the largest allowed 1000"]),
        ("front_stiffness", 1e300, ["above the largest allowed 1e+09 N/m"]),
        ("front_damping", 1e300, ["above the largest allowed 1e+08 N s/m"]),
        ("nominal_load", 1e300, ["above the largest allowed 1e+07 N"]),
        ("load_scale", 1e300, ["above the largest allowed 100"]),
        # No body has them: the largest moment is at most the sum of the others.
        ("roll_inertia", 1e-6, ["sprung body: no body has the principal moments", "kg m^2"]),
        ("pitch_inertia", 1e6, ["sprung body: no body has the principal moments", "kg m^2"]),
        ("product_of_inertia", 600.0, ["sprung body: no body has the principal moments"]),
    ],
)
def test_parameters(name, value, words):
    refused(lambda: vm.model(CAR, {name: value}), *words)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: vm.model(None), ["unknown model None"]),
        (lambda: vm.model({}), ["unknown model {}"]),
        (lambda: vm.model(SUSPENSION, [1]), ["parameters must be a mapping"]),
        (lambda: vm.model(SUSPENSION, parameter_file=3), ["parameter_file: 3 is not a path"]),
        (lambda: vm.model(SUSPENSION, parameter_file=""), ["parameter_file: '' is not a path"]),
        (lambda: vm.run_study(None), ["study: None is not a path"]),
        (lambda: vm.run_study(["paper"]), ["study: ['paper'] is not a path"]),
        (lambda: vm.run_study("paper", jobs="2"), ["jobs is '2'", "whole number, at least 1"]),
        (lambda: vm.run_study("paper", jobs=1.5), ["jobs is 1.5", "whole number"]),
        (lambda: vm.run_study("paper", jobs=True), ["jobs is True", "whole number"]),
        (lambda: vm.run_study("paper", out=""), ["out: '' is not a path"]),
        (lambda: vm.run_study("paper", out=None), ["out: None is not a path"]),
        (lambda: vm.compare(["paper"]), ["unknown comparison ['paper']"]),
        (lambda: vm.compare(jobs="2"), ["jobs is '2'"]),
        (lambda: vm.describe(None), ["name is None"]),
        (lambda: vm.describe([1]), ["name is [1]"]),
        (lambda: vm.maneuver("lane_chang"), ["unknown maneuver", "did you mean lane_change"]),
        (lambda: vm.maneuver("lane_change", frequency=-1), ["frequency factor", "not positive"]),
        (lambda: vm.model(SUSPENSION).simulate(None), ["None is not a maneuver"]),
        (lambda: vm.model(SUSPENSION).simulate("x"), ["unknown maneuver 'x'"]),
        (lambda: vm.figures(3), ["only is 3, not a list"]),
        (lambda: vm.figures([5]), ["only is [5], not a list"]),
        (lambda: vm.figures("55"), ["unknown figure '55'"]),
        (lambda: vm.figures(["5"], out=3), ["out: 3 is not a path"]),
        (lambda: vm.figures(["5"], jobs=0), ["jobs is 0"]),
    ],
)
def test_other_functions(call, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    refused(call, *words)
    assert list(tmp_path.iterdir()) == []


GOOD = {
    "name": "mine",
    "summary": "",
    "signal": lambda t, *_: np.zeros((len(t), 1)),
    "inputs": ("delta",),
    "duration": 5.0,
    "samples": 51,
    "corners": lambda _: (),
}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"name": 3}, ["name of a maneuver is 3, not a line of text"]),
        ({"duration": -1.0}, ["duration is -1 s, not positive"]),
        ({"duration": "5"}, ["duration: '5' is not a number"]),
        ({"duration": 1e300}, ["duration: 1e+300 s is above 100000 s"]),
        ({"samples": 0}, ["samples is 0; it must be a whole number, at least 1"]),
        ({"samples": 2.5}, ["samples is 2.5; it must be a whole number"]),
        ({"samples": 10**12}, ["samples is 1000000000000; it must", "at most 10000000"]),
        ({"signal": None}, ["signal is not a function"]),
        ({"corners": (1.0,)}, ["corners is not a function"]),
        ({"inputs": "delta"}, ["inputs is 'delta', not a tuple of names"]),
        ({"frequency_factor": "1"}, ["frequency factor: '1' is not a number"]),
    ],
)
def test_maneuvers_that_are_none(change, words):
    refused(lambda: Maneuver(**{**GOOD, **change}), *words)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"signal": lambda *_: 1 / 0}, ["maneuver 'mine': signal: ZeroDivisionError"]),
        (
            {"signal": lambda t, *_: np.zeros(len(t))},
            ["shape (1001,) at 1001 times", "not (1001, 1)"],
        ),
        ({"signal": lambda *_: None}, ["signal: TypeError: None is not a number"]),
        ({"signal": lambda t, *_: 1j * np.ones((len(t), 1))}, ["is not a number"]),
        ({"signal": lambda t, *_: np.ma.masked_all((len(t), 1))}, ["is not a number"]),
        ({"signal": lambda t: t[:, None]}, ["signal: TypeError"]),
        (
            {"signal": lambda t, *_: np.full((len(t), 1), 3.0)},
            ["input delta is 3 rad at t = 0 s", "holds from -1.066 to 1.066 rad"],
        ),
        ({"corners": lambda _: 1 / 0}, ["maneuver 'mine': corners: ZeroDivisionError"]),
        ({"corners": lambda _: ("a",)}, ["corners: TypeError: ['a'] is not a number"]),
        ({"corners": lambda _: (np.nan,)}, ["corners are", "not a list of times"]),
        ({"inputs": ("rudder",)}, ["gives inputs rudder"]),
    ],
)
def test_maneuvers_that_break_when_they_are_used(car, change, words):
    maneuver = Maneuver(**{**GOOD, **change})
    refused(lambda: vm.simulate(car, maneuver=maneuver), *words)
    if "inputs" not in change:
        refused(lambda: car.simulate(maneuver), words[0])


def test_steering_beyond_that_of_the_car(car):
    lane_change = component("maneuver", "lane_change")
    words = ["delta", "rad at t =", "independent_suspension_vehicle holds from -1.066 to 1.066 rad"]
    refused(lambda: vm.simulate(car, amplitude=100.0), *words)
    refused(lambda: vm.simulate(car, "replay", amplitude=100.0), *words)
    refused(lambda: car.simulate(lane_change.perturbed(1.0, 100.0)), *words)
    largest = np.abs(lane_change.at(lane_change.times)).max()
    vm.simulate(car, amplitude=1.066 / largest * 0.999)


@pytest.mark.parametrize(
    ("frequency", "fine"), [(1.0, True), (50.0, True), (300.0, True), (400.0, False), (1e3, False)]
)
def test_inputs_are_shown_by_their_output_times(frequency, fine):
    # 0.1 Hz times the factor at 100 output times per second: at least three a period.
    call = lambda: vm.simulate(SUSPENSION, frequency=frequency)  # noqa: E731
    if fine:
        assert call()["status"].item() == "ok"
    else:
        refused(call, "output times 0.01 s apart")


def test_states_that_are_none(car):
    none = ([1.0, [2.0]], {}, ["0.0"] * 28, car.start() + 0j, MASKED)
    for state in (*none, [1.0, 2.0], 3, "nothing", np.full(28, np.nan)):
        refused(lambda state=state: car.start(state), "start")
        refused(lambda state=state: vm.simulate(car, start=state), "start")
    for state in none:
        refused(lambda state=state: car.start(state), "start is", "needs 28 numbers")
    for u in ("1", None, 1j, np.datetime64("2020-01-01"), np.ma.masked):
        refused(lambda u=u: car.derivative(car.start(), u), "u is")


def test_a_start_may_be_a_state(car):
    dropped = vm.simulate(car, start="dropped")
    for state in (car.start("dropped"), car.start("dropped").tolist()):
        own = vm.simulate(car, start=state)
        np.testing.assert_array_equal(own["outputs"], dropped["outputs"])
    assert not np.array_equal(vm.simulate(car)["outputs"], dropped["outputs"])


WRONG = ([1], {"a": 1}, [[1.0]], np.ones(3), np.zeros(0), np.ones((3, 3)), 10**400)
STEER = vm.Signal.from_samples([0.0, 0.1, 0.2], [0.0, 0.01, 0.0], inputs=["delta"])
NONE = (None, set(), range(0))


@pytest.mark.parametrize(
    ("call", "values", "words"),
    [
        (lambda _, v: vm.rom(v), [[], {}, *WRONG], "unknown model with a reduced one"),
        (lambda _, v: vm.Signal.from_samples([0, 1], [0, 1], hold=v), WRONG, "unknown hold"),
        (lambda _, v: vm.Signal.from_samples([0, 1], [0, 1], output_step=v), [1e308], "above"),
        (lambda _, v: STEER.perturbed(amplitude=v), WRONG, "amplitude factor"),
        (lambda _, v: STEER.perturbed(frequency=v), WRONG, "frequency factor"),
        (lambda car, v: car.simulate(STEER, solver=v), [{}, "", 0, *WRONG], "unknown solver"),
        (lambda car, v: car.simulate(STEER, tolerance=v), WRONG, "tolerance is"),
        (lambda car, v: car.simulate(STEER, begin=v), [*NONE, *WRONG], "begin: "),
        (lambda _, v: vm.model(SUSPENSION).simulate(solver=v, maneuver=TRAVEL), WRONG, "solver"),
        (lambda _, v: vm.model(CAR, v), [{1: 2}, *WRONG], "parameter"),
        (vm.export, WRONG, "unknown target"),
        (
            lambda car, v: vm.export(car, "c", "none/c", step=v),
            [1e300, 1e5, 10.0, 1e-300, *WRONG],
            "step",
        ),
        (lambda car, v: vm.simulate_many(car, [STEER], outputs=v), [{}, *WRONG], "output"),
        (lambda car, v: vm.simulate_many(car, [STEER], v), [np.array(1.0), 10**400], "start"),
        (lambda car, v: vm.simulate_many(car, [STEER], jobs=v), [10**39, *WRONG], "jobs is"),
        (lambda car, v: vm.simulate(car, errors=v), [b"x", *NONE, *WRONG], "errors is"),
        (lambda car, v: vm.simulate(car, "pod", control_period=v), WRONG[:-1], "control_period"),
        (lambda _, v: vm.describe(CAR, None, v), WRONG, "parameter_file"),
        (lambda _, v: vm.run_study("paper", v), WRONG, "jobs is"),
        (lambda _, v: vm.model(CAR, None, v), ["a\nb", *WRONG], "is not a path"),
    ],
)
def test_values_of_any_kind_are_refused_in_one_line(car, call, values, words):
    for value in values:
        refused(lambda value=value: call(car, value), words)


def test_what_overflows_in_a_reduced_model_is_refused():
    rom = vm.rom(CAR)
    refused(lambda: rom.rhs(rom.state(), 1e308), "derivative of", "is not finite")


STUDY = """
title = "mine"
model = "double_wishbone"
{}
[grid]
{}
[[methods]]
method = "pod"
{}
"""


@pytest.mark.parametrize(
    ("top", "grid", "method", "words"),
    [
        ("", "rank = {first=1.0, last=2.0, count=1000000000}", "", ["count", "10000"]),
        ("", "rank = {first=1.0, last=2.0, count=0}", "", ["count", "equal to 1"]),
        ("", "rank = {first=2.0, last=2.0, count=3}", "", ["rank has the same value twice"]),
        ("", "rank = {first=1.0, last=inf, count=3}", "", ["grid.rank.span.last", "finite"]),
        ("", "rank = {first=1.0, count=3}", "", ["grid.rank.span.last"]),
        ("", "rank = 3", "", ["grid.rank", "list"]),
        ("", "rank = [3, 4]", "settings = {rank = 2}", ["rank is set twice", "settings of pod"]),
        ('maneuver = "lane_change"', "", "", ["gives inputs delta"]),
        ("x = " + 2000 * "[" + 2000 * "]", "", "", ["nested too deeply"]),
        ("x = " + 5000 * "9", "", "", ["not a valid TOML file"]),
    ],
)
def test_study_files(tmp_path, top, grid, method, words):
    path = tmp_path / "mine.toml"
    path.write_text(STUDY.format(top, grid, method))
    refused(lambda: expand("mine", read_toml(path, StudyFile)), *words)


def test_a_study_may_be_a_path(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(STUDY.format("", "", ""))
    assert vm.run_study(path, out=tmp_path / "results")["status"].values.ravel() == ["ok"]
