"""Analytic derivatives of full models, by complex step and by models that are made anew."""

import numpy as np
import pytest

from tests.models import MODELS
from tests.oracles import complex_step
from vehiclemor.codegen.derivatives import JacobianProduct
from vehiclemor.exceptions import InputError
from vehiclemor.registry import component
from vehiclemor.simulation.build import build


@pytest.fixture(scope="module")
def runs():
    """Model -> it and its nominal run, whose states can be reached."""
    models = [build(name) for name in MODELS]
    return {m.name: (m, m.simulate(component("maneuver", m.definition.maneuver))) for m in models}


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("independent_suspension_vehicle", ["sprung_mass", "PDY1", "front_axle_distance"]),
        # Springs are set anew for each.
        ("high_fidelity_vehicle", ["chassis_mass", "rear_wheel_centre"]),
    ],
)
def test_parameters_are_those_of_models_made_anew(runs, name, parameters, monkeypatch):
    model, run = runs[name]
    if name == "high_fidelity_vehicle":
        # The 14-DOF vehicle's derivatives are compiled.
        monkeypatch.setattr(JacobianProduct, "_products", complex_step.products)
    sample = np.abs(run.inputs[:, 0]).argmax()
    x, u = run.states[sample], run.inputs[sample]
    # Both models on either side of each number, which both functions are taken of.
    pairs = []
    for parameter in parameters:
        value = np.atleast_1d(model.parameters[parameter])
        for k in range(len(value)):
            step = np.zeros_like(value)
            step[k] = 1e-5 * max(abs(value[k]), 1.0)
            sides = []
            for moved in (value + step, value - step):
                given = moved.tolist() if len(value) > 1 else moved.item()
                try:
                    sides.append(build(name, None, {parameter: given}))
                except InputError:
                    break
            if len(sides) == 2:
                pairs.append((*sides, 2.0 * step[k]))
    for of, function in (("rhs", "derivative"), ("outputs", "outputs")):
        found = model.jacobian(x, u, parameters, of)
        columns = [
            (above.evaluated(function, x, u) - below.evaluated(function, x, u)) / width
            for above, below, width in pairs
        ]
        expected = np.column_stack(columns)
        assert found.shape == expected.shape
        scale = np.maximum(np.abs(expected).max(axis=0), 1e-3)
        np.testing.assert_allclose(found / scale, expected / scale, rtol=1e-6, atol=2e-7)


def test_coordinates_of_a_mechanism_follow_its_inputs_and_its_points(runs):
    model, _ = runs["double_wishbone"]
    u, step = np.array([0.02, -0.01]), 1e-5
    q = model.solve(u)

    def solved(v, **parameters):
        other = build(model.name, None, parameters) if parameters else model
        found = other.solve(v)
        return np.concatenate([found, other.evaluated("outputs", found, v)])

    point = model.parameters["tie_rod_outer"]

    def moved(h):
        return solved(u, tie_rod_outer=(point + h).tolist())

    by_inputs = [(solved(u + h) - solved(u - h)) / (2.0 * step) for h in step * np.eye(2)]
    by_point = [(moved(h) - moved(-h)) / (2.0 * step) for h in step * np.eye(3)]
    for by, expected in (("inputs", by_inputs), ("tie_rod_outer", by_point)):
        found = [model.jacobian(q, u, by, of) for of in ("coordinates", "outputs")]
        np.testing.assert_allclose(np.vstack(found), np.transpose(expected), rtol=0, atol=2e-8)


def test_what_can_not_be_differentiated_is_refused(runs):
    vehicle, mechanism = (runs[name][0] for name in ("independent_suspension_vehicle", MODELS[0]))
    x, u, q = vehicle.start(), [0.0], mechanism.design
    for model, arguments, named in (
        (vehicle, (x, u, "sprung_mas"), "sprung_mas"),
        (vehicle, (x, u, 3), "with_respect_to is 3"),
        (vehicle, (x, u, "state", "forces"), "forces"),
        (vehicle, (x[1:], u), "x has shape"),
        (mechanism, (q, [0.05, 0.0], "inputs", "outputs"), "apart"),
        (mechanism, (q, [0.0, 0.0], "state", "coordinates"), "by inputs or parameters"),
    ):
        with pytest.raises(InputError, match=named):
            model.jacobian(*arguments)
