"""Errors of any study over what it samples: clouds of points."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.figure import Figure

from vehiclemor.report.figures.grid_errors import (
    MARKERS,
    draw_edges,
    largest_over,
    scale_errors,
    titled,
)
from vehiclemor.report.figures.lines import Style, legend_outside, letter, panels, styles
from vehiclemor.report.figures.places import places_of
from vehiclemor.report.labels import error_label, method_text
from vehiclemor.simulation.trajectory import FINISHED


def sample_axis(dataset: xr.Dataset) -> str:
    """The dimension whose places are samples without an order, empty if there is none."""
    grid = [str(d) for d in dataset["status"].dims if dataset.sizes[d] > 1]
    return next((d for d in grid if d == "sample" or d.endswith("_seed")), "")


def figure_samples(dataset: xr.Dataset, outputs: Sequence[str]) -> Figure:
    """RMS errors of all samples: over what was sampled, or beside each other for each method."""
    sample = sample_axis(dataset)
    errors = dataset["rms_error"].where(dataset["status"].isin(FINISHED), np.inf)
    rest = [str(d) for d in errors.dims if d not in (sample, "label", "output")]
    errors = errors.max(rest)
    methods = [str(m) for m in dataset["label"].values if not str(m).startswith("full_order")]
    methods = methods or [str(m) for m in dataset["label"].values]
    sampled = _sampled(dataset, sample, errors.sel(label=methods))
    columns = sampled or [""]
    height = 2.4 * len(outputs) + 0.9
    size = (max(5.0, 1.2 + 2.4 * len(columns)), height)
    figure, grid = panels(len(outputs), len(columns), size, sharex="col", sharey="row")
    looks = styles(methods)
    for row, output in enumerate(outputs):
        for column, name in enumerate(columns):
            panel = grid[row, column]
            for number, method in enumerate(methods):
                values = errors.sel(label=method, output=output).values
                order = (0.5 + np.arange(values.size) * 0.6180339887) % 1.0
                places = number + 0.6 * (order - 0.5)
                places = places_of(dataset, name).at if name else places
                look: Style = {"color": looks[method]["color"], "linestyle": "none", "alpha": 0.6}
                look |= {"marker": MARKERS[number % len(MARKERS)], "markersize": 3}
                look |= {"markeredgewidth": 0.0, "rasterized": values.size > 1000}
                shown = np.where(np.isfinite(values) & (values > 0.0), values, np.nan)
                text = method_text(method) if name else None
                panel.plot(places, shown, label=text, **look)
                draw_edges(panel, places, values[:, None], looks[method]["color"])
                if not name and np.isfinite(shown).any():
                    middle = np.full(2, np.nanmedian(shown))
                    panel.plot(number + np.array([-0.4, 0.4]), middle, color="black")
            scale_errors(panel)
            panel.set_title(letter(row * len(columns) + column))
            if not name:
                panel.set_xticks(range(len(methods)), map(method_text, methods), fontsize=7)
        grid[row, 0].set_ylabel(error_label(dataset, "RMS error", output))
    for panel, name in zip(grid[-1], columns, strict=True):
        if name:
            places_of(dataset, name).scale(panel)
    words = f"{dataset.sizes[sample]} samples" + largest_over(dataset, rest)
    figure.suptitle(titled(dataset, words))
    legend_outside(figure, figure.axes, 0, "lower")
    return figure


def _sampled(dataset: xr.Dataset, sample: str, errors: xr.DataArray) -> list[str]:
    """Sampled quantities; of many those that the errors follow most (rank correlation)."""
    names = [
        str(name)
        for name, values in dataset.coords.items()
        if values.dims == (sample,) and name != sample and values.dtype.kind == "f"
    ]
    names = [name for name in names if np.ptp(dataset[name].values) > 0.0]
    values = errors.transpose(sample, ...).values.reshape(dataset.sizes[sample], -1)
    ranks = pd.Series(values.mean(axis=1))

    def follows(name: str) -> float:
        found = pd.Series(dataset[name].values).corr(ranks, method="spearman")
        # Errors that are all the same follow nothing.
        return -abs(found) if np.isfinite(found) else 0.0

    return sorted(names, key=follows)[:3] if len(names) > 3 else names
