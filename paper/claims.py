"""The paper's claims as criteria that can fail: figures 3, 6, 10 to 14, and statements.

Usage: python paper/claims.py [--results DIR]

Prints every claim with its verdict, of the default settings and of the paper's literal ones, from
equilibrium: the paper says nothing of another start.  The paper shows curves; a reader sees a
deviation on them when it is a visible share of the signal's range.  `vehiclemor compare paper` runs
the studies.
"""

import argparse
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
import xarray as xr
from scipy.linalg import subspace_angles

from vehiclemor.reduction.methods import pod
from vehiclemor.reduction.projection.algebraic import AlgebraicProjection, fit_windows
from vehiclemor.reduction.projection.bases import by_window, window_edges
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.reduction.validation import validated
from vehiclemor.registry import component
from vehiclemor.report.comparison import PAPER, at_published_start
from vehiclemor.report.labels import Column
from vehiclemor.report.printing import Table
from vehiclemor.report.published import (
    INDISTINGUISHABLE,
    TIMING,
    VARIANTS,
    VERDICTS,
    Finding,
    Model,
    Printed,
    Results,
    case_of,
    judge_rms_error,
    judged,
    load_published,
    printed_errors_and_savings,
    time_saved,
    timing_scatter,
)
from vehiclemor.report.results import at_point
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.simulation.build import build
from vehiclemor.study.plans.loading import load_studies
from vehiclemor.study.store import combined_path
from vehiclemor.toml_files import FileSchema, Line, read_toml

FILE = Path(__file__).with_name("claims.toml")
# Share of a signal's range from which on a deviation counts as visible in a figure: 2 mm on a curve
# that is 40 mm high.
VISIBLE = 0.05
# A change of an error by less than this share is no change.
SMALLEST_CHANGE = 0.01
# Largest principal angle (rad) up to which two subspaces count as similar.
SIMILAR_SUBSPACES = 0.1
# The end of the simulation: the last fifth.
END = 0.8
BOTH = DISPLACEMENT, ANGLE = "spindle_y", "second_euler_angle"
OUTPUTS = ("lateral_position", "pitch", "yaw")
HIGH_FIDELITY_OUTPUTS = (
    *("longitudinal_position", "lateral_position"),
    *("lateral_speed", "vertical_speed"),
)
# Control periods (s): the paper's, and one that is clearly longer; share that is substantial.
PERIOD, LONGER_PERIOD = 0.5, 2.5
SUBSTANTIAL = 0.1
# Study of a nominal run -> the paper's rank, outputs that its figures show.
NOMINAL = {
    "figures-2-4": (3, OUTPUTS),
    "figures-6-7": (3, BOTH),
    "figures-9-10": (1, HIGH_FIDELITY_OUTPUTS),
}
FIGURE_13 = ("figure-13-frequency", "figure-13-amplitude")
# Variants of criteria that compare subspaces: both have the same.
OF_SUBSPACES = {"pod": "default, literal"}
# Rank 6 of snapshots of rank 4: the default settings would cut it.
UNCUT = {"pod_uncut": "default, no rank cut", "pod_literal": "literal"}
DEVIATION = "largest deviation of the angle, as a share of its range"
TWICE = "largest deviation of the suspension's angle at twice the frequency, as of figure 14"


class Claim(Printed):
    """A printed statement in our words; without a model it is about all three.

    A `result` is what the paper says it saw, an `expectation` what it explains without showing it.
    """

    model: Model | None = None
    kind: Literal["result", "expectation"]
    statement: Line


class ClaimFile(FileSchema):
    """Schema of `claims.toml`."""

    claim: list[Claim]


@dataclass(frozen=True)
class Criterion:
    """A claim of the paper as a number that can miss its bound.

    It gets the results of studies and timings by name, and the label of a method; `variants` are
    what the rows of labels are called.
    """

    judge: Callable[[Results, str], Finding]
    variants: Mapping[str, str]


# Id of a claim -> its criterion; filled by `criterion`.
CRITERIA: dict[str, Criterion] = {}
Judge = Callable[..., Finding]


def criterion(
    claim: str, variants: Mapping[str, str] = VARIANTS, **arguments: Any
) -> Callable[[Judge], Judge]:
    """Make a function of results, label and further arguments the criterion of a claim."""

    def register(judge: Judge) -> Judge:
        CRITERIA[claim] = Criterion(partial(judge, **arguments), variants)
        return judge

    return register


def below(value: float, bound: float, *, valid: bool = True, **about: Any) -> Finding:
    """A value that must stay below its bound; a run that has failed is not `valid`.

    `about` are further fields.
    """
    return Finding(value, bound, valid and value < bound, **about)


def above(value: float, bound: float, *, valid: bool = True, **about: Any) -> Finding:
    """As `below`, of a value that must exceed its bound."""
    return Finding(value, bound, valid and value > bound, **about)


def claims() -> dict[str, Claim]:
    """Id -> claim, in the order of the file."""
    return {claim.id: claim for claim in read_toml(FILE, ClaimFile).claim}


def stored_results(folder: Path) -> Results:
    """Studies and timings of the paper in a results folder; nothing is checked or computed."""
    names = (*load_studies(PAPER), *TIMING.values())
    stored = {name: xr.load_dataset(combined_path(folder, name)) for name in names}
    return {name: at_published_start(dataset) for name, dataset in stored.items()}


def claim_rows(results: Results) -> Iterator[dict[str, Any]]:
    """A row for each variant of each claim that can be measured."""
    for claim in claims().values():
        if claim.id not in CRITERIA:
            continue
        each = CRITERIA[claim.id]
        for label, variant in each.variants.items():
            finding = each.judge(results, label)
            verdict = judged(finding.within)
            yield {"id": claim.id, "variant": variant, "verdict": verdict} | finding._asdict()


def largest_deviation(point: xr.Dataset, output: str) -> float:
    """Largest error of an output as a share of the full-order signal's range."""
    chosen = point.sel(output=output)
    return float(chosen["max_error"] / chosen["signal_range"])


def not_visible(point: xr.Dataset, outputs: tuple[str, ...], bound: float = VISIBLE) -> Finding:
    """Whether the largest deviation of all named outputs stays below a share of their ranges."""
    worst, where = worst_of({output: largest_deviation(point, output) for output in outputs})
    status = str(point["status"].item())
    seen = f"of {where}" if status == "ok" else f"{status}: {point['message'].item()}"
    text = "largest deviation of an output, as a share of its range"
    return below(worst, bound, measure=text, reason=seen, valid=status == "ok")


def worst_of(values: Mapping[str, float]) -> tuple[float, str]:
    """Largest value and where it is; missing if any is missing."""
    name = list(values)[int(np.argmax(list(values.values())))]
    return values[name], name


@criterion("gv_fig3_closely_matches", study="figures-2-4", outputs=OUTPUTS)
@criterion(
    "hfv_fig10_one_state_excellent", study="figures-9-10", outputs=HIGH_FIDELITY_OUTPUTS, rank=1
)
@criterion("dw_fig6_nearly_identical", study="figures-6-7", outputs=BOTH, bound=INDISTINGUISHABLE)
@criterion("dw_fig11_displacement_unaffected", study="figure-11", outputs=(DISPLACEMENT,))
@criterion("dw_fig12_no_divergence", study="figure-12", outputs=BOTH)
def agrees(
    results: Results,
    label: str,
    study: str,
    outputs: tuple[str, ...],
    bound: float = VISIBLE,
    rank: int = 3,
) -> Finding:
    """No output deviates by more than a share of its range in a study."""
    return not_visible(at_point(results[study], label, rank=rank), outputs, bound)


# The vehicle with independent suspensions.


@criterion("gv_three_states_suffice")
def three_states_suffice(results: Results, label: str) -> Finding:
    """Text: three states hold most of the information, by the best approximation in them."""
    chosen = at_point(results["figures-2-4"], label, rank=3)
    shares = chosen["floor_rms_error"] / chosen["signal_range"]
    worst, where = worst_of({output: float(shares.sel(output=output)) for output in OUTPUTS})
    text = "RMS error of the best approximation of an output, as a share of its range"
    return below(worst, VISIBLE, measure=text, reason=f"of {where}")


@criterion("gv_control_periods_sharpen_basis")
def shorter_periods_sharpen_basis(results: Results, label: str) -> Finding:
    """Text: a subspace for each control period is more accurate than one for a longer time."""
    study = at_point(results["vehicle-control-period"], label, rank=3)
    floors = study["floor_rms_error"].sel(output=["pitch", "yaw"])
    ratios = floors.sel(control_period=PERIOD) / floors.sel(control_period=5.0)
    worst, bound = float(ratios.max()), 1.0 - SMALLEST_CHANGE
    text = (
        f"RMS error of the best approximation with {PERIOD:g} s as a multiple of that with 5 s, "
        "worse of pitch and yaw"
    )
    better = f"the better: {float(ratios.min()):.2g}"
    return below(worst, bound, measure=text, reason=better)


@criterion("gv_longer_period_saves_time", bound=1.0 - SUBSTANTIAL)
@criterion("all_accuracy_buys_time", bound=1.0 - SMALLEST_CHANGE)
def longer_periods_save_time(results: Results, label: str, bound: float) -> Finding:
    """Text: longer control periods save time, at the price of some deviation."""
    study = at_point(results["vehicle-control-period"], label, rank=3)
    ratio = study.sel(control_period=LONGER_PERIOD)[["rhs_calls", "rms_error"]]
    ratio = (ratio / study.sel(control_period=PERIOD)).sel(output="yaw")
    calls = float(ratio["rhs_calls"])
    finished = bool((study["status"].sel(control_period=[PERIOD, LONGER_PERIOD]) == "ok").all())
    text = f"evaluations with {LONGER_PERIOD:g} s as a multiple of those with {PERIOD:g} s"
    seen = f"the yaw error grows {float(ratio['rms_error']):.2g} times"
    if not finished:
        seen = "a run diverges"
    return below(calls, bound, measure=text, reason=seen, valid=finished)


# The suspension.


@criterion("dw_fig11_angle_diverges_at_end")
def angle_diverges_at_end(results: Results, label: str) -> Finding:
    """Figure 11: the largest error of the angle is visible and lies at the end of the run."""
    point = at_point(results["figure-11"], label, rank=3).sel(output=ANGLE)
    error = abs(point["outputs"] - point["reference_outputs"]) / point["signal_range"]
    largest, moment = float(error.max()), float(error["time"][int(np.argmax(error.values))])
    end = END * float(error["time"][-1])
    before = float(error.sel(time=slice(0.0, end)).max())
    text = "largest deviation of the angle, as a share of its range"
    seen = f"at t = {moment:.2f} s; before {end:g} s it stays below {before:.2g}"
    return above(largest, VISIBLE, measure=text, reason=seen, valid=moment > end)


@criterion("dw_fig11_shorter_period_reduces_deviation")
def shorter_period_reduces_deviation(results: Results, label: str) -> Finding:
    """Figure 11: a control period of a tenth of the length reduces the angle's deviation."""
    data = at_point(results["figure-11-control-period"], label).sel(output=ANGLE)
    errors: Any = (data["rms_error"] / data["rms_error"].sel(control_period=5.0)).to_series()
    longer: Any = errors[(errors.index > PERIOD) & (errors.index < 5.0)]
    counts = data["iterations"].to_series()
    others = ", ".join(f"{ratio:.3g} at {period:g} s" for period, ratio in longer.items())
    iterations = ", ".join(f"{n:.0f} at {period:g} s" for period, n in counts.items())
    value, bound = float(errors[PERIOD]), 1.0 - SMALLEST_CHANGE
    text = f"RMS error of the angle with {PERIOD:g} s as a multiple of that with 5 s"
    seen = f"{others}; iterations: {iterations}"
    return below(value, bound, measure=text, reason=seen)


@criterion("dw_fig12_basis_insensitive_to_amplitude", OF_SUBSPACES)
def basis_insensitive_to_amplitude(*_: object) -> Finding:
    """Figure 12: training at amplitude +20 % gives nearly the same subspaces."""
    nominal = trained(1.0, 1.0).bases

    def angle(frequency: float, amplitude: float) -> float:
        pairs = zip(nominal, trained(frequency, amplitude).bases, strict=True)
        return max(float(subspace_angles(a.vectors, b.vectors)[0]) for a, b in pairs)

    largest = angle(1.0, 1.2)
    text = (
        "largest principal angle (rad) between the subspaces of r = 3 trained at the nominal and "
        "at the larger amplitude"
    )
    seen = f"for frequency +20 % it is {angle(1.2, 1.0):.2g}"
    return below(largest, SIMILAR_SUBSPACES, measure=text, reason=seen)


def trained(frequency: float, amplitude: float) -> AlgebraicProjection:
    """Subspaces of r = 3, trained on the perturbed run."""
    model = build("double_wishbone")
    assert isinstance(model, AlgebraicModel)
    maneuver = component("maneuver", component("model", model.name).maneuver)
    settings = validated(pod.METHOD, model.kind, {"rank": 3})
    edges = window_edges(maneuver.duration, settings.control_period)
    run = maneuver.perturbed(frequency, amplitude)
    return fit_windows(model, [TrainingRun(model, run, model.starts[0])], edges, settings)


@criterion("dw_fig13_not_monotone_frequency", quantity="frequency")
@criterion("dw_fig13_not_monotone_amplitude", quantity="amplitude")
def not_monotone(results: Results, label: str, quantity: str) -> Finding:
    """Figure 13: a larger perturbation of the input need not give a larger error."""
    study = results[f"figure-13-{quantity}"]
    factors = study[f"{quantity}_factor"].values
    falls: dict[str, float] = {}
    for output in BOTH:
        errors = at_point(study, label, output=output)["rms_error"].values
        # Both away from the nominal input.
        sides = [errors[factors >= 1.0], errors[factors <= 1.0][::-1]]
        # From the first that is not zero on: replay is exact at the nominal input.
        sides = [side[np.argmax(side > 0.0) :] for side in sides]
        falls[output] = max(float(np.max(1.0 - e[1:] / e[:-1])) for e in sides)
    largest = max(falls.values())
    text = "largest fall of an RMS error over a step away from the nominal input, as a share of it"
    seen = f"displacement {falls[DISPLACEMENT]:.2g}, angle {falls[ANGLE]:.2g}"
    return above(largest, SMALLEST_CHANGE, measure=text, reason=seen)


def _relative(results: Results, label: str) -> list[xr.DataArray]:
    """RMS errors over the range of the signal, by `factor`: of the frequency, of the amplitude."""
    shares: list[xr.DataArray] = []
    for study in FIGURE_13:
        point = at_point(results[study], label)
        share = (point["rms_error"] / point["signal_range"]).sel(output=[*BOTH])
        quantity = study.removeprefix("figure-13-")
        shares.append(share.rename({f"{quantity}_factor": "factor"}))
    return shares


@criterion("dw_fig13_angle_more_sensitive")
def angle_more_sensitive(results: Results, label: str) -> Finding:
    """Figure 13: the angle's error, as a share of its range, is the larger one mostly."""
    errors = xr.concat(_relative(results, label), "factor")
    share = float((errors.sel(output=ANGLE) > errors.sel(output=DISPLACEMENT)).mean())
    text = (
        "share of perturbations at which the angle's RMS error / range exceeds the displacement's"
    )
    return above(share, 0.5, measure=text)


@criterion("dw_more_robust_to_amplitude")
def more_robust_to_amplitude(results: Results, label: str) -> Finding:
    """Conclusion: at equal perturbations the error is smaller for amplitude than for frequency."""
    frequency, amplitude = xr.align(*_relative(results, label), join="inner")
    smaller = (amplitude < frequency)[{"factor": amplitude["factor"].values != 1.0}]
    share = float(smaller.mean())
    text = "share of the pairs of equal perturbations at which amplitude hurts less"
    return above(share, 0.5, measure=text, reason=f"{smaller.size} pairs")


@criterion("dw_fig14_three_states_fail", measure=DEVIATION)
@criterion("all_may_deviate", measure=TWICE)
def leaves_full_model(results: Results, label: str, measure: str) -> Finding:
    """Figure 14: at frequency +100 % the angle deviates visibly with r = 3."""
    largest = largest_deviation(at_point(results["figure-14"], label, rank=3), ANGLE)
    return above(largest, VISIBLE, measure=measure)


@criterion("dw_fig14_dropped_modes_excited", OF_SUBSPACES)
def dropped_modes_excited(*_: object) -> Finding:
    """Figure 14: at frequency +100 % three modes no longer hold most of the energy (eq. 5-8)."""
    fitted = trained(1.0, 1.0)
    maneuver = component("maneuver", component("model", fitted.model.name).maneuver)
    left_out: list[float] = []
    for factor in (1.0, 2.0):
        states = fitted.model.simulate(maneuver.perturbed(frequency=factor)).coordinates
        centred = by_window(states, fitted.edges, lambda part, k: part - fitted.bases[k].mean)
        rest = states - fitted.best_approximation(states)
        left_out.append(float(np.sum(rest**2) / np.sum(centred**2)))
    share, more = 1.0 - left_out[1], left_out[1] / left_out[0]
    text = "share of the energy of the run at twice the frequency that three modes hold"
    seen = f"they leave out {left_out[1]:.2g} of it, {more:.2g} times as much as of the nominal run"
    return below(share, 0.5, measure=text, reason=seen)


@criterion("dw_fig14_six_states_follow", UNCUT)
def six_states_follow(results: Results, label: str) -> Finding:
    """Figure 14: with r = 6 it follows, whichever two of the six directions rounding chooses."""
    if label == "replay":
        return not_visible(at_point(results["figure-14"], label, rank=6), (ANGLE,))
    spread = at_point(results["figure-14-spread"], label, output=ANGLE)
    share = spread["max_error"] / spread["signal_range"]
    six, four = share.sel(rank=6).values, share.sel(rank=4).values
    text = (
        f"largest deviation of the angle, as a share of its range, worst of {len(six)} roundings "
        "of the snapshots; their rank is 4, so rounding chooses two of the six directions, and "
        "the number differs from machine to machine"
    )
    # Missing where a run has diverged.
    worst, diverged = float(np.max(six)), int(np.sum(~np.isfinite(six)))
    seen = f"least {six.min():.2g}; r = 4: {four.max():.2g}"
    if diverged:
        seen = f"{diverged} of {len(six)} diverged"
    return below(worst, VISIBLE, measure=text, reason=seen)


# All three models.


@criterion("all_three_equation_kinds")
def all_kinds_reduced(results: Results, label: str) -> Finding:
    """Conclusion: ordinary differential, algebraic and differential-algebraic equations."""
    ended = [
        component("model", results[study].attrs["model"]).kind
        for study, (rank, _) in NOMINAL.items()
        if at_point(results[study], label, rank=rank)["status"].item() == "ok"
    ]
    kinds = sorted(set(ended))
    text = "kinds of equations whose nominal run ends with the paper's number of states"
    seen = ", ".join(kinds) or "none"
    return Finding(float(len(kinds)), 3.0, len(kinds) == 3, text, seen)


@criterion("all_follow_precisely")
def precisely_followed(results: Results, label: str) -> Finding:
    """Conclusion: the error plots show that trajectories are followed precisely."""
    findings: dict[str, Finding] = {}
    for study, (rank, outputs) in NOMINAL.items():
        findings[study] = agrees(results, label, study, outputs, rank=rank)
    worst, study = worst_of({name: finding.reproduced for name, finding in findings.items()})
    text = "largest deviation of an output in any nominal run, as a share of its range"
    seen = f"{study}: {findings[study].reason}"
    valid = all(finding.within for finding in findings.values())
    return below(worst, VISIBLE, measure=text, reason=seen, valid=valid)


# Times.


@criterion("dw_fig14_six_slower_than_three", {"pod_literal": "literal"})
def six_slower(results: Results, label: str) -> Finding:
    """Figure 14: six states take more time than three, but less than the full model."""
    timing = results[TIMING["double_wishbone"]]
    numbers = load_published()
    few, many = (case_of(numbers[f"dw_time_reduction_{n}"], label) for n in (3, 6))
    row = timing.sel(case=many)
    slower = float(row["seconds"] / timing["seconds"].sel(case=few))
    seen = (
        f"six states take {1.0 / float(row['speed_up']):.2f} times the time of Newton with fresh "
        f"Jacobians ({int(row['iterations'])} iterations against "
        f"{int(timing['iterations'].sel(case='baseline'))})"
    )
    scattered = timing_scatter(timing, few, many, "baseline")
    met = None if scattered else slower > 1.0 and float(row["speed_up"]) > 1.0
    text = "time with six states as a multiple of that with three; and less than the full model's"
    reason = "; ".join(filter(None, (scattered, seen)))
    return Finding(slower, 1.0, met, text, reason)


@criterion("all_close_agreement_less_time")
def agree_and_save(results: Results, label: str) -> Finding:
    """Conclusion: reduced models agree closely and take substantially less time."""
    numbers = printed_errors_and_savings()
    agree = all(judge_rms_error(n, results, label).within for n in numbers if n.kind == "rms_error")
    timed = [n for n in numbers if n.kind == "time_reduction" and case_of(n, label)]
    saved = [time_saved(n, results, label) for n in timed]
    number, least = min(zip(timed, saved, strict=True), key=lambda pair: pair[1].reproduced)
    bound = min(finding.bound for finding in saved)
    text = "least share of time that is saved, if all published errors are met"
    seen = f"{number.model}; errors {'met' if agree else 'missed'}"
    scattered = [f.reason for f in saved if f.within is None and agree]
    met = None if scattered else agree and least.reproduced >= bound
    return Finding(least.reproduced, bound, met, text, next(iter(scattered), seen))


def main() -> None:
    """Print the claims."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--results", type=Path, default=Path("results"), help="results folder")
    known, rows = claims(), []
    for row in claim_rows(stored_results(parser.parse_args().results)):
        about = {"of": known[row["id"]].statement, "word": VERDICTS[row["verdict"]]}
        rows.append(row | about)
    columns = {
        "variant": Column("settings"),
        "bound": Column("bound", ".3g"),
        "reproduced": Column("reproduced", ".3g"),
        "word": Column("verdict"),
    }
    print(Table(rows, columns, "Claims of the paper", group="of", note="reason"))


if __name__ == "__main__":
    main()
