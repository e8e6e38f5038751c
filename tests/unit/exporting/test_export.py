"""Exported systems give the model's numbers over the values of other libraries; refusals."""

import numpy as np
import pytest

import vehiclemor as vm
from tests.models import CAR
from tests.reducing import fitted
from tests.unit.exporting.programs import in_use, relative
from vehiclemor.cli import main
from vehiclemor.exporting import libraries
from vehiclemor.exporting.export import system_of
from vehiclemor.reduction.reduced_model import ReducedOrderModel


def around(model, rng, samples=3):
    """States and inputs near the start."""
    start = model.state()
    states = start + 1e-3 * rng.standard_normal((samples, len(start)))
    return states, 5e-3 * rng.standard_normal((samples, len(model.inputs)))


def wanted(model, states, inputs):
    rates = np.array([model.rhs(x, u) for x, u in zip(states, inputs, strict=True)])
    return rates, model.outputs(states, inputs)


def agree(found, states, model, inputs):
    """Rates and outputs; the first to 1e-12, the others lose digits to slips."""
    rates, outputs = wanted(model, states, inputs)
    assert np.abs(found[0] - rates).max() <= 1e-12 * np.abs(rates).max()
    assert relative(found[1][:, : outputs.shape[1]], outputs) < 1e-10


@pytest.mark.parametrize(
    ("name", "kind"),
    [("independent_suspension_vehicle", "full"), ("high_fidelity_vehicle", "reduced")],
)
def test_casadi(name, kind, rng, tmp_path):
    casadi = pytest.importorskip("casadi")
    model = in_use(name, kind)
    function = vm.export(model, "casadi")
    parameters = system_of(model).values
    states, inputs = around(model, rng)
    found = function(states.T, inputs.T, parameters)
    agree([part.full().T for part in found], states, model, inputs)
    x, u = (casadi.SX.sym(name, len(a)) for name, a in (("x", states[0]), ("u", inputs[0])))
    by_state = casadi.Function("j", [x, u], [casadi.jacobian(function(x, u, parameters)[0], x)])
    error = np.array(by_state(states[0], inputs[0])) - model.jacobian(states[0], inputs[0])
    assert np.abs(error).max() <= 1e-12 * np.abs(model.jacobian(states[0], inputs[0])).max()
    path = vm.export(model, "casadi", tmp_path / "car.casadi")
    kept = casadi.Function.load(str(path))
    assert (kept(states.T, inputs.T, parameters)[0].full() == found[0].full()).all()


def test_jax_over_a_batch_and_by_tables(rng):
    jax = pytest.importorskip("jax")
    jax.config.update("jax_enable_x64", True)
    model = in_use("independent_suspension_vehicle", "reduced")
    states, inputs = around(model, rng)
    found = jax.jit(jax.vmap(vm.export(model, "jax")))(states, inputs)
    agree([np.asarray(part) for part in found], states, model, inputs)
    model = vm.rom("double_wishbone")
    inputs = np.array([[0.05, 0.0], [-0.02, 0.0]])
    run = model.simulate(vm.Signal.from_samples([0.0, 1.0], inputs))
    ends = [0, -1]
    _, outputs = jax.vmap(vm.export(model, "jax"))(np.zeros((2, 0)), inputs)
    assert np.abs(np.asarray(outputs)[:, :-1] - run.outputs[ends]).max() < 1e-13


@pytest.mark.parametrize(
    ("model", "arguments", "words"),
    [
        (CAR, {"to": "matlab"}, "'matlab'"),
        (CAR, {"to": "c", "step": 0.0}, "step: 0 s"),
        (CAR, {"to": "jax", "out": "car.py"}, "jax"),
        (CAR, {"to": "jax", "precision": "single"}, "not for jax"),
        ("double_wishbone", {"to": "c", "integrator": "ros2"}, "no states"),
    ],
)
def test_wrong_arguments(tmp_path, monkeypatch, model, arguments, words):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(vm.VehiclemorError, match=words):
        vm.export(model, **arguments)
    assert not list(tmp_path.iterdir())


def test_what_has_no_equations_to_export(model, nominal, monkeypatch):
    reduced = fitted(model, nominal, "pod", rank=2)
    with pytest.raises(vm.VehiclemorError, match="double_wishbone_pod"):
        vm.export(ReducedOrderModel(model, "pod", {}, (), reduced), "casadi")
    with pytest.raises(vm.VehiclemorError, match="table"):
        vm.export(vm.rom("double_wishbone"), "casadi")
    # Missing packages are named.
    monkeypatch.setattr(libraries, "find_spec", lambda _: None)
    with pytest.raises(vm.VehiclemorError, match=r"vehiclemor\[casadi\]"):
        vm.export(vm.rom(CAR), "casadi")


def test_a_compiler_that_fails(tmp_path, monkeypatch):
    monkeypatch.setenv("CC", "false")
    with pytest.raises(vm.VehiclemorError, match="can't compile the model: status 1"):
        vm.export(vm.rom(CAR), "fmu", tmp_path / "car.fmu")
    assert not list(tmp_path.iterdir())


def test_nothing_is_replaced_unasked(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    command = ["export", CAR, "--method", "shipped", "--to", "c"]
    assert main(command) == 0
    folder = tmp_path / f"{CAR}_{vm.rom(CAR).method}"
    assert capsys.readouterr().out == f"written: {folder.name}\n"
    written = {path.name: path.read_text() for path in folder.iterdir()}
    assert main(command) == 2
    assert "--overwrite" in capsys.readouterr().err
    (folder / "vehiclemor_model.c").write_text("")
    assert main([*command, "--overwrite"]) == 0
    assert {path.name: path.read_text() for path in folder.iterdir()} == written
    assert [path.name for path in tmp_path.iterdir()] == [folder.name]
