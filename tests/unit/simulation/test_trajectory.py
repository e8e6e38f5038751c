"""Trajectories become labelled datasets with units; errors and times are measured as named."""

import time

import numpy as np
import pytest

from vehiclemor.metrics import max_abs, rms, signal_range
from vehiclemor.simulation import run_timer
from vehiclemor.simulation.run_timer import timed
from vehiclemor.simulation.trajectory import (
    ALGEBRAIC_COUNTS,
    trajectory_dataset,
)
from vehiclemor.study.result import variables


def test_dataset_is_labelled_with_names_and_units(model, full):
    further = {"error": ("output", np.arange(6.0), {"units": "see output_unit"})}
    dataset = trajectory_dataset(model, full, further)
    outputs = len(model.outputs)
    assert dataset.sizes == {"time": 1001, "coordinate": 8, "output": outputs, "input": 2}
    eta = dataset["coordinates"].sel(coordinate="eta")
    np.testing.assert_array_equal(eta, full.coordinates[:, model.coordinates.index("eta")])
    np.testing.assert_array_equal(dataset["outputs"].sel(output="second_euler_angle"), eta)
    np.testing.assert_array_equal(dataset["inputs"].sel(input="z"), full.inputs[:, 0])
    np.testing.assert_array_equal(dataset["error"], np.arange(6.0))
    assert {count: int(dataset[count]) for count in ALGEBRAIC_COUNTS} == full.counts
    assert all(v.attrs.get("long_name") for k, v in dataset.variables.items() if k != "error")
    assert all(dataset[name].attrs["units"] for name in ("seconds", "time", *ALGEBRAIC_COUNTS))
    # There is a unit where all have it; outputs are in m and rad: each has its own beside it.
    assert dataset["inputs"].attrs["units"] == "m"
    for name in ("outputs", "error", "coordinates"):
        assert "units" not in dataset[name].attrs
        label = "coordinate" if name == "coordinates" else "output"
        assert set(dataset[name][f"{label}_unit"].values) == {"m", "rad"}
    own = dataset["outputs"].sel(output="second_euler_angle")["output_unit"]
    assert str(own.item()) == "rad"


def test_measures_of_an_error():
    error = np.array([[3.0, 0.0], [-4.0, 1.0]])
    assert rms(error) == pytest.approx([np.sqrt(12.5), np.sqrt(0.5)])
    assert list(max_abs(error)) == [4.0, 1.0]
    assert list(signal_range(error)) == [7.0, 1.0]
    assert np.isnan(rms(np.array([[1.0], [np.nan]]))).all()


def test_the_clock_does_not_run_while_others_have_the_processor():
    assert run_timer.clock is time.thread_time


def test_the_clock_is_read_around_a_run(monkeypatch):
    monkeypatch.setattr(run_timer, "clock", iter((2.0, 7.0)).__next__)
    assert timed(lambda: "done") == ("done", 5.0)


def test_stored_seconds_name_their_clock(model, full):
    for name in ("seconds", "seconds_median", "seconds_lower"):
        assert variables({name: 1.0})[name][2]["clock"] == run_timer.CLOCK
    assert variables({"offline_seconds": 1.0})["offline_seconds"][2]["clock"] != run_timer.CLOCK
    assert trajectory_dataset(model, full)["seconds"].attrs["clock"] == run_timer.CLOCK
