"""What a criterion returns, and what counts as visible in a figure.

The paper shows curves; a reader sees a deviation on them when it is a visible share of the
signal's range.  Each criterion is evaluated for the default settings and for the paper's literal
ones, and of a vehicle for each start.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
import xarray as xr

# Share of a signal's range from which on a deviation counts as visible in a figure: 2 mm on a curve
# that is 40 mm high.
VISIBLE = 0.05
# Curves that agree within this share of the range lie on top of each other: 0.4 mm there.
INDISTINGUISHABLE = 0.01
# A change of an error by less than this share is no change.
SMALLEST_CHANGE = 0.01
# Whose the threshold of a criterion is: the paper prints it, the claim's words leave no other, or
# it is ours.
PRINTED, IN_WORDS, OWN = "published", "the claim's words", "ours"
# Studies of one start of a model.
Results = Mapping[str, "xr.Dataset"]


@dataclass(frozen=True)
class Finding:
    """Outcome of one criterion.

    Attributes
    ----------
    measured
        The number that decides.
    bound
        What it is compared with.
    met
        Whether the claim holds.
    measure
        What the number is.
    seen
        What else was seen.
    threshold
        Whose the bound is.
    """

    measured: float
    bound: float
    met: bool
    measure: str
    seen: str = ""
    threshold: str = OWN


# Label of a method in the paper's studies -> what its rows are called.
VARIANTS = {"pod": "default", "pod_literal": "literal"}


@dataclass(frozen=True)
class Criterion:
    """A claim of the paper as a number that can miss its bound.

    Attributes
    ----------
    judge
        (results, label of a method) -> finding.
    studies
        Names of the studies whose results it needs; it gets no others.
    variants
        Label of a method in them -> what its row is called.
    of_replay
        Whether replay can be judged too: it has no subspaces, and integrates nothing.
    """

    judge: Callable[[Results, str], Finding]
    studies: tuple[str, ...] = ()
    variants: Mapping[str, str] = field(default_factory=lambda: VARIANTS)
    of_replay: bool = True

    def __call__(self, results: Results, label: str) -> Finding:
        """The finding for one method."""
        return self.judge({name: results[name] for name in self.studies}, label)


def at_point(dataset: xr.Dataset, label: str, **place: object) -> xr.Dataset:
    """One method at one place of the grid."""
    return without_single(dataset.sel({"label": label, **place}))


def without_single(dataset: xr.Dataset) -> xr.Dataset:
    """Without dimensions of the grid that have one value; a model may have a single output."""
    single = [d for d in dataset["status"].dims if dataset.sizes[d] == 1 and d != "label"]
    return dataset.squeeze(single, drop=True)


def deviation_history(point: xr.Dataset, output: str) -> xr.DataArray:
    """Error history as a share of the full-order signal's range."""
    error = point["outputs"].sel(output=output) - point["reference_outputs"].sel(output=output)
    return error / point["signal_range"].sel(output=output)


def largest_deviation(point: xr.Dataset, output: str) -> float:
    """Largest error of an output as a share of the full-order signal's range."""
    chosen = point.sel(output=output)
    return float(chosen["max_error"] / chosen["signal_range"])


def relative_rms(dataset: xr.Dataset, label: str, output: str) -> np.ndarray:
    """RMS errors of a method over a grid as shares of the full-order signal's range."""
    chosen = at_point(dataset, label, output=output)
    return (chosen["rms_error"] / chosen["signal_range"]).values


def not_visible(point: xr.Dataset, outputs: tuple[str, ...], bound: float = VISIBLE) -> Finding:
    """Whether the largest deviation of all named outputs stays below a share of their ranges."""
    worst, where = worst_of({output: largest_deviation(point, output) for output in outputs})
    status = str(point["status"].item())
    seen = f"of {where}" if status == "ok" else f"{status}: {point['message'].item()}"
    text = "largest deviation of an output, as a share of its range"
    return Finding(worst, bound, worst < bound and status == "ok", text, seen)


def worst_of(values: Mapping[str, float]) -> tuple[float, str]:
    """Largest value and where it is; missing if any is missing."""
    missing = [name for name, value in values.items() if value != value]
    if missing:
        return float("nan"), missing[0]
    name = max(values, key=lambda key: values[key])
    return values[name], name


def agree(study: str, outputs: tuple[str, ...], bound: float = VISIBLE, rank: int = 3) -> Criterion:
    """Criterion that no output deviates by more than a share of its range in a study."""

    def judge(results: Results, label: str) -> Finding:
        return not_visible(at_point(results[study], label, rank=rank), outputs, bound)

    return Criterion(judge, (study,))
