"""Comparisons with the paper and of a model: rows, verdicts, screens, tables."""

import json

import numpy as np
import pytest
from claims import CRITERIA, claim_rows, stored_results

import vehiclemor as vm
from tests.models import MODELS, VEHICLES
from vehiclemor.cli import main
from vehiclemor.report.comparison import at_published_start, cost_table, paper_comparison, timing_of
from vehiclemor.report.published import LARGEST_SPREAD, TIMING, judged, load_published, time_saved
from vehiclemor.study.run import run_studies


@pytest.fixture(scope="module")
def rows(results_folder):
    return paper_comparison(results_folder)


def test_every_published_number_has_a_row(rows):
    published = load_published()
    compared = {n.id for n in published.values() if n.kind in ("rms_error", "time_reduction")}
    assert set(rows["id"]) == compared
    assert set(rows["model"]) == {*MODELS}


def test_verdicts_follow_from_the_numbers(rows, results_folder):
    errors = rows[rows["id"].str.contains("_rms_")]
    assert len(errors) == 2 * 6
    for row in errors.to_dict("records"):
        assert row["bound"] == row["published"]
        assert row["verdict"] == ("met" if row["reproduced"] <= row["published"] else "missed")
        assert row["replay"] == 0.0
        assert row["floor"] > 0.0
    assert (errors[errors["variant"] == "default"]["verdict"] == "met").all()
    place = {"label": "full_order", "output": "spindle_y"}
    data = run_studies("paper", results_folder)["figures-6-7"]
    signal = data["reference_outputs"].sel(place).isel(rank=0).squeeze().values
    found = rows[rows["id"] == "dw_rms_spindle_y"]["signal_rms"]
    np.testing.assert_allclose(found, np.linalg.norm(signal) / np.sqrt(signal.size), rtol=1e-12)


@pytest.fixture
def timings(results_folder):
    """Timings whose rounds do not scatter, whatever this machine was doing."""
    found = {}
    for model, name in TIMING.items():
        data = at_published_start(timing_of(model, results_folder)).copy(deep=True)
        found[name] = data.assign(
            seconds_lower=0.995 * data["seconds"],
            seconds_upper=1.005 * data["seconds"],
            speed_up=5.0 + 0.0 * data["speed_up"],
            speed_up_strongest=0.25 + 0.0 * data["speed_up"],
        )
    return found


def saving(timings, **changes):
    """Finding on the high-fidelity vehicle's time, with changed variables at some cases."""
    name = TIMING[VEHICLES[1]]
    data = timings[name].copy(deep=True)
    for variable, (value, place) in changes.items():
        data[variable].loc[place] = value
    return time_saved(load_published()["hfv_time_reduction"], {name: data}, "pod")


def verdict_of(timings, **changes):
    finding = saving(timings, **changes)
    return judged(finding.within), finding.reason


def test_time_saved_counts_only_where_errors_are_met_and_rounds_agree(timings):
    plain = saving(timings)
    assert judged(plain.within) == "met"
    # Beside it stands the time of the fastest solver.
    assert (plain.reproduced, plain.strongest) == pytest.approx((0.8, 4.0))
    assert plain.reason.startswith("0.20 times the time of the same integrator, ")
    assert plain.reason.endswith("; 4.00 times that of the best full-order solver")
    assert verdict_of(timings, speed_up=(1.01, {"case": "pod_r1"}))[0] == "missed"
    wrong = {"rms_error": (0.0144, {"case": "pod_r1", "output": "vertical_speed"})}
    verdict, reason = verdict_of(timings, **wrong)
    assert verdict == "missed"
    assert "vertical_speed" in reason
    assert verdict_of(timings, status=("diverged", {"case": "pod_r1"}))[0] == "missed"
    for case in ("baseline", "pod_r1"):
        seconds = float(timings[TIMING[VEHICLES[1]]]["seconds"].sel(case=case))
        for spread, expected in ((0.5, "not_comparable"), (0.999 * LARGEST_SPREAD, "met")):
            lower = {"seconds_lower": ((1.005 - spread) * seconds, {"case": case})}
            verdict, reason = verdict_of(timings, **lower)
            assert verdict == expected
            assert (f"{case} 50 %" in reason) == (verdict == "not_comparable")
            # Errors that are missed decide all the same.
            assert verdict_of(timings, **lower, **wrong)[0] == "missed"


def test_claims_on_times_rest_on_all_numbers(timings, results):
    everything = {n: at_published_start(d) for n, d in results.items()} | timings
    agree = CRITERIA["all_close_agreement_less_time"].judge
    assert agree(everything, "pod").within
    # The paper's words miss the yaw of the first vehicle.
    assert not agree(everything, "pod_literal").within
    slow = {name: data.assign(speed_up=data["speed_up"] * 0.22) for name, data in timings.items()}
    assert not agree(everything | slow, "pod").within
    busy = {
        name: data.assign(seconds_upper=2.0 * data["seconds"]) for name, data in timings.items()
    }
    assert agree(everything | busy, "pod").within is None
    assert not agree(everything | busy, "pod_literal").within
    slower = CRITERIA["dw_fig14_six_slower_than_three"].judge
    name = TIMING[MODELS[0]]
    cases = {"pod_literal_r3": 1.0, "pod_literal_r6": 2.0}
    seconds = [cases.get(str(case), 3.0) for case in timings[name]["case"].values]
    data = timings[name].assign(seconds=("case", seconds), seconds_lower=("case", seconds))
    data = data.assign(seconds_upper=("case", seconds))
    assert slower({name: data}, "pod_literal").within
    assert not slower(
        {name: data.assign(speed_up=0.5 * data["speed_up"] / 5.0)}, "pod_literal"
    ).within
    assert not slower({name: data.assign(seconds=1.0 / data["seconds"])}, "pod_literal").within


@pytest.mark.parametrize("model", MODELS)
def test_break_even_is_the_training_over_what_a_run_saves(results_folder, model):
    for row in cost_table(model, results_folder).to_dict("records"):
        for end in ("", "_strongest"):
            ratio, runs = row[f"speed_up{end}"], row[f"break_even{end}"]
            pays = ratio > 1.0 and row["offline_us"] > 0.0 and row["status"] == "ok"
            assert np.isfinite(runs) == pays
            if pays:
                # After so many runs both have taken the same time.
                own = runs * row["us_per_run"]
                assert own * ratio == pytest.approx(own + row["offline_us"])


@pytest.fixture
def said(results_folder, capsys, monkeypatch, rows):
    """Run `compare` on the stored rows: exit status and what it prints."""
    monkeypatch.setattr(vm, "compare", lambda *_: rows)
    monkeypatch.setenv("COLUMNS", "80")

    def run(*arguments):
        status = main(["compare", *arguments, "--results", str(results_folder)])
        return status, capsys.readouterr().out

    return run


def test_screens_have_the_numbers_and_claims_and_fit_the_terminal(said, rows):
    status, text = said()
    assert status == 0
    printed = rows[rows["published"].notna()]
    for row in printed.to_dict("records"):
        number = row["reproduced"]
        shown = f"{number:.1e}" if row["signal_rms"] == row["signal_rms"] else f"{1 - number:.2f}"
        assert f"{shown} {row['verdict'].replace('_', ' ')}" in text
    # Predicting zero would meet two bounds.
    empty = rows[rows["signal_rms"] <= rows["published"]]["id"]
    assert set(empty) == {"gv_rms_pitch", "hfv_rms_vertical_speed"}
    status, text = said("--all")
    assert max(map(len, text.splitlines())) <= 80
    plain = " ".join(text.split())
    assert "offline" in plain
    assert len(json.loads(said("--json")[1])) == len(rows)


def test_claims_that_can_be_measured_have_verdicts(rows, results_folder):
    judged_claims = list(claim_rows(stored_results(results_folder)))
    assert {row["id"] for row in judged_claims} == set(CRITERIA)
    assert all(row["verdict"] == "met" for row in judged_claims if row["id"].startswith("gv_"))
