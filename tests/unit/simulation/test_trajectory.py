"""Trajectories become labelled datasets with units, and errors are measured as named."""

import numpy as np
import pytest

from vehiclemor.inputs.steering import lane_change
from vehiclemor.metrics import max_abs, rms, signal_range
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.simulation.build import build
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


def test_speeds_and_counts_of_a_dynamic_model_are_written() -> None:
    vehicle = build("independent_suspension_vehicle")
    run = vehicle.simulate(lane_change, times=[0.0, 0.5, 2.0])
    dataset, name = trajectory_dataset(vehicle, run), vehicle.speeds[2]
    speed = dataset["speeds"].sel(speed=name)
    np.testing.assert_array_equal(speed, run.speeds[:, 2])
    np.testing.assert_array_equal(run.states, np.hstack((run.coordinates, run.speeds)))
    assert str(speed["speed_unit"].item()) == "m/s"
    assert {count: int(dataset[count]) for count in DYNAMIC_COUNTS} == run.counts
    assert not set(dataset.variables) & (set(ALGEBRAIC_COUNTS) - set(DYNAMIC_COUNTS))


def test_measures_of_an_error() -> None:
    error = np.array([[3.0, 0.0], [-4.0, 1.0]])
    assert rms(error) == pytest.approx([np.sqrt(12.5), np.sqrt(0.5)])
    assert list(max_abs(error)) == [4.0, 1.0]
    assert list(signal_range(error)) == [7.0, 1.0]
    assert np.isnan(rms(np.array([[1.0], [np.nan]]))).all()
