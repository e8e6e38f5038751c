"""Models of every kind are built by one function, behind one interface."""

from dataclasses import replace

import numpy as np
import pytest

from vehiclemor.errors import InputError
from vehiclemor.maneuver import Maneuver
from vehiclemor.registry import component
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.simulation.build import build
from vehiclemor.simulation.trajectory import Trajectory


def test_kinematic_model_is_built_with_file_and_overrides() -> None:
    moved = build("double_wishbone", overrides={"wheel_centre": [0.0, 0.8, -0.12]})
    assert isinstance(moved, AlgebraicModel)
    assert moved.parameters["wheel_centre"][1] == 0.8
    assert moved.evaluations in moved.counts


def test_model_of_an_unknown_kind_is_one_line() -> None:
    with pytest.raises(InputError) as error:
        replace(component("model", "double_wishbone"), name="waves", kind="pde")
    assert str(error.value) == "model 'waves' is of kind 'pde'; allowed: ae, ode, dae"


def test_start_and_defaults_of_a_simulation(
    model: AlgebraicModel, nominal: Maneuver, full: Trajectory
) -> None:
    run = model.simulate(nominal, "equilibrium", nominal.times, "newton", 1e-12)
    np.testing.assert_array_equal(run.states, full.states)
    with pytest.raises(InputError, match="unknown start 'upside_down'"):
        model.simulate(nominal, "upside_down")
