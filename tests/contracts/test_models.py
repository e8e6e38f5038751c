"""What every registered kinematic model keeps."""

import numpy as np
import pytest

from vehiclemor.maneuver import Maneuver
from vehiclemor.multibody.quantities import Quantity
from vehiclemor.registry import component, names
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.simulation.build import build
from vehiclemor.simulation.trajectory_dataset import trajectory_dataset

SI_UNITS = {"m", "rad", "m/s", "rad/s", "m/s^2", "rad/s^2", "N", "N m", "1"} | {
    "kg",
    "kg m^2",
    "N/m",
    "N/rad",
    "1/s",
    "N s/m",
}
KINEMATIC = [name for name in names("model") if component("model", name).kind == "ae"]


@pytest.fixture(scope="module", params=KINEMATIC)
def any_model(request: pytest.FixtureRequest) -> AlgebraicModel:
    return build(request.param)


@pytest.fixture(scope="module")
def its_maneuver(any_model: AlgebraicModel) -> Maneuver:
    return component("maneuver", component("model", any_model.name).maneuver)


@pytest.mark.parametrize("name", names("model"))
def test_definition_describes_itself(name: str) -> None:
    definition = component("model", name)
    assert name == definition.name
    assert definition.kind in ("ode", "ae", "dae")
    assert definition.summary
    assert "\n" not in definition.summary
    assert definition.maneuver in names("maneuver")
    assert {declared.unit for declared in definition.parameters.values()} <= SI_UNITS


def test_quantities_have_unique_names_units_and_meanings(any_model: AlgebraicModel) -> None:
    equations = any_model.definition
    kinds: tuple[tuple[Quantity, ...], ...] = (
        equations.coordinates,
        equations.inputs,
        equations.outputs,
        equations.equations,
    )
    for quantities in kinds:
        assert len({quantity.name for quantity in quantities}) == len(quantities) > 0
        for quantity in quantities:
            assert quantity.name.isidentifier()
            assert quantity.unit in SI_UNITS
            assert quantity.long_name
    assert len(equations.equations) == len(equations.coordinates)


def test_every_parameter_has_a_source(any_model: AlgebraicModel) -> None:
    declared = component("model", any_model.name).parameters
    assert list(any_model.parameters.entries) == list(declared)
    for name, entry in any_model.parameters.entries.items():
        assert entry.unit == declared[name].unit
        assert entry.source
        assert entry.description


def test_design_position_solves_the_equations(any_model: AlgebraicModel) -> None:
    nothing = np.zeros(len(any_model.inputs))
    assert np.abs(any_model.residual(any_model.design, nothing)).max() < 1e-12
    np.testing.assert_allclose(any_model.solve(nothing), any_model.design, rtol=0, atol=1e-11)


def test_jacobian_and_newton_step_are_consistent_with_the_residual(
    any_model: AlgebraicModel,
) -> None:
    rng, n = np.random.default_rng(0), len(any_model.coordinates)
    for _ in range(3):
        q, u = any_model.design + rng.normal(0.0, 0.05, n), np.zeros(len(any_model.inputs))
        jacobian, step = any_model.jacobian(q, u), 1e-6
        columns = [
            any_model.residual(q + step * e, u) - any_model.residual(q - step * e, u)
            for e in np.eye(n)
        ]
        np.testing.assert_allclose(jacobian, np.array(columns).T / (2 * step), rtol=0, atol=1e-8)
        dense = np.linalg.solve(jacobian, any_model.residual(q, u))
        np.testing.assert_allclose(any_model.newton_step(q, u), dense, rtol=0, atol=1e-11)


def test_nominal_maneuver_can_be_solved(any_model: AlgebraicModel, its_maneuver: Maneuver) -> None:
    run = any_model.simulate(its_maneuver)
    assert run.status == "ok"
    assert run.coordinates.shape == (its_maneuver.samples, len(any_model.coordinates))
    assert run.outputs.shape == (its_maneuver.samples, len(any_model.outputs))
    assert np.abs(any_model.residual_at(run.coordinates, run.inputs)).max() < 1e-11
    assert np.isfinite(run.outputs).all()
    dataset = trajectory_dataset(any_model, run)
    assert tuple(dataset["coordinate"].values) == any_model.coordinates
    assert tuple(dataset["output"].values) == any_model.outputs


def test_range_of_reach_holds_the_design_position(any_model: AlgebraicModel) -> None:
    low, high = any_model.reach()
    assert low < 0.0 < high


def test_building_again_gives_the_same_kernels(any_model: AlgebraicModel) -> None:
    again = build(any_model.name)
    assert again.kernel_hash == any_model.kernel_hash
    np.testing.assert_array_equal(again.constants, any_model.constants)


def test_operations_are_counted(any_model: AlgebraicModel) -> None:
    counts = any_model.operation_counts
    for name in ("residual", "residual_jacobian", "newton_step", "outputs"):
        assert counts[name]["total"] > 0
    assert counts["residual"]["total"] < counts["residual_jacobian"]["total"]
    assert counts["residual_jacobian"]["total"] < counts["newton_step"]["total"]
