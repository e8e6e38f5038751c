"""`dataset.vehiclemor.plot()`: results draw themselves."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import xarray as xr

from vehiclemor.metrics import errors

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from vehiclemor.simulation.trajectory import Trajectory


@xr.register_dataset_accessor("vehiclemor")
class ResultAccessor:
    """What a result of this package can do beyond xarray."""

    def __init__(self, dataset: xr.Dataset) -> None:
        self._dataset = dataset

    def plot(self, kind: str = "histories", out: str | Path | None = None, **at: object) -> Figure:
        """Draw the result; see `vehiclemor.plot`."""
        from vehiclemor.arguments import file_path
        from vehiclemor.report.figures.result_plot import plot_result
        from vehiclemor.report.result_selection import drawn

        dataset, _ = drawn(self._dataset, kind, at)
        return plot_result(dataset, None if out is None else file_path("out", out), kind)


def dataset_of(run: Trajectory, full: Trajectory | None = None) -> xr.Dataset:
    """A run as a dataset, with the outputs of the full-order run."""
    dataset = run.dataset()
    if full is None:
        return dataset
    found = errors(run, full)
    of_full = {"reference_outputs": (("time", "output"), full.chosen(run.names).outputs)}
    return dataset.assign(of_full).assign(found.data_vars)
