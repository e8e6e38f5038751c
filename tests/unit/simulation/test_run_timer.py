"""Times are CPU times, and medians of runs that found the caches warm."""

import time
from itertools import accumulate

import numpy as np
import pytest

from vehiclemor.maneuver import sine_travel
from vehiclemor.simulation import run_timer
from vehiclemor.simulation.build import build
from vehiclemor.simulation.run_timer import repeated, timed
from vehiclemor.simulation.trajectory_dataset import trajectory_dataset
from vehiclemor.study.variables import variables


def scripted(monkeypatch, lengths):
    """A clock between whose readings lie 0 (between runs) and the given times."""
    steps = [0.0, *(step for length in lengths for step in (length, 0.0))]
    readings = accumulate(steps)
    monkeypatch.setattr(run_timer, "clock", lambda: next(readings))


def test_the_clock_does_not_run_while_others_have_the_processor():
    assert run_timer.clock is time.thread_time


def test_the_first_run_warms_the_caches_and_the_median_of_the_others_counts(monkeypatch):
    scripted(monkeypatch, [100.0, 3.0, 50.0, 2.0])
    counts, calls = np.zeros(1), []

    def run():
        counts[0] += 7.0
        calls.append(len(calls))
        return calls[-1]

    with repeated(4):
        assert timed(run, counts) == (3, 3.0)
    assert counts[0] == 7.0


def test_one_run_alone_counts(monkeypatch):
    scripted(monkeypatch, [5.0])
    assert timed(lambda: "done", np.zeros(1)) == ("done", 5.0)


@pytest.mark.parametrize("name", ["seconds", "seconds_median", "seconds_lower"])
def test_stored_seconds_name_their_clock(name):
    assert variables({name: 1.0})[name][2]["clock"] == run_timer.CLOCK
    assert variables({"offline_seconds": 1.0})["offline_seconds"][2]["clock"] != run_timer.CLOCK


def test_seconds_of_a_simulation_name_their_clock():
    model = build("double_wishbone")
    dataset = trajectory_dataset(model, model.simulate(sine_travel))
    assert dataset["seconds"].attrs["clock"] == run_timer.CLOCK
