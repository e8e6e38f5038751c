"""Times are CPU times of the thread."""

import time

from vehiclemor.simulation import run_timer
from vehiclemor.simulation.run_timer import timed
from vehiclemor.simulation.trajectory_dataset import trajectory_dataset
from vehiclemor.study.result import variables


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
