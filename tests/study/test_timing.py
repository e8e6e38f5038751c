"""The timing pass: cases are known by their ids, and nothing is measured twice."""

from dataclasses import replace
from itertools import accumulate, count

import numpy as np
import pytest

from vehiclemor.inputs.signal import Signal
from vehiclemor.inputs.suspension import sine_travel
from vehiclemor.reduction.methods.full_order import FullOrderModel
from vehiclemor.simulation import run_timer
from vehiclemor.simulation.build import build
from vehiclemor.simulation.trajectory import Trajectory
from vehiclemor.study import timing
from vehiclemor.study.scenario import Scenario
from vehiclemor.study.timing import (
    TimingCase,
    called,
    case_experiments,
    timed_cases,
    timed_model,
    timed_tests,
)

CASES = (
    TimingCase("pod_r3", "pod r=3", "pod", settings={"rank": 3}),
    TimingCase("strongest", "the best", "full_order", "strongest"),
    TimingCase("replay", "replay", "replay"),
    TimingCase("baseline", "Newton", "full_order"),
)


@pytest.fixture(scope="module")
def suspension():
    return build("double_wishbone")


def test_speed_ups_are_against_ids_wherever_they_stand(suspension):
    data = timed_cases(suspension, CASES, sine_travel, "equilibrium", 3)
    assert list(data["case"].values) == ["pod_r3", "strongest", "replay", "baseline"]
    assert float(data["speed_up"].sel(case="baseline")) == 1.0
    assert float(data["speed_up_strongest"].sel(case="strongest")) == 1.0
    assert float(data["speed_up"].sel(case="strongest")) > 1.0
    assert np.isnan(float(data["loop_speed_up"].sel(case="replay")))
    assert (data["loop_seconds"] < data["seconds"]).all()
    assert (data["seconds_lower"] <= data["seconds"]).all()
    assert (data["seconds"] <= data["seconds_upper"]).all()
    assert float(data["offline_seconds"].sel(case="pod_r3")) > 0.0
    assert float(data["offline_seconds"].sel(case="baseline")) == 0.0
    assert int(data["iterations"].sel(case="replay")) == 0
    assert (data["status"] == "ok").all()


def test_what_a_model_tells_of_its_own_time_decides_nothing(suspension, monkeypatch):
    honest = FullOrderModel.simulate

    def flattering(self, maneuver, start):
        return replace(honest(self, maneuver, start), seconds=0.0)

    monkeypatch.setattr(FullOrderModel, "simulate", flattering)
    # A clock that tells how often it has been read: twice more inside of a call.
    monkeypatch.setattr(run_timer, "clock", count(0.0, 1e-3).__next__)
    data = timed_cases(suspension, CASES[1::2], sine_travel, "equilibrium", 2)
    assert float(data["loop_seconds"].sel(case="baseline")) == 0.0
    assert np.isnan(data["loop_speed_up"]).all()
    np.testing.assert_allclose(data["seconds"], 3e-3)
    np.testing.assert_allclose(data["speed_up"], 1.0)


def test_no_row_is_timed_cold_whatever_ran_before_it(suspension, monkeypatch):
    now, last, seen = [0.0], [], set()
    honest = FullOrderModel.simulate

    def simulate(self, maneuver, start):
        # A run of a new input is long, and one after another model's finds its caches cold.
        now[0] += 1e-4 * (1 if last == [self] else 3) + (maneuver not in seen)
        seen.add(maneuver)
        last[:] = [self]
        return honest(self, maneuver, start)

    monkeypatch.setattr(FullOrderModel, "simulate", simulate)
    monkeypatch.setattr(run_timer, "clock", lambda: now[0])
    experiments = case_experiments(suspension, CASES[1::2], sine_travel, "equilibrium")
    data = timed_tests(experiments, np.ones((2, 1), dtype=bool), 4)
    np.testing.assert_allclose(data["seconds"], 1e-4)


def test_the_first_call_warms_the_caches_and_the_median_of_the_others_counts(monkeypatch):
    lengths = [100.0, 3.0, 50.0, 2.0]
    steps = accumulate([0.0, *(step for length in lengths for step in (length, 0.0))])
    monkeypatch.setattr(run_timer, "clock", lambda: next(steps))
    ended = Trajectory(*[np.zeros((1, 1))] * 5, {}, 7.0)
    assert called(lambda: ended, 4) == (3.0, 7.0)
    monkeypatch.setattr(run_timer, "clock", count().__next__)
    assert called(lambda: replace(ended, status="diverged"), 1).status == "diverged"


def test_a_case_that_fails_has_no_seconds_and_no_baseline_gives_no_speed_up(suspension):
    stuck = TimingCase("stuck", "stuck", "full_order", settings={"tolerance": 1e-300})
    data = timed_cases(suspension, (CASES[0], stuck), sine_travel, "equilibrium", 2)
    assert "speed_up" not in data
    assert data["status"].values.tolist() == ["ok", "diverged"]
    assert np.isfinite(data["seconds"]).values.tolist() == [True, False]


def test_what_was_measured_is_measured_again_only_if_it_has_changed(
    suspension, tmp_path, monkeypatch
):
    monkeypatch.setattr(timing, "CASE_ROUNDS", 2)
    first = timed_model(suspension, CASES, tmp_path, "mine")
    assert dict(first.sizes) == {"start": 1, "case": 4, "output": len(suspension.outputs)}
    path = tmp_path / "studies" / "mine.nc"
    written = path.stat().st_mtime_ns
    again = timed_model(suspension, CASES, tmp_path, "mine")
    assert path.stat().st_mtime_ns == written
    np.testing.assert_array_equal(again["seconds"], first["seconds"])
    other = (replace(CASES[0], settings={"rank": 4}), *CASES[1:])
    timed_model(suspension, other, tmp_path, "mine")
    assert path.stat().st_mtime_ns > written


def test_inputs_are_known_by_their_values_and_names():
    def constant(value):
        return replace(sine_travel, signal=lambda times, *_: np.full((len(times), 2), value))

    def log(name):
        return Signal.from_samples([0.0, 1.0], [0.0, 0.01], inputs=[name])

    given = constant(0.0), constant(-0.0), constant(0.01), log("z"), log("s0")
    zero, minus_zero, *others = [Scenario(each, "equilibrium").run_key for each in given]
    assert zero == minus_zero
    assert len({zero, *others}) == 4
