"""What every registered model keeps."""

import numpy as np
import pytest

from vehiclemor.contracts import check_model
from vehiclemor.registry import component, names
from vehiclemor.simulation.build import build

OF_FORCES = {"N", "N m", "N/m", "N/m^2", "N/rad", "N s/m", "kg", "kg m^2", "kg/m^3"}
SI_UNITS = {"m", "rad", "m/s", "rad/s", "m/s^2", "rad/s^2", "1", "1/s", "Hz", "s/m", *OF_FORCES}
KINEMATIC = [name for name in names("model") if component("model", name).kind == "ae"]


@pytest.mark.parametrize("name", names("model"))
def test_a_model_keeps_its_contract_and_names_units_and_sources(name):
    check_model(name)
    definition, entries = component("model", name), build(name).parameters.entries
    for text in (definition.summary, *(entry.description for entry in entries.values())):
        assert text
        assert "\n" not in text
    for kind in ("coordinates", "speeds", "inputs", "outputs", "equations", "ports"):
        quantities = getattr(definition, kind)
        assert len({quantity.name for quantity in quantities}) == len(quantities)
        assert all(quantity.name.isidentifier() for quantity in quantities)
        assert {quantity.unit for quantity in quantities} <= SI_UNITS
    assert list(entries) == list(definition.parameters)
    for parameter, entry in entries.items():
        assert entry.unit == definition.parameters[parameter].unit
        assert entry.unit in SI_UNITS
        assert entry.source


@pytest.fixture(scope="module", params=KINEMATIC)
def any_model(request):
    return build(request.param)


def test_design_position_solves_the_equations_within_reach(any_model):
    nothing = np.zeros(len(any_model.inputs))
    assert np.abs(any_model.residual(any_model.design, nothing)).max() < 1e-12
    np.testing.assert_allclose(any_model.solve(nothing), any_model.design, rtol=0, atol=1e-11)
    low, high = any_model.reach()
    assert low < 0.0 < high


def test_newton_steps_solve_with_the_jacobian(any_model):
    rng, u = np.random.default_rng(0), np.zeros(len(any_model.inputs))
    for _ in range(3):
        q = any_model.design + rng.normal(0.0, 0.05, len(any_model.coordinates))
        dense = np.linalg.solve(any_model.jacobian(q, u), any_model.residual(q, u))
        np.testing.assert_allclose(
            any_model.evaluated("newton_step", q, u), dense, rtol=0, atol=1e-11
        )
