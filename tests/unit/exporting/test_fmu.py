"""Functional mock-up units, through FMPy: its checker, both interfaces, derivatives, states."""

import shutil
from contextlib import ExitStack
from functools import cache
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest

import vehiclemor as vm
from tests.unit.exporting.programs import in_use, relative, runge_kutta, steering
from vehiclemor.exporting import fmu

fmpy = pytest.importorskip("fmpy")
validate_fmu = pytest.importorskip("fmpy.validation").validate_fmu
pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")
# Step of the integrator inside, and steps between exchanges with the outside.
STEP, HELD = 1e-3, 10
CASES = [
    ("independent_suspension_vehicle", "full"),
    ("independent_suspension_vehicle", "reduced"),
    ("high_fidelity_vehicle", "full"),
]


@pytest.fixture(scope="module")
def units(tmp_path_factory):
    """(model, kind), options -> model in use and path of its unit, quickly compiled."""

    @cache
    def unit(name, kind, **options):
        path = tmp_path_factory.mktemp("unit") / "car.fmu"
        model = in_use(name, kind)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(fmu, "OPTIMISED", ("-std=c99", "-O0", "-Wall", "-Werror"))
            return model, vm.export(model, "fmu", path, **options)

    return unit


class Instance:
    """A unit that has been started by hand."""

    def __init__(self, path: Path, folder: Path) -> None:
        from fmpy.fmi2 import FMU2Slave

        described = fmpy.read_model_description(str(path))
        self.number = {v.name: v.valueReference for v in described.modelVariables}
        self.outputs = [v.name for v in described.modelVariables if v.causality == "output"]
        self.slave = FMU2Slave(
            guid=described.guid,
            unzipDirectory=fmpy.extract(str(path), str(folder)),
            modelIdentifier=described.coSimulation.modelIdentifier,
            instanceName="car",
        )
        self.slave.instantiate()
        self.slave.setupExperiment()
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()

    def of(self, names):
        return [self.number[name] for name in names]

    def get(self, names):
        return np.array(self.slave.getReal(self.of(names)))

    def set(self, names, values):
        self.slave.setReal(self.of(names), np.asarray(values, float).tolist())

    def along(self, unknown, known):
        rows = [
            self.slave.getDirectionalDerivative(self.of(unknown), self.of([name]), [1.0])
            for name in known
        ]
        return np.array(rows).T


@pytest.fixture
def started(units, tmp_path):
    """Start a unit."""
    with ExitStack() as stack:

        def start(*case, **options):
            model, path = units(*case, **options)
            unit = Instance(path, tmp_path)
            stack.callback(unit.slave.freeInstance)
            stack.callback(unit.slave.terminate)
            return model, unit

        yield start


def simulated(path, kind, end, **options) -> np.ndarray:
    """Rows of outputs, of a reduced model the trust indicator at last, by FMPy."""
    found = fmpy.simulate_fmu(str(path), stop_time=end, fmi_type=kind, validate=False, **options)
    return np.array([list(row)[1:] for row in found])


@pytest.mark.parametrize("case", CASES)
def test_the_checker_finds_nothing_and_co_simulation_is_our_integrator(units, case):
    model, path = units(*case)
    assert validate_fmu(str(path)) == []
    samples = 16
    inputs = steering(model, samples, HELD * STEP)
    times = np.arange(samples) * HELD * STEP
    given = np.array(
        [(t, *u) for t, u in zip(times, inputs, strict=True)],
        dtype=[("time", float), *((name, float) for name in model.inputs)],
    )
    step = {"step_size": HELD * STEP, "output_interval": HELD * STEP}
    found = simulated(path, "CoSimulation", times[-1], input=given, **step)
    states = runge_kutta(model.rhs, model.state(), inputs, STEP, HELD)[::HELD]
    # Outputs are read before the next inputs are set.
    wanted = model.outputs(states, np.vstack([inputs[:1], inputs[:-1]]))
    assert relative(found[:, : wanted.shape[1]], wanted) < 1e-9


@pytest.mark.parametrize("case", CASES[:2])
def test_model_exchange_with_another_integrator(units, case):
    model, path = units(*case)
    solver = {"solver": "CVode", "relative_tolerance": 1e-9, "output_interval": 0.1}
    found = simulated(path, "ModelExchange", 1.0, start_values={"delta": 0.03}, **solver)
    inputs = np.full((1001, 1), 0.03)
    states = runge_kutta(model.rhs, model.state(), inputs, STEP)[::100]
    wanted = model.outputs(states, inputs[::100])
    assert relative(found[:, : wanted.shape[1]], wanted) < 1e-5


def test_a_turned_car_moves_as_the_same_car_turned(started):
    model, unit = started(*CASES[2], integrator="ros2", step=0.02)
    names, angle = [f"state.{name}" for name in model.states], 2.0
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    heading, *pairs = model.model.system.rotating
    unit.set(model.inputs[:1], [0.003])
    ends = []
    for turned in (False, True):
        start = model.state()
        if turned:
            start[heading] += angle
            start[pairs[2:]] = turn @ start[pairs[2:]]
        unit.set(names, start)
        unit.slave.doStep(0.0, 0.5)
        ends.append(unit.get(names))
    straight, turned = ends
    wanted = straight.copy()
    wanted[heading] += angle
    for pair in (pairs[:2], pairs[2:]):
        wanted[pair] = turn @ straight[pair]
    assert abs(straight[pairs[1]]) > 1e-3
    assert np.abs(turned - wanted).max() < 1e-9


def test_quantities_have_the_units_of_the_model(units):
    model, path = units(*CASES[0])
    described = fmpy.read_model_description(str(path))
    declared = {v.name: v.unit or "1" for v in described.modelVariables}
    rates = [v for v in described.modelVariables if v.derivative]
    assert [v.name for v in rates] == [f"der({v.derivative.name})" for v in rates]
    assert len(rates) == len(model.states)
    definition = model.model.definition
    for q in (*definition.coordinates, *definition.speeds):
        assert declared[f"state.{q.name}"] == q.unit
        assert declared[f"der(state.{q.name})"] == f"{q.unit}/s"
    assert all(declared[q.name] == q.unit for q in (*definition.inputs, *definition.outputs))
    assert {"N s/m", "kg m^2", "m/s/s"} <= {unit.name for unit in described.unitDefinitions}


@pytest.mark.parametrize("case", CASES)
def test_directional_derivatives_are_the_models(started, case):
    model, unit = started(*case)
    start = model.state()
    states = [f"state.{name}" for name in model.states]
    assert np.array_equal(unit.get(states), start)
    x = start + 1e-3 * np.cos(np.arange(len(start)))
    u = 0.01 * np.cos(np.arange(len(model.inputs)))
    unit.set(states, x)
    unit.set(model.inputs, u)
    rates = [f"der({name})" for name in states]
    # The full high-fidelity vehicle's own take half a minute to compile.
    for names, by in ((states, "state"), (list(model.inputs), "inputs")) * (case != CASES[2]):
        wanted = model.jacobian(x, u, by)
        assert np.abs(unit.along(rates, names) - wanted).max() <= 1e-12 * np.abs(wanted).max()
    # Of outputs, trust and parameters too, against differences of order 4 of the unit itself.
    every = [*rates, *unit.outputs]
    turned = [*(["parameter.tire_stiffness"] if case[1] == "full" else states[:2]), *model.inputs]
    for name in turned:
        (value,) = unit.get([name])
        size, ends = 1e-5 * max(abs(value), 1.0), []
        for place in (1, -1, 2, -2):
            unit.set([name], [value + place * size])
            ends.append(unit.get(every))
        unit.set([name], [value])
        wanted = (8.0 * (ends[0] - ends[1]) - (ends[2] - ends[3])) / (12.0 * size)
        found = unit.along(every, [name])[:, 0]
        for part in (slice(len(rates)), slice(len(rates), None)):
            largest = max(np.abs(wanted[part]).max(), 1e-6)
            assert np.abs(found[part] - wanted[part]).max() <= 1e-6 * largest


def test_a_parameter_that_is_set_is_the_parameter(started):
    model, unit = started(*CASES[0])
    lighter = vm.model(model.model.name, {"sprung_mass": 1200.0})
    unit.set(["parameter.sprung_mass"], [1200.0])
    states = [f"state.{name}" for name in model.states]
    found = unit.get([f"der({name})" for name in states])
    wanted = lighter.rhs(unit.get(states), [0.0])
    assert np.abs(found - wanted).max() <= 1e-12 * np.abs(wanted).max()
    assert np.abs(found - model.rhs(unit.get(states), [0.0])).max() > 0.1


def test_what_is_refused_leaves_all_as_it_was(started):
    _, unit = started(*CASES[0])
    state = next(name for name in unit.number if name.startswith("state."))
    every = ["time", state, *unit.outputs]
    before = unit.get(every)
    for length in (np.inf, np.nan, -0.01, 0.0, 1e7):
        with pytest.raises(fmpy.fmi1.FMICallException):
            unit.slave.doStep(0.0, length)
    with pytest.raises(fmpy.fmi1.FMICallException):
        unit.set([state, unit.outputs[0]], [before[1] + 5.0, 1.0])
    assert np.array_equal(unit.get(every), before)


@pytest.mark.parametrize("case", CASES[:2])
def test_a_state_that_was_kept_is_gone_back_to(started, case):
    _, unit = started(*case)
    unit.set(["delta"], [0.02])
    state = unit.slave.getFMUstate()
    ends = []
    for _ in range(2):
        unit.slave.doStep(0.0, 0.05)
        ends.append(unit.get(unit.outputs))
        unit.slave.setFMUstate(state)
    assert np.array_equal(*ends)
    unit.slave.freeFMUstate(state)


def test_a_path_map_has_neither_states_nor_rates(tmp_path):
    model = vm.rom("double_wishbone")
    path = vm.export(model, "fmu", tmp_path / "suspension.fmu")
    assert validate_fmu(str(path)) == []
    found = simulated(path, "CoSimulation", 0.1, step_size=0.1, start_values={"z": 0.05})
    run = model.simulate(vm.Signal.from_samples([0.0, 1.0], [[0.05, 0.0], [0.05, 0.0]]))
    known = model.trust(run.coordinates, run.inputs).indicator
    assert found[0] == pytest.approx([*run.outputs[0], known], abs=1e-14)


def test_without_a_compiler_the_unit_has_sources_alone(tmp_path, monkeypatch, caplog):
    monkeypatch.setenv("CC", "no-such-compiler")
    path = vm.export(vm.rom("independent_suspension_vehicle"), "fmu", tmp_path / "car.fmu")
    assert "no C compiler" in caplog.text
    with ZipFile(path) as archive:
        assert not any(name.startswith("binaries") for name in archive.namelist())
    assert validate_fmu(str(path)) == []
