"""What datasets of this package can do: `dataset.vehiclemor.plot()`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import xarray as xr

from vehiclemor.arguments import file_path
from vehiclemor.report.result_selection import select_point

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@xr.register_dataset_accessor("vehiclemor")
class ResultAccessor:
    """What a result of this package can do beyond xarray."""

    def __init__(self, dataset: xr.Dataset) -> None:
        self._dataset = dataset

    def plot(self, kind: str = "histories", out: str | Path | None = None, **at: object) -> Figure:
        """Draw the result; see `vehiclemor.plot`."""
        # Matplotlib takes long to import.
        from vehiclemor.report.figures.result_plot import plot_result

        dataset, _ = select_point(self._dataset, kind, at)
        return plot_result(dataset, None if out is None else file_path("out", out), kind)
