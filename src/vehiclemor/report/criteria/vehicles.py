"""The paper's claims on the vehicles, figures 2 to 4, 9 and 10, as criteria that can fail."""

from collections.abc import Callable

from vehiclemor.report.criteria.finding import (
    SMALLEST_CHANGE,
    VISIBLE,
    Finding,
    Results,
    at_point,
    not_visible,
    worst_of,
)

OUTPUTS = ("lateral_position", "pitch", "yaw")
HIGH_FIDELITY_OUTPUTS = (
    *("longitudinal_position", "lateral_position"),
    *("lateral_speed", "vertical_speed"),
)
# Control periods (s): the paper's, and one that is clearly longer.
PERIOD, LONGER_PERIOD = 0.5, 2.5
SUBSTANTIAL = 0.1


def follows_closely(results: Results, label: str) -> Finding:
    """Figures 2 and 3: trajectory, pitch and yaw can hardly be told from the full model's."""
    return not_visible(at_point(results["figures-2-4"], label, rank=3), OUTPUTS)


def three_states_suffice(results: Results, label: str) -> Finding:
    """Text: three states hold most of the information, by the best approximation in them."""
    chosen = at_point(results["figures-2-4"], label, rank=3)
    shares = chosen["floor_rms_error"] / chosen["signal_range"]
    worst, where = worst_of({output: float(shares.sel(output=output)) for output in OUTPUTS})
    text = "RMS error of the best approximation of an output, as a share of its range"
    return Finding(worst, VISIBLE, worst < VISIBLE, text, f"of {where}")


def shorter_periods_sharpen_basis(results: Results, label: str) -> Finding:
    """Text: a subspace for each control period is more accurate than one for a longer time."""
    study = at_point(results["vehicle-control-period"], label, rank=3)
    floors = study["floor_rms_error"].sel(output=["pitch", "yaw"])
    ratios = floors.sel(control_period=PERIOD) / floors.sel(control_period=5.0)
    worst = float(ratios.max())
    bound = 1.0 - SMALLEST_CHANGE
    text = (
        f"RMS error of the best approximation with {PERIOD:g} s as a multiple of that with 5 s, "
        "worse of pitch and yaw"
    )
    return Finding(worst, bound, worst < bound, text, f"the better: {float(ratios.min()):.2g}")


def longer_periods_save_time(
    results: Results, label: str, bound: float = 1.0 - SUBSTANTIAL
) -> Finding:
    """Text: longer control periods save time substantially, at the price of some deviation."""
    study = at_point(results["vehicle-control-period"], label, rank=3)
    calls, errors = study["rhs_calls"], study["rms_error"].sel(output="yaw")
    saved = float(calls.sel(control_period=LONGER_PERIOD) / calls.sel(control_period=PERIOD))
    price = float(errors.sel(control_period=LONGER_PERIOD) / errors.sel(control_period=PERIOD))
    finished = bool((study["status"].sel(control_period=[PERIOD, LONGER_PERIOD]) == "ok").all())
    text = f"evaluations with {LONGER_PERIOD:g} s as a multiple of those with {PERIOD:g} s"
    seen = f"the yaw error grows {price:.2g} times" if finished else "a run diverges"
    return Finding(saved, bound, finished and saved < bound, text, seen)


def one_state_suffices(results: Results, label: str) -> Finding:
    """Figures 9 and 10: with one state path, lateral and vertical speed agree excellently."""
    return not_visible(at_point(results["figures-9-10"], label, rank=1), HIGH_FIDELITY_OUTPUTS)


CRITERIA: dict[str, Callable[[Results, str], Finding]] = {
    "gv_fig3_closely_matches": follows_closely,
    "gv_three_states_suffice": three_states_suffice,
    "gv_control_periods_sharpen_basis": shorter_periods_sharpen_basis,
    "gv_longer_period_saves_time": longer_periods_save_time,
    "hfv_fig10_one_state_excellent": one_state_suffices,
}
WITHOUT_REPLAY = frozenset(
    {"gv_three_states_suffice", "gv_control_periods_sharpen_basis", "gv_longer_period_saves_time"}
)
