"""Exported C: it compiles without a warning and does what the model does."""

import re
import shutil
import subprocess
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

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")
STEP = 1e-3


@pytest.fixture(scope="module")
def drivers(tmp_path_factory):
    """(model, kind) -> model in use and compiled driver."""
    made = {}

    def driver(name, kind):
        if (name, kind) not in made:
            folder = tmp_path_factory.mktemp("c") / "car"
            model = in_use(name, kind)
            made[name, kind] = model, compiled(vm.export(model, "c", folder))
        return made[name, kind]

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


def test_the_step_that_is_proposed_is_of_order_4_and_accurate(drivers):
    model, driver = drivers("independent_suspension_vehicle", "full")
    # Held inputs: what is left is the method's own error.
    errors = []
    for step in (4e-3, 2e-3, STEP):
        inputs = np.full((round(0.4 / step) + 1, 1), 0.03)
        _, rows = driven(driver, inputs, step)
        errors.append(rows[-1, :28])
    signal = vm.Signal.from_samples([0.0, 0.4], [[0.03], [0.03]])
    exact = model.model.simulate(signal, times=np.array([0.0, 0.4]), tolerance=1e-12).states[-1]
    errors = [np.abs(found - exact).max() for found in errors]
    assert errors[2] < 1e-8
    assert 10.0 < errors[0] / errors[1] < 26.0


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
