"""Lines and legends that figures share: one style for each contestant."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Results = Mapping[str, "xr.Dataset"]
FULL: dict[str, Any] = {"color": "black", "linewidth": 2.6, "alpha": 0.45}
DEFAULT: dict[str, Any] = {"color": "#0072B2", "linestyle": "--"}
LITERAL: dict[str, Any] = {"color": "#D55E00", "linestyle": "-."}
REPLAY: dict[str, Any] = {"color": "#666666", "linestyle": ":", "linewidth": 1.2}


def point(dataset: xr.Dataset, label: str, **place: object) -> xr.Dataset:
    """One method at one place of the grid."""
    return dataset.sel({"method": label, **place}).squeeze(drop=True)


def legend_above(figure: Figure, axis: Axes, columns: int = 4) -> None:
    """One legend above all panels, of the lines in one of them."""
    handles, labels = axis.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=columns)
