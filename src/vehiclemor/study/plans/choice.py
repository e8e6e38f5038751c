"""Scores against bounds, and the choice of settings from validation results alone.

Sampled runs on which the full order itself is sensitive are reported apart, by rule: where two
integrators of the full order disagree by more than a bound, where the vehicle spins, tips over
or has a wheel in the air, no error against one of them tells anything of a reduced model.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import xarray as xr

from vehiclemor.simulation.trajectory import FINISHED, WITHOUT_COMPLAINT
from vehiclemor.study.experiment import Settings
from vehiclemor.study.plans.protocol import Entry, Protocol
from vehiclemor.study.plans.study_file import Bound

# Scores nearer to each other than this share are a tie, which the cheaper candidate wins; and
# times, which scatter.
TIE, TIE_OF_TIMES = 0.05, 0.2
# Part of the largest range of an output of the same unit that is rounding.
ROUNDING = 1e-6
# Part of the bounds that a candidate may use up in validation, and the contender that is chosen:
# the test has more runs, and its worst is worse.
MARGIN, MARGIN_OF_CHOSEN = 0.5, 0.8


@dataclass(frozen=True)
class Validation:
    """What the choice may know of a candidate, from the validation scenarios.

    `stable` is the share of the runs that come to their end; `score` the largest error as a
    multiple of its bound, infinite if a run has failed; `evaluations` of the equations are the mean
    as the method counts them, which decides among candidates of one method alone.
    """

    stable: float
    score: float
    evaluations: float


@dataclass(frozen=True)
class Row:
    """An entry with the candidate that is reported, and the validation of all candidates."""

    entry: Entry
    candidate: int
    validation: tuple[Validation, ...]
    winner: bool = False

    @property
    def label(self) -> str:
        """Label of the row."""
        return self.entry.row_label(self.candidate)

    @property
    def settings(self) -> Settings:
        """Those of the candidate."""
        return self.entry.candidates[self.candidate]

    @property
    def result(self) -> Validation:
        """That of the candidate."""
        return self.validation[self.candidate]


def validation_of(dataset: xr.Dataset, bounds: Mapping[str, Bound], count: str) -> Validation:
    """Validation result of a candidate; `count` is `Model.evaluations`."""
    return Validation(
        float(np.isin(dataset["status"].values, FINISHED).mean()),
        float(scores(dataset, bounds).max()),
        float(dataset[count].mean()),
    )


def scores(dataset: xr.Dataset, bounds: Mapping[str, Bound]) -> np.ndarray:
    """Largest error as a multiple of its bound, for every scenario (scenarios,); inf if failed."""
    parts = [
        errors_by(dataset, output, bound.measure).values / bound.bound
        for output, bound in bounds.items()
    ]
    worst = np.max(parts, axis=0)
    ended = np.isin(dataset["status"].values, FINISHED)
    return np.where(ended & np.isfinite(worst), worst, np.inf)


def errors_by(dataset: xr.Dataset, output: str, measure: str) -> xr.DataArray:
    """Errors of an output by a measure, see `Bound`."""
    of_output = dataset.sel(output=output)
    if measure == "relative":
        # What moves by rounding alone, as roll on a symmetric road, has no error.
        alike = dataset["output_unit"] == of_output["output_unit"]
        least = ROUNDING * dataset["signal_range"].where(alike).max("output")
        size = of_output["signal_range"]
        share = (of_output["rms_error"] / size.where(size > least)).where(size > least, 0.0)
        return share.where(np.isfinite(of_output["rms_error"]))
    return of_output[f"{measure}_error"]


class Outcomes(NamedTuple):
    """How each scenario (scenarios,) has ended.

    A run that is not complete has missed its bounds, with an infinite score.  It has `warned` if
    the model says itself that it is not to be trusted, or that another has taken over; an
    `undetected` miss, with the status ok, is the worst result that there is.
    """

    scores: np.ndarray
    missed: np.ndarray
    warned: np.ndarray
    undetected: np.ndarray

    @property
    def counts(self) -> dict[str, int]:
        """How many runs there are, and of these how many are right, and so on."""
        return {
            "runs": len(self.scores),
            "right": int((~self.missed).sum()),
            "misses": int(self.missed.sum()),
            "silent": int(self.undetected.sum()),
            "flagged": int(self.warned.sum()),
        }


def outcomes(dataset: xr.Dataset, bounds: Mapping[str, Bound]) -> Outcomes:
    """Outcomes of a row in its scenarios."""
    multiples, status = scores(dataset, bounds), dataset["status"].values
    missed = ~(multiples <= 1.0)
    complete = np.isin(status, WITHOUT_COMPLAINT)
    warned = ~complete | np.isfinite(dataset["trusted_until"].values)
    return Outcomes(multiples, missed, warned, missed & complete)


def choose(results: Sequence[Validation]) -> int:
    """Number of the chosen candidate.

    Among those that are stable in all validation scenarios: the one with the fewest evaluations
    whose score leaves room (`MARGIN`) to the bounds, since inputs that nobody has tried may be
    worse; if there is none, the one with the smallest score.  If none is stable, of those that are
    stable most often: it is reported with its failures.
    """
    most = max(result.stable for result in results)
    stable = [i for i, result in enumerate(results) if result.stable == most]
    best = min(results[i].score for i in stable)
    fitting = [i for i in stable if results[i].score <= MARGIN]
    tied = [i for i in stable if results[i].score <= (1.0 + TIE) * best]
    return min(fitting or tied, key=lambda i: (results[i].evaluations, results[i].score, i))


def reasons(protocol: Protocol, second: xr.Dataset) -> list[str]:
    """Why each scenario is reported apart, by a second full-order run; empty if it is not."""
    multiples = scores(second, protocol.definition.bounds).tolist()
    return [
        _reason(protocol, second.isel(scenario=index), score)
        for index, score in enumerate(multiples)
    ]


def _reason(protocol: Protocol, run: xr.Dataset, score: float) -> str:
    if not np.isfinite(score):
        return f"full order: {run['message'].item()}"
    if score > 1.0:
        return f"two integrators of the full order differ by {score:.2g} times a bound"
    for output, limit in protocol.definition.sensitive.items():
        value = float(run["largest_output"].sel(output=output))
        if value > limit:
            return f"{output} of the full order reaches {value:.3g}, beyond {limit:g}"
    if protocol.model.kind == "structural":
        # Its tires may leave the road.
        return ""
    # A dropped vehicle has landed before.
    least, loads = run["smallest_output"], protocol.model.definition.loads
    lifted = [output for output in loads if float(least.sel(output=output)) <= 0.0]
    return f"without load: {', '.join(lifted)}" if lifted else ""
