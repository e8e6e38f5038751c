"""Exported systems over the values of other libraries: all give the model's numbers."""

import numpy as np
import pytest
import sympy as sp

import vehiclemor as vm
from tests.unit.exporting.programs import in_use, relative
from vehiclemor.exporting.export import system_of


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


@pytest.mark.parametrize("name", ["independent_suspension_vehicle", "high_fidelity_vehicle"])
def test_a_full_model_tells_the_parameters_of_its_function(name):
    pytest.importorskip("casadi")
    model = vm.model(name)
    x, u = model.start(), [0.01, *[0.0] * (len(model.inputs) - 1)]
    rates = vm.export(model, "casadi")(x, u, model.parameter_values)[0].full().ravel()
    np.testing.assert_allclose(rates, model.rhs(x, u), rtol=1e-10, atol=1e-9)


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


def test_sympy(rng):
    model = in_use("independent_suspension_vehicle", "full")
    states, inputs = around(model, rng)
    expressions = vm.export(model, "sympy")
    assert [symbol.name for symbol in expressions.x] == list(model.states)
    values = system_of(model).values
    found = []
    for results in (expressions.derivative, expressions.outputs):
        function = sp.lambdify(
            [expressions.x, expressions.u, expressions.p],
            results,
            modules="math",
            cse=lambda _, results=results: (expressions.assignments, [*results]),
        )
        rows = [function(x, u, values) for x, u in zip(states, inputs, strict=True)]
        found.append(np.array(rows))
    agree(found, states, model, inputs)
