"""Criteria for the paper's claims, each of which can be met and can fail."""

from dataclasses import replace

import claims
import numpy as np
import pytest
from claims import ANGLE, CRITERIA, DISPLACEMENT, OF_SUBSPACES, VISIBLE

from vehiclemor.inputs.suspension import sine_travel
from vehiclemor.report.comparison import at_published_start


@pytest.fixture(scope="module")
def judged(results):
    return {name: at_published_start(dataset) for name, dataset in results.items()}


def changed(results, study, change):
    """Results in which one study was changed."""
    dataset = results[study].copy(deep=True)
    change(dataset)
    return {**results, study: dataset}


def put(variable, value, of_range=False, **place):
    """Give a variable a value, or so many times the range of the signal, at a place."""

    def change(dataset):
        put_in = value * dataset["signal_range"].loc[place] if of_range else value
        dataset[variable].loc[place] = put_in

    return change


def off(output, size=2.0 * VISIBLE, rank=3, variable="max_error"):
    return put(variable, size, of_range=True, label="pod", rank=rank, output=output)


def history(size, when=slice(None)):
    """Give the angle an error of so many times its range at some times."""

    def change(dataset):
        place = {"label": "pod", "rank": 3, "output": ANGLE}
        exact, scale = dataset["reference_outputs"].loc[place], dataset["signal_range"].loc[place]
        dataset["outputs"].loc[place] = exact
        error = size * float(scale.squeeze())
        dataset["outputs"].loc[{**place, "time": when}] = exact.sel(time=when) + error

    return change


def diverged(rank):
    return put("status", "diverged", label="pod", rank=rank)


def one_rounding(error):
    return put("max_error", error, label="pod_uncut", rank=6, rounding_seed=7, output=ANGLE)


def rising(factor, last=1.0):
    """Errors that grow with the distance from the nominal input, but for the last one."""

    def change(dataset):
        distance = np.abs(dataset[factor] - 1.0)
        grown = (dataset["rms_error"] * 0.0 + 1.0) * distance * 1e-3
        dataset["rms_error"] = grown
        end = grown.isel({factor: -2}).drop_vars(factor)
        if last < 1.0:
            dataset["rms_error"][{factor: -1}] = last * end.transpose(*grown[{factor: -1}].dims)

    return change


def same(variable, dimension, value, other):
    """One value of a dimension has what another has."""

    def change(dataset):
        dataset[variable].loc[{dimension: other}] = dataset[variable].sel({dimension: value})

    return change


def amplitude_worse(dataset):
    dataset["rms_error"] = dataset["rms_error"] + 1.0


NO_CALL_SAVED = same("rhs_calls", "control_period", 0.5, 2.5)
SAME_FLOOR = same("floor_rms_error", "control_period", 5.0, 0.5)
PERIOD, QUANTITIES = "vehicle-control-period", ("figure-13-frequency", "figure-13-amplitude")
# Claim -> study, and what in it would refute the claim.
COUNTEREXAMPLES = {
    "hfv_fig10_one_state_excellent": (
        "figures-9-10",
        [off("vertical_speed", rank=1), diverged(rank=1)],
    ),
    "gv_fig3_closely_matches": ("figures-2-4", [off("yaw"), diverged(rank=3)]),
    "gv_three_states_suffice": ("figures-2-4", [off("pitch", variable="floor_rms_error")]),
    "gv_control_periods_sharpen_basis": (PERIOD, [SAME_FLOOR]),
    "gv_longer_period_saves_time": (PERIOD, [NO_CALL_SAVED]),
    "dw_fig6_nearly_identical": ("figures-6-7", [off(ANGLE, 0.02), off(DISPLACEMENT, 0.02)]),
    "dw_fig11_displacement_unaffected": ("figure-11", [off(DISPLACEMENT)]),
    "dw_fig11_angle_diverges_at_end": (
        "figure-11",
        [history(0.0), history(2.0 * VISIBLE, slice(0.0, 1.0))],
    ),
    "dw_fig11_shorter_period_reduces_deviation": (
        "figure-11-control-period",
        [put("rms_error", 1.0, control_period=0.5)],
    ),
    "dw_fig12_no_divergence": ("figure-12", [off(ANGLE)]),
    # A fall too small to matter is none.
    "dw_fig13_not_monotone_frequency": (
        QUANTITIES[0],
        [rising("frequency_factor"), rising("frequency_factor", 0.995)],
    ),
    "dw_fig13_not_monotone_amplitude": (QUANTITIES[1], [rising("amplitude_factor")]),
    "dw_fig13_angle_more_sensitive": (QUANTITIES[0], [put("rms_error", 1.0, output=DISPLACEMENT)]),
    "dw_fig14_three_states_fail": ("figure-14", [off(ANGLE, 0.0)]),
    "dw_fig14_six_states_follow": ("figure-14-spread", [one_rounding(1.0), one_rounding(np.nan)]),
    "dw_more_robust_to_amplitude": (QUANTITIES[1], [amplitude_worse]),
    "all_may_deviate": ("figure-14", [off(ANGLE, 0.0)]),
    "all_three_equation_kinds": ("figures-2-4", [diverged(rank=3)]),
    "all_follow_precisely": ("figures-6-7", [off(ANGLE)]),
    "all_accuracy_buys_time": (PERIOD, [NO_CALL_SAVED]),
}


# Their counterexamples stand in test_compare.
OF_TIMES = {"dw_fig14_six_slower_than_three", "all_close_agreement_less_time"}


@pytest.mark.parametrize("claim", COUNTEREXAMPLES)
def test_a_criterion_fails_on_a_counterexample(judged, claim):
    study, changes = COUNTEREXAMPLES[claim]
    label, *_ = CRITERIA[claim].variants
    for change in changes:
        assert not CRITERIA[claim].judge(changed(judged, study, change), label).within
    assert CRITERIA[claim].judge(judged, label).within


def test_every_criterion_has_a_counterexample_and_a_claim():
    of_subspaces = {claim for claim, each in CRITERIA.items() if each.variants == OF_SUBSPACES}
    assert set(COUNTEREXAMPLES) | of_subspaces | OF_TIMES == set(CRITERIA)
    assert set(CRITERIA) <= set(claims.claims())


def test_subspaces_are_compared_by_their_principal_angles(judged, monkeypatch):
    criterion = CRITERIA["dw_fig12_basis_insensitive_to_amplitude"]
    finding = criterion.judge(judged, "pod")
    assert 0.0 < finding.reproduced < np.pi / 2.0
    monkeypatch.setattr(claims, "SIMILAR_SUBSPACES", finding.reproduced / 2.0)
    assert not criterion.judge(judged, "pod").within


def test_energy_that_modes_hold_is_measured_in_their_subspaces(judged, monkeypatch):
    # Equation 8 at twice the frequency: nearly all of it, so the claim is missed.
    criterion = CRITERIA["dw_fig14_dropped_modes_excited"]
    finding = criterion.judge(judged, "pod")
    assert not finding.within
    fitted = claims.trained(1.0, 1.0)
    states = fitted.model.simulate(sine_travel.perturbed(frequency=2.0)).coordinates
    left_out = total = 0.0
    for basis, part in zip(fitted.bases, (states[:500], states[500:]), strict=True):
        centred = part - basis.mean
        total += np.sum(centred**2)
        left_out += np.sum(centred**2) - np.sum((centred @ basis.vectors) ** 2)
    assert 1.0 - finding.reproduced == pytest.approx(left_out / total, rel=1e-6)
    # Directions in which nothing moves hold none of it.
    still = [replace(b, vectors=np.linalg.svd(b.vectors)[0][:, 4:]) for b in fitted.bases]
    monkeypatch.setattr(claims, "trained", lambda *_: replace(fitted, bases=tuple(still)))
    assert criterion.judge(judged, "pod").within


def test_an_error_at_the_end_meets_the_claim_of_divergence(judged):
    late = changed(judged, "figure-11", history(1.5 * VISIBLE, when=slice(9.5, 10.0)))
    finding = CRITERIA["dw_fig11_angle_diverges_at_end"].judge(late, "pod")
    assert finding.within
    assert finding.reproduced == pytest.approx(1.5 * VISIBLE)
