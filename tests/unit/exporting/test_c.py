"""Exported C: it compiles without a warning and does what the model does."""

import re
import shutil
import subprocess
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import vehiclemor as vm
from tests.unit.exporting.programs import (
    FLAGS,
    compiled,
    driven,
    in_use,
    relative,
    runge_kutta,
    steering,
)

CAR = "independent_suspension_vehicle"
pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")
STEP = 1e-3


@pytest.fixture(scope="module")
def drivers(tmp_path_factory):
    """(model, kind), options of an export -> model in use and compiled driver."""

    @cache
    def driver(name, kind, **options):
        folder = tmp_path_factory.mktemp("c") / "car"
        model = in_use(name, kind)
        return model, compiled(vm.export(model, "c", folder, **options))

    return driver


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("independent_suspension_vehicle", "full"),
        ("independent_suspension_vehicle", "reduced"),
        ("high_fidelity_vehicle", "reduced"),
    ],
)
def test_rates_outputs_and_steps_are_the_models(drivers, name, kind):
    model, driver = drivers(name, kind)
    inputs = steering(model, 121, STEP)
    rates, rows = driven(driver, inputs, STEP)
    start = model.state()
    states, outputs = rows[:, : len(start)], rows[:, len(start) :]
    wanted = model.rhs(start, inputs[0])
    assert np.abs(rates - wanted).max() <= 1e-12 * max(np.abs(wanted).max(), 1.0)
    assert relative(states, runge_kutta(model.rhs, start, inputs, STEP)) < 1e-11
    own = len(model.output_names)
    # Slips are differences of speeds that are nearly equal: they lose four digits.
    assert relative(outputs[:, :own], model.outputs(states, inputs)) < 1e-11
    # What it is to be given it tells.
    for text, word in ("", "standard input"), (f"2 {STEP}" + len(inputs[0]) * " 0", "step 1"):
        said = subprocess.run([driver], input=text, capture_output=True, text=True, check=False)
        assert said.returncode == 1
        assert word in said.stderr
    if kind == "reduced":
        assert outputs[:, own].max() == pytest.approx(model.trust(states, inputs).indicator)


def errors_of(drivers, integrator, steps):
    """Largest error of a state after 0.4 s of a turn, by step size."""
    signal = vm.Signal.from_samples([0.0, 0.4], [[0.03], [0.03]])
    errors = []
    for step in steps:
        model, driver = drivers(CAR, "full", step=step, integrator=integrator)
        # Held inputs: what is left is the method's own error.
        _, rows = driven(driver, np.full((round(0.4 / step) + 1, 1), 0.03), step)
        times = np.array([0.0, 0.4])
        exact = model.model.simulate(signal, times=times, tolerance=1e-12).states[-1]
        errors.append(np.abs(rows[-1, : len(exact)] - exact).max())
    return errors


def test_the_explicit_step_is_of_order_4_and_accurate(drivers):
    errors = errors_of(drivers, "rk4", (4e-3, 2e-3, STEP))
    assert errors[2] < 1e-8
    assert 10.0 < errors[0] / errors[1] < 26.0


def test_the_implicit_step_is_of_order_2_and_stable_where_the_explicit_one_is_not(drivers):
    # In the turn the Jacobian is no longer that of the start.
    errors = errors_of(drivers, "ros2", (4e-2, 5e-3, 2.5e-3))
    assert errors[0] < 0.05
    assert 3.5 < errors[1] / errors[2] < 4.5
    assert not errors_of(drivers, "rk4", (4e-2,))[0] < 1.0


def test_chosen_outputs_are_computed_alone(drivers, tmp_path):
    names = ["yaw_rate", "lateral_position"]
    model, every = drivers(CAR, "reduced")
    _, few = drivers(CAR, "reduced", outputs=tuple(names))
    inputs = steering(model, 11, STEP)
    n, rows = len(model.states), driven(every, inputs, STEP)[1]
    columns = [n + model.output_names.index(name) for name in names]
    assert np.array_equal(driven(few, inputs, STEP)[1][:, n:], rows[:, columns])
    texts = [(driver.parent / "vehiclemor_model.c").read_text() for driver in (every, few)]
    # No tire is left.
    assert ["atan" in text.split("vehiclemor_outputs")[1] for text in texts] == [True, False]
    with pytest.raises(vm.VehiclemorError, match="yaw_rates"):
        vm.export(CAR, "c", tmp_path / "c", outputs=["yaw_rates"])


@pytest.mark.parametrize("integrator", ["rk4", "ros2"])
@pytest.mark.parametrize("kind", ["full", "reduced"])
def test_single_precision_is_single_everywhere_and_as_accurate(drivers, kind, integrator):
    options = {"integrator": integrator, "step": 0.005}
    model, double = drivers(CAR, kind, **options)
    _, single = drivers(CAR, kind, precision="single", **options)
    inputs = steering(model, 201, 0.005)
    found, wanted = (driven(driver, inputs, 0.005)[1] for driver in (single, double))
    position = len(model.states) + model.output_names.index("lateral_position")
    assert np.abs(wanted[:, position]).max() > 0.1
    assert 0.0 < np.abs(found - wanted)[:, position].max() < 1e-4
    strict = ["-std=c99", "-Wdouble-promotion", "-Wfloat-conversion", "-Werror", "-fsyntax-only"]
    command = ["cc", *strict]
    for part in ("model", "step", "tangent"):
        source = f"vehiclemor_{part}.c"
        assert "double" not in (single.parent / source).read_text().replace("double precision", "")
        subprocess.run([*command, source], cwd=single.parent, check=True)


@pytest.mark.parametrize("kind", ["full", "reduced"])
def test_the_suspension_needs_no_states(drivers, kind):
    model, driver = drivers("double_wishbone", kind)
    t = np.linspace(0.0, 2.0, 41)
    inputs = np.column_stack([0.09 * np.sin(3.0 * t), 0.02 * np.cos(2.0 * t)])
    if kind == "reduced":
        inputs = np.column_stack([0.09 * np.sin(3.0 * t), np.zeros(len(t))])
    _, rows = driven(driver, inputs, 0.05)
    signal = vm.Signal.from_samples(t, inputs)
    run = model.simulate(signal)
    wanted = np.array([np.interp(t, run.times, column) for column in run.outputs.T]).T
    at = np.isin(np.round(t, 9), np.round(run.times, 9))
    assert at.sum() > 5
    assert np.abs(rows[at, :-1] - wanted[at]).max() < 1e-12


def test_the_program_of_the_page_runs(drivers, tmp_path):
    model, driver = drivers("independent_suspension_vehicle", "reduced")
    page = Path(__file__).parents[3] / "docs" / "reduced-models.md"
    (text,) = re.findall(r"```c\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    (tmp_path / "main.c").write_text(text)
    sources = [driver.parent / f"vehiclemor_{part}.c" for part in ("model", "step")]
    command = ["cc", *FLAGS, f"-I{driver.parent}", "-o", "main", "main.c", *sources, "-lm"]
    subprocess.run(command, cwd=tmp_path, check=True)
    printed = subprocess.run([tmp_path / "main"], capture_output=True, text=True, check=True).stdout
    _, rows = driven(driver, np.full((2001, 1), 0.02), STEP)
    assert float(printed) == rows[-1, len(model.states) + 1]
