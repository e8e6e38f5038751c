"""Trajectories become labelled datasets with units, and errors are measured as named."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from vehiclemor.metrics import max_abs, rms, signal_range
from vehiclemor.multibody.quantities import Quantity
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.simulation.trajectory import (
    ALGEBRAIC_COUNTS,
    DYNAMIC_COUNTS,
    Trajectory,
)
from vehiclemor.simulation.trajectory_dataset import trajectory_dataset


def test_dataset_is_labelled_with_names_and_units(model: AlgebraicModel, full: Trajectory) -> None:
    dataset = trajectory_dataset(model, full)
    eta = dataset["coordinates"].sel(coordinate="eta")
    np.testing.assert_array_equal(eta, full.coordinates[:, model.coordinates.index("eta")])
    angle = dataset["outputs"].sel(output="second_euler_angle")
    np.testing.assert_array_equal(angle, eta)
    assert str(angle["output_unit"].item()) == "rad"
    assert str(dataset["outputs"].sel(output="spindle_y")["output_unit"].item()) == "m"
    assert dataset.sizes == {
        "time": 1001,
        "coordinate": 8,
        "output": len(model.outputs),
        "input": 2,
    }
    np.testing.assert_array_equal(dataset["inputs"].sel(input="z"), full.inputs[:, 0])
    for name in ALGEBRAIC_COUNTS:
        assert int(dataset[name]) == full.counts[name]
    for variable in dataset.variables.values():
        assert variable.attrs.get("long_name")
    for name in ("inputs", "seconds", "time", *ALGEBRAIC_COUNTS):
        assert dataset[name].attrs["units"]


def test_there_is_a_unit_where_all_have_it(model: AlgebraicModel, full: Trajectory) -> None:
    further = {"error": ("output", np.arange(6.0), {"units": "see output_unit"})}
    dataset = trajectory_dataset(model, full, further)
    assert dataset["inputs"].attrs["units"] == "m"
    # Outputs are in m and rad: each has its own beside it.
    for name, unit in {
        "outputs": "output_unit",
        "error": "output_unit",
        "coordinates": "coordinate_unit",
    }.items():
        assert "units" not in dataset[name].attrs
        assert set(dataset[name][unit].values) == {"m", "rad"}
    np.testing.assert_array_equal(dataset["error"], np.arange(6.0))


class Declared(SimpleNamespace):
    """Stands for a model's definition, by which labels are kept."""

    __hash__ = object.__hash__


def test_speeds_and_counts_of_a_dynamic_model_are_written(
    model: AlgebraicModel, full: Trajectory
) -> None:
    definition = Declared(
        coordinates=model.definition.coordinates,
        speeds=(Quantity("forward", "m/s", "speed to the front"),),
        inputs=model.definition.inputs,
        outputs=model.definition.outputs,
    )
    speeds = np.linspace(0.0, 1.0, 1001)[:, None]
    run = replace(full, speeds=speeds, counts=dict.fromkeys(DYNAMIC_COUNTS, 7))
    np.testing.assert_array_equal(run.states, np.hstack((full.coordinates, speeds)))
    dynamic = SimpleNamespace(definition=definition, counts=DYNAMIC_COUNTS)
    dataset = trajectory_dataset(dynamic, run)
    forward = dataset["speeds"].sel(speed="forward")
    np.testing.assert_array_equal(forward, speeds[:, 0])
    assert str(forward["speed_unit"].item()) == "m/s"
    assert int(dataset["rhs_calls"]) == 7
    assert not set(dataset.variables) & (set(ALGEBRAIC_COUNTS) - set(DYNAMIC_COUNTS))


def test_measures_of_an_error() -> None:
    error = np.array([[3.0, 0.0], [-4.0, 1.0]])
    assert rms(error) == pytest.approx([np.sqrt(12.5), np.sqrt(0.5)])
    assert list(max_abs(error)) == [4.0, 1.0]
    assert list(signal_range(error)) == [7.0, 1.0]
    assert np.isnan(rms(np.array([[1.0], [np.nan]]))).all()
