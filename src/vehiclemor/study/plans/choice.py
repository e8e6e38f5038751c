"""Scores against bounds, and the choice of settings from validation results alone.

Drawn runs on which the full order itself is sensitive are found by rule and reported apart: where
two tolerances of the full order disagree by more than a bound, where the car spins, tips over or
has a wheel in the air, no error against one of them tells anything of a reduced model.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from vehiclemor.simulation.trajectory import FINISHED
from vehiclemor.study.experiment import Experiment, Settings, complete_settings, make_experiment
from vehiclemor.study.plans.protocol import Entry, Protocol, Scenarios
from vehiclemor.study.plans.study_file import Bound

if TYPE_CHECKING:
    import xarray as xr

# Scores nearer to each other than this share are a tie, which the cheaper candidate wins.
TIE = 0.05
# The same of times, which scatter.
TIE_OF_TIMES = 0.2
# Part of the bounds that a candidate may use up in validation, and the contender that is chosen:
# the test has more runs, and its worst is worse.
MARGIN, MARGIN_OF_CHOSEN = 0.5, 0.8


@dataclass(frozen=True)
class Validation:
    """What the choice may know of a candidate.

    Attributes
    ----------
    stable
        Share of the validation scenarios whose run has the status ok.
    score
        Largest error of a bounded output in any validation scenario as a multiple of its bound;
        infinite if a run has failed.
    evaluations
        Evaluations of the equations, mean of the validation scenarios, by the method's own count:
        it decides among candidates of one method alone.
    """

    stable: float
    score: float
    evaluations: float


@dataclass(frozen=True)
class Row:
    """An entry with the candidate that is reported, and the validation of all candidates.

    Attributes
    ----------
    winner
        Whether it is the contender that validation has chosen.
    """

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


def validation_of(dataset: xr.Dataset, bounds: Mapping[str, Bound], count: str) -> Validation:
    """Validation result of a candidate from its stored file; `count` is `Model.evaluations`."""
    return Validation(
        float(np.isin(dataset["status"].values, FINISHED).mean()),
        float(scores(dataset, bounds).max()),
        float(dataset[count].mean()),
    )


def scores(dataset: xr.Dataset, bounds: Mapping[str, Bound]) -> np.ndarray:
    """Largest error as a multiple of its bound, for every scenario (scenarios,); inf if failed."""
    parts = [
        dataset[f"{bound.measure}_error"].sel(output=output).values / bound.bound
        for output, bound in bounds.items()
    ]
    worst = np.max(parts, axis=0)
    ended = np.isin(dataset["status"].values, FINISHED)
    return np.where(ended & np.isfinite(worst), worst, np.inf)


class Outcomes(NamedTuple):
    """How each scenario (scenarios,) has ended.

    Attributes
    ----------
    scores
        Largest error as a multiple of its bound; inf if the run has not come to its end.
    missed
        A bound is missed, or the run has not come to its end.
    flagged
        The model says itself that it is not to be trusted, or that another has taken over.
    silent
        Missed with the status ok: the worst result that there is.
    """

    scores: np.ndarray
    missed: np.ndarray
    flagged: np.ndarray
    silent: np.ndarray


def outcomes(dataset: xr.Dataset, bounds: Mapping[str, Bound]) -> Outcomes:
    """Outcomes of a row in its scenarios."""
    found, status = scores(dataset, bounds), dataset["status"].values
    missed = ~(found <= 1.0)
    flagged = (status != "ok") | np.isfinite(dataset["trusted_until"].values)
    return Outcomes(found, missed, flagged, missed & (status == "ok"))


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


def second_run(protocol: Protocol, scenarios: Scenarios) -> Experiment:
    """The full order at its default tolerance, a thousand times that of the references."""
    settings = complete_settings(protocol.model, "full_order")
    return make_experiment(protocol.model, "full_order", settings, (), scenarios, "errors")


def reasons(protocol: Protocol, second: xr.Dataset) -> list[str]:
    """Why each scenario of the second run is reported apart; empty if it is not."""
    bounds, loads = protocol.definition.bounds, protocol.model.definition.loads
    largest = protocol.definition.sensitive
    parts = [second.isel(scenario=index) for index in range(second.sizes["scenario"])]
    return [
        _reason(part, float(score), largest, loads)
        for part, score in zip(parts, scores(second, bounds), strict=True)
    ]


def _reason(
    part: xr.Dataset, score: float, largest: Mapping[str, float], loads: Sequence[str]
) -> str:
    if not np.isfinite(score):
        return f"full order: {part['message'].item()}"
    if score > 1.0:
        return f"two tolerances of the full order differ by {score:.2g} times a bound"
    for output, limit in largest.items():
        value = float(part["largest_output"].sel(output=output))
        if value > limit:
            return f"{output} of the full order reaches {value:.3g}, beyond {limit:g}"
    # A dropped car has landed before.
    lifted = [o for o in loads if float(part["smallest_output"].sel(output=o)) <= 0.0]
    return f"without load: {', '.join(lifted)}" if lifted else ""
