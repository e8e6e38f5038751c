"""Criteria over the two starts of a vehicle: the worse of both counts."""

from __future__ import annotations

from typing import TYPE_CHECKING

from vehiclemor.report.criteria.finding import VISIBLE, Finding, largest_deviation

if TYPE_CHECKING:
    import xarray as xr

STARTS = ("equilibrium", "dropped")


def worst_of(values: dict[str, float]) -> tuple[float, str]:
    """Largest value and where it is; missing if any is missing."""
    missing = [name for name, value in values.items() if value != value]
    if missing:
        return float("nan"), missing[0]
    name = max(values, key=lambda key: values[key])
    return values[name], name


def _failures(dataset: xr.Dataset) -> str:
    states = {s: str(dataset["status"].sel(start=s).item()) for s in STARTS}
    return ", ".join(f"{start}: {status}" for start, status in states.items() if status != "ok")


def closely_followed(point: xr.Dataset, outputs: tuple[str, ...]) -> Finding:
    """Whether the outputs can hardly be told from the full model's, from both starts."""
    deviations = {
        f"{output} from {start}": largest_deviation(point.sel(start=start), output)
        for start in STARTS
        for output in outputs
    }
    worst, where = worst_of(deviations)
    failed = _failures(point)
    text = f"largest deviation of {where}, as a share of the signal's range"
    return Finding(
        worst, VISIBLE, worst < VISIBLE and not failed, f"{text}; {failed}" if failed else text
    )
