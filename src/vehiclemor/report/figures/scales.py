"""Where values stand on an axis: those of a grid's dimension, and the ticks of errors."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.ticker import LogFormatterSciNotation, LogLocator, MaxNLocator, NullFormatter

from vehiclemor.study.plans.study_file import FACTORS, PARAMETER

UNITS = {"control_period": "s"}
# Ratio of the largest to the smallest number from which on an axis is logarithmic; letters of the
# names that there is room for on an axis; decades up to which one has 1, 2 and 5; what is below is
# written with a power of ten.
WIDE, LETTERS, FEW_DECADES, SMALL = 30.0, 60, 2.5, 1e-4


class Places(NamedTuple):
    """Places of the values of a dimension.

    Attributes
    ----------
    at
        Perturbations in %, numbers, or 0, 1, 2 ... of what has `names` (values,).
    label
        Of the axis, with its unit.
    names
        Texts at the places, none where the axis is one of numbers.
    """

    at: np.ndarray
    label: str
    names: Sequence[str] = ()

    def tick(self, axis: Axis) -> None:
        """Label an axis."""
        axis.set_label_text(self.label)
        if self.names:
            room = max(1, LETTERS // max(map(len, self.names)))
            step = -(-len(self.names) // min(12, room))
            axis.set_ticks(self.at[::step], list(self.names)[::step])
        elif self.at.dtype.kind == "i":
            axis.set_major_locator(MaxNLocator(nbins=8, integer=True))

    def scale(self, panel: Axes) -> None:
        """Label the lower axis of a panel, logarithmic where the numbers ask for it."""
        if self.names:
            panel.set_xlim(-0.5, len(self.names) - 0.5)
        elif 0.0 < WIDE * self.at.min() <= self.at.max():
            panel.set_xscale("log")
        self.tick(panel.xaxis)

    def even(self) -> "Places":
        """Cells of one size: numbers at unequal distances become names."""
        steps = np.diff(self.at)
        if self.names or np.allclose(steps, steps.mean(), rtol=1e-6):
            return self
        names = [f"{value:.4g}".replace("-", "\N{MINUS SIGN}") for value in self.at]
        return Places(np.arange(len(names)), self.label, names)


def places_of(dataset: xr.Dataset, name: str) -> Places:
    """Places of a dimension of a grid, or of a coordinate on one."""
    values, words = dataset[name].values, name.removeprefix(PARAMETER).replace("_", " ")
    if name in FACTORS:
        return Places(100.0 * (values - 1.0), f"{words.removesuffix(' factor')} perturbation (%)")
    if not np.issubdtype(values.dtype, np.number):
        return Places(np.arange(len(values)), words, [str(value) for value in values])
    unit = str(dataset[name].attrs.get("units", UNITS.get(name, "1")))
    return Places(values, words if unit == "1" else f"{words} ({unit})")


def tick_decades(axis: Axis, low: float, high: float) -> None:
    """Ticks of a logarithmic axis: some of each decade where there are few decades."""
    if np.log10(high / low) < FEW_DECADES:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        powers = LogFormatterSciNotation(minor_thresholds=(np.inf, np.inf))
        axis.set_major_formatter("{x:g}" if low >= SMALL else powers)
        axis.set_minor_formatter(NullFormatter())


def hide_rounding(axis: Axes) -> None:
    """A logarithmic axis ends six decades below its largest value."""
    low, high = axis.get_ylim()
    axis.set_ylim(max(low, 1e-6 * high), high)
