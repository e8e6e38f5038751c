"""Published RMS errors beside those of the nominal runs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from vehiclemor.report.comparison.row import PARAMETERS, VARIANTS, Row, verdict
from vehiclemor.report.published import Number

if TYPE_CHECKING:
    import xarray as xr


def error_rows(number: Number, nominal: xr.Dataset) -> list[Row]:
    """One row for each variant of the method and start of the model."""
    study = nominal.sel(rank=number.states, output=number.quantity)
    starts = [str(start) for start in study["start"].values]
    return [
        _row(
            number,
            study.sel(start=start).squeeze(drop=True),
            label,
            f", {start}" if len(starts) > 1 else "",
        )
        for label in VARIANTS
        for start in starts
    ]


def _row(number: Number, nominal: xr.Dataset, label: str, origin: str) -> Row:
    point = nominal.sel({"method": label})
    reproduced, status = float(point["rms_error"]), str(point["status"].item())
    if "iterations" in nominal:
        counts = f"{int(point['iterations'])} iterations"
    else:
        full = nominal["rhs_calls"].sel({"method": "full_order"})
        counts = f"{int(point['rhs_calls'])} evaluations against {int(full)} of the full model"
    failed = "" if status == "ok" else f"{status}: {point['message'].item()}; "
    return Row(
        model=number.model,
        item=f"{number.item}, {VARIANTS[label]}{origin}",
        published=number.value,
        reproduced=reproduced,
        unit=number.unit,
        floor=float(point["floor_rms_error"]),
        replay=float(nominal["rms_error"].sel({"method": "replay"})),
        verdict=verdict(status == "ok" and reproduced <= number.value),
        reason=(
            f"{failed}nominal-only error: trained on the run that it is tested on, where replay is "
            f"exact; {counts}; {PARAMETERS}"
        ),
    )
