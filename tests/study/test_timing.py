"""The timing pass: cases are known by their names, and nothing is measured twice."""

from dataclasses import replace
from itertools import count

import numpy as np
import pytest

from vehiclemor.reduction.methods.full_order import FullOrder
from vehiclemor.simulation import run_timer
from vehiclemor.simulation.build import build
from vehiclemor.study import timing
from vehiclemor.study.experiment import complete_settings, make_experiment
from vehiclemor.study.scenario import Scenario
from vehiclemor.study.timing import timed_cases, timed_starts, timed_tests

SETTINGS = {
    "pod_r3": ("pod", {"rank": 3}, "recommended"),
    "strongest": ("full_order", {}, "strongest"),
    "replay": ("replay", {}, "recommended"),
    "baseline": ("full_order", {}, "recommended"),
    "stuck": ("full_order", {"tolerance": 1e-300}, "recommended"),
    "pod_r4": ("pod", {"rank": 4}, "recommended"),
}


def cases(*names):
    """Experiments of some cases on the wheel travel, trained on the same."""
    model, run = build("double_wishbone"), (Scenario.of("sine_travel", (1.0, 1.0), "equilibrium"),)
    found = {}
    for name in names:
        method, given, preset = SETTINGS[name]
        settings = complete_settings(model, method, given, preset)
        found[name] = make_experiment(model, method, settings, run, run, "metrics")
    return found


@pytest.fixture(autouse=True)
def _few_rounds(monkeypatch):
    monkeypatch.setattr(timing, "CASE_ROUNDS", 3)
    monkeypatch.setattr(timing, "PROTOCOL_ROUNDS", 4)


def test_speed_ups_are_against_names_wherever_they_stand():
    data = timed_cases(cases("pod_r3", "strongest", "replay", "baseline"))
    assert list(data["case"].values) == ["pod_r3", "strongest", "replay", "baseline"]
    of = {name: data.sel(case=name) for name in data["case"].values}
    assert float(of["baseline"]["speed_up"]) == 1.0
    assert float(of["strongest"]["speed_up_strongest"]) == 1.0
    assert float(of["strongest"]["speed_up"]) > 1.0
    assert (data["loop_seconds"] < data["seconds"]).all()
    assert (data["seconds_lower"] <= data["seconds"]).all()
    assert (data["seconds"] <= data["seconds_upper"]).all()
    assert float(of["pod_r3"]["offline_seconds"]) > 0.0
    assert float(of["baseline"]["offline_seconds"]) == 0.0
    assert int(of["replay"]["iterations"]) == 0
    assert (data["status"] == "ok").all()
    assert float(of["baseline"]["tolerance"]) > 0.0


def test_what_a_model_tells_of_its_own_time_decides_nothing(monkeypatch):
    honest = FullOrder.simulate

    def flattering(self, maneuver, start):
        return replace(honest(self, maneuver, start), seconds=0.0)

    monkeypatch.setattr(FullOrder, "simulate", flattering)
    # A clock that tells how often it has been read: twice more inside of a call.
    monkeypatch.setattr(run_timer, "clock", count(0.0, 1e-3).__next__)
    data = timed_cases(cases("strongest", "baseline"))
    assert float(data["loop_seconds"].sel(case="baseline")) == 0.0
    np.testing.assert_allclose(data["seconds"], 3e-3)
    np.testing.assert_allclose(data["speed_up"], 1.0)


def test_inputs_are_new_and_no_row_is_timed_cold_whatever_ran_before_it(monkeypatch):
    now, last, seen = [0.0], [], set()
    honest = FullOrder.simulate

    def simulate(self, maneuver, start):
        # A run after another model's finds its caches cold; one of an input that is known is short.
        now[0] += (1e-4 if maneuver in seen else 1e-2) * (1 if last == [self] else 3)
        seen.add(maneuver)
        last[:] = [self]
        return honest(self, maneuver, start)

    monkeypatch.setattr(FullOrder, "simulate", simulate)
    monkeypatch.setattr(run_timer, "clock", lambda: now[0])
    data = timed_tests(cases("strongest", "baseline"), np.ones((2, 1), dtype=bool))
    np.testing.assert_allclose(data["seconds"], 1e-2)
    np.testing.assert_allclose(data["repeated_seconds"], 1e-4)


def test_what_was_measured_is_measured_again_only_if_it_has_changed(tmp_path):
    path = tmp_path / "studies" / "mine.nc"
    first = timed_starts({"equilibrium": cases("pod_r3", "baseline")}, path)
    assert (first.sizes["start"], first.sizes["case"]) == (1, 2)
    written = path.stat().st_mtime_ns
    again = timed_starts({"equilibrium": cases("pod_r3", "baseline")}, path)
    assert path.stat().st_mtime_ns == written
    np.testing.assert_array_equal(again["seconds"], first["seconds"])
    timed_starts({"equilibrium": cases("pod_r4", "baseline")}, path)
    assert path.stat().st_mtime_ns > written


def test_a_fit_is_timed_with_all_inputs_of_its_training():
    model = build("independent_suspension_vehicle")
    steered, braked = (
        Scenario.of(name, (1.0, 1.0), "equilibrium") for name in ("lane_change", "braking_in_turn")
    )
    settings = complete_settings(model, "replay", {}, "recommended")
    replay = make_experiment(model, "replay", settings, (steered, braked), (steered,), "errors")
    data = timed_tests({"replay": replay}, np.ones((1, 1), dtype=bool))
    assert (data["seconds"] > 0.0).all()
