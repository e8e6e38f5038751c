"""A plug-in package: its template under any name, its quarter car and method, exact solutions."""

import runpy
import subprocess
import sys
import tomllib
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

from vehiclemor import registry
from vehiclemor.cli import main
from vehiclemor.files import data_folder
from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.reduction.validation import validated
from vehiclemor.registry import component
from vehiclemor.simulation.build import build

pytestmark = pytest.mark.usefixtures("plug_in_package")
SOLVERS = {"dopri5": 1e-10, "rodas4": 1e-9, "etdrk4": 1e-8}


@pytest.fixture(scope="module")
def car(plug_in_package):
    return build("quarter_car")


def matrices(model) -> tuple[np.ndarray, np.ndarray]:
    """State matrix (4, 4) and input column (4,), from the springs' and masses' own equations."""
    p = {name: float(value) for name, value in model.parameters.values().items()}
    mass = np.diag([p["sprung_mass"], p["unsprung_mass"]])
    pair = np.array([[1.0, -1.0], [-1.0, 1.0]])
    stiffness = p["stiffness"] * pair + np.diag([0.0, p["tire_stiffness"]])
    accelerations = -np.linalg.solve(mass, np.hstack([stiffness, p["damping"] * pair]))
    a = np.vstack([np.hstack([np.zeros((2, 2)), np.eye(2)]), accelerations])
    return a, np.array([0.0, 0.0, 0.0, p["tire_stiffness"] / p["unsprung_mass"]])


def exact(model, start: np.ndarray, drive: np.ndarray, times: np.ndarray) -> np.ndarray:
    """States over a road by the exponential of the system with what its road is the solution of.

    Parameters
    ----------
    drive
        Matrix (2, 2) of z' = drive z, z(0) = (0, 1), whose first component is the road in m.
    times
        Equidistant, from 0.
    """
    a, b = matrices(model)
    whole = np.zeros((6, 6))
    whole[:4, :4], whole[:4, 4], whole[4:, 4:] = a, b, drive
    step, states = expm(whole * times[1]), [np.concatenate([start, [0.0, 1.0]])]
    for _ in times[1:]:
        states.append(step @ states[-1])
    return np.array(states)[:, :4]


def sine(frequency: float) -> np.ndarray:
    rate = 2.0 * np.pi * 1.5 * frequency
    return np.array([[0.0, 0.02 * rate], [-rate / 0.02, 0.0]])


def test_an_installed_plug_in_is_listed_in_a_new_process():
    text = "import vehiclemor as vm; print(vm.models()['quarter_car'])"
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True)
    assert done.stdout == "quarter car, 2 degrees of freedom\n"


@pytest.mark.parametrize("start", ["equilibrium", "dropped"])
@pytest.mark.parametrize("frequency", [1.0, 1.7])
def test_runs_are_those_of_the_linear_system(car, start, frequency):
    maneuver = component("maneuver", "quarter_car_road").perturbed(frequency)
    expected = exact(car, car.start(start), sine(frequency), maneuver.times)
    size = np.abs(expected).max(axis=0)
    for solver, tolerance in SOLVERS.items():
        run = car.simulate(maneuver, start, solver=solver, tolerance=tolerance)
        error = np.abs(run.states - expected).max(axis=0)
        assert np.all(error < 1e-6 * size), solver
    # Outputs: acceleration, travel, tire force; what the tire gives moves both masses.
    a, b = matrices(car)
    rates, x, outputs = run.states @ a.T + run.inputs * b, run.states, run.outputs
    tire = float(car.parameters["tire_stiffness"]) * (run.inputs[:, 0] - x[:, 1])
    named = np.column_stack([rates[:, 2], x[:, 1] - x[:, 0], tire])
    np.testing.assert_allclose(outputs, named, rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(rates[:, 2:] @ [250.0, 45.0], outputs[:, 2], rtol=0, atol=1e-9)
    np.testing.assert_array_equal(car.mass_matrix(x[7]), np.diag([250.0, 45.0]))
    np.testing.assert_array_equal(car.speeds_of_rates(x[7]), x[7, 2:])


# The method


def fitted(model, **settings):
    method = component("method", "quarter_car_modes")
    return method.fit(model, (), validated(method, model.kind, settings))


def ramp(samples: int) -> Maneuver:
    names = component("maneuver", "quarter_car_road").inputs
    return Maneuver("ramp", "", lambda t, *_: 0.3 * t[:, None], names, 4.0, samples, lambda _: ())


def test_all_modes_of_a_linear_model_give_its_exact_solution(car):
    start = car.start("dropped")
    reduced, few = fitted(car, fastest=1e4), fitted(car, fastest=20.0)
    assert (reduced.order, few.order) == (4, 2)
    run = reduced.simulate(ramp(201), start)
    # An input that is linear between the output times.
    expected = exact(car, start, np.array([[0.0, 0.3], [0.0, 0.0]]), run.times)
    np.testing.assert_allclose(run.states, expected, rtol=0, atol=1e-9)
    # Whatever these are.
    finer = reduced.simulate(ramp(4001), start)
    np.testing.assert_allclose(run.states, finer.states[::20], rtol=0, atol=1e-10)
    assert np.abs(few.simulate(ramp(201), start).states - expected).max() > 1e-4


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_tests_of_the_template_pass(plug_in_package):
    (file,) = plug_in_package.glob("test_*.py")
    tests = [f for name, f in runpy.run_path(file).items() if name.startswith("test_")]
    assert len(tests) == 4
    for test in tests:
        test()


def test_a_name_stands_wherever_the_template_has_its_own(here, capsys):
    assert main(["new-plugin", "my_car"]) == 0
    told = capsys.readouterr().out
    assert "pip install -e my_car_plugin pytest\n" in told
    assert [path.name for path in here.iterdir()] == ["my_car_plugin"]
    written = [path for path in (here / "my_car_plugin").rglob("*") if path.is_file()]
    template = [p for p in (data_folder() / "plugin_template").rglob("*") if p.suffix != ".pyc"]
    assert len(written) == sum(path.is_file() for path in template)
    for path in written:
        text = path.read_text()
        assert "quarter_car" not in text + str(path)
        assert "quarter-car" not in text
        tomllib.loads(text) if path.suffix == ".toml" else compile(text, path, "exec")
    project = tomllib.loads((here / "my_car_plugin" / "pyproject.toml").read_text())["project"]
    assert project["name"] == "vehiclemor-my-car"
    assert project["entry-points"].keys() == {f"vehiclemor.{kind}s" for kind in registry.GROUPS}
    named = {name for entries in project["entry-points"].values() for name in entries}
    assert named == {"my_car", "my_car_road", "my_car_modes"}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["My-Car"], "'My-Car' can't name"),
        (["pod"], "there is a method pod"),
        (["double_wishbone"], "there is a model double_wishbone"),
        (["lane_change"], "there is a maneuver lane_change"),
        (["paper"], "there is a study paper"),
        (["json"], "there is a Python package json"),
        (["my_car", "--out", "there"], "there exists: it is not replaced"),
        (["my_car", "--out", "file/x"], "file/x: "),
        (["my_car", "--out", "a" * 300], "is not a path"),
    ],
)
def test_what_cannot_be_made_is_one_line(plug_in_package, here, capsys, arguments, words):
    (here / "there").mkdir()
    (here / "file").write_text("mine")
    assert main(["new-plugin", *arguments]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line
    assert sorted(path.name for path in here.iterdir()) == ["file", "there"]
    assert not list((here / "there").iterdir())


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_a_write_that_ends_early_leaves_nothing(here, monkeypatch, error):
    def fail(path, *_, **__):
        if path.name == "model.py":
            raise error
        path.touch()

    monkeypatch.setattr(Path, "write_text", fail)
    with suppress(KeyboardInterrupt):
        assert main(["new-plugin", "my_car"]) != 0
    assert not list(here.iterdir())
