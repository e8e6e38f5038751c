"""One look for all figures: lines, panels, axes, legends, and the files they are written to."""

import string
from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from itertools import cycle
from math import ceil
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib.style
import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.ticker import LogFormatterSciNotation, LogLocator, MaxNLocator, NullFormatter

from vehiclemor.exceptions import InputError
from vehiclemor.files import begins_with, replaceable, write_whole
from vehiclemor.report.labels import MARK, TRAINED, MethodLook, declared, raised
from vehiclemor.study.plans.study_runs import FACTORS, PARAMETER

Style = dict[str, Any]
FORMATS = ("pdf", "svg", "png")
OWN_STYLE = Path(__file__).with_name("style.mplstyle")
# How their files begin.
BEGINNINGS = {"pdf": b"%PDF", "svg": b"<?xml", "png": b"\x89PNG"}
# Without a date and a version, two regenerations give the same bytes.
METADATA: dict[str, dict[str, None]] = {
    "pdf": {"CreationDate": None, "Producer": None, "Creator": None},
    "svg": {"Date": None, "Creator": None},
    "png": {"Software": None},
}
# Colour-blind safe (M. Okabe, K. Ito).
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
FULL: Style = {"color": "black", "linewidth": 2.6, "alpha": 0.45}
# Lines differ where they are printed in grey too.
DASHES = ("--", (0, (8, 2)), (0, (1, 1)), (0, (4, 1, 1, 1)), (0, (8, 2, 2, 2)))
# Without the marks of what has failed, and of an error 0 on a logarithmic axis.
MARKERS = "os^D<>phP*d"
CROSS: Style = {"marker": "x", "markersize": 6, "markeredgewidth": 1.6, "linestyle": "none"}
ZERO: Style = {"marker": 7, "markersize": 6, "linestyle": "none"}
THIN: Style = {"color": "black", "linewidth": 0.8}
UNITS = {"control_period": "s"}


def look_of(label: str, methods: Mapping[str, str]) -> MethodLook | None:
    """Look of a label, or of the method that it is of; none of what the package does not have."""
    known = declared().methods
    return known.get(label) or known.get(methods.get(label, ""))


def method_style(look: MethodLook) -> Style:
    """Colour and dashes, whose gaps show a line below."""
    return {"color": look.color, "linestyle": (0, tuple(look.dashes))}


def styles(labels: Iterable[str], methods: Mapping[str, str]) -> dict[str, Style]:
    """Style of each label: that of its method, of further ones what no other line has."""
    known: dict[str, Style] = {}
    rest: list[str] = []
    for label in labels:
        look = look_of(label, methods)
        style = method_style(look) if look else FULL
        if (look or label == "full_order") and style not in known.values():
            known[label] = style
        else:
            rest.append(label)
    taken = {style["color"] for style in known.values()}
    colors = [color for color in COLORS if color not in taken]
    if len(rest) > len(colors):
        ramp = colormaps["viridis"](np.linspace(0.0, 0.95, len(rest)))
        colors = list(map(to_hex, ramp))
    for label, color, dashes in zip(rest, colors, cycle(DASHES), strict=False):
        known[label] = {"color": color, "linestyle": dashes}
    return known


def marks(labels: Iterable[str], methods: Mapping[str, str]) -> dict[str, str]:
    """Mark of each label: that of its method, for further ones the marks in turn."""
    known: dict[str, str] = {}
    free = cycle(MARKERS)
    for label in labels:
        look = look_of(label, methods)
        taken = known.values()
        known[label] = look.mark if look and look.mark not in taken else next(free)
    return known


def methods_of(dataset: xr.Dataset) -> dict[str, str]:
    """Label -> method, as far as a result tells."""
    if "method" not in dataset.coords or dataset["method"].dims != ("label",):
        return {}
    return dataset["method"].to_series().to_dict()


def panels(
    rows: int, columns: int, size: tuple[float, float], **options: Any
) -> tuple[Figure, np.ndarray]:
    """Figure of a size in inches without a window, and its panels (rows, columns)."""
    figure = Figure(figsize=size)
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def letter(number: int, title: str = "") -> str:
    """Title of a panel, counted from 0."""
    return f"({string.ascii_lowercase[number]}) {title}".rstrip()


class Ticks(NamedTuple):
    """Coordinates of a dimension's values on an axis, and the label of the axis.

    They are perturbations in %, numbers, or 0, 1, 2 ... of what has `names`.
    """

    at: np.ndarray
    label: str
    names: Sequence[str] = ()

    def scale(self, panel: Axes) -> None:
        """Label the lower axis of a panel, logarithmic where the numbers ask for it."""
        panel.set_xlabel(self.label)
        if self.names:
            panel.set_xlim(-0.5, len(self.names) - 0.5)
            # As many names as there is room for, by their letters.
            room = max(1, 60 // max(map(len, self.names)))
            step = ceil(len(self.names) / min(12, room))
            panel.set_xticks(self.at[::step], list(self.names)[::step])
            return
        if 0.0 < 30.0 * self.at.min() <= self.at.max():
            panel.set_xscale("log")
        if self.at.dtype.kind == "i":
            panel.xaxis.set_major_locator(MaxNLocator(nbins=8, integer=True))


def ticks_of(dataset: xr.Dataset, name: str) -> Ticks:
    """Ticks of a dimension of a grid, or of a coordinate on one."""
    values, text = dataset[name].values, name.removeprefix(PARAMETER).replace("_", " ")
    if name in FACTORS:
        return Ticks(100.0 * (values - 1.0), f"{text.removesuffix(' factor')} perturbation (%)")
    if not np.issubdtype(values.dtype, np.number):
        return Ticks(np.arange(len(values)), text, [str(value) for value in values])
    unit = str(dataset[name].attrs.get("units", UNITS.get(name, "1")))
    return Ticks(values, text if unit == "1" else f"{text} ({raised(unit)})")


def tick_decades(axis: Axis, low: float, high: float) -> None:
    """Ticks of a logarithmic axis: some of each decade where there are few decades."""
    if np.log10(high / low) < 2.5:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        powers = LogFormatterSciNotation(minor_thresholds=(np.inf, np.inf))
        axis.set_major_formatter("{x:g}" if low >= 1e-4 else powers)
        axis.set_minor_formatter(NullFormatter())


def hide_rounding(axis: Axes) -> None:
    """A logarithmic axis ends six decades below its largest value."""
    low, high = axis.get_ylim()
    axis.set_ylim(max(low, 1e-6 * high), high)


def legend_below(figure: Figure, axes: Iterable[Axes]) -> None:
    """The one legend, below all panels, of the lines in some of them."""
    shown = {text: h for a in axes for h, text in zip(*a.get_legend_handles_labels(), strict=True)}
    if not shown:
        return
    lengths = [len(text.replace("$", "")) for text in shown]

    def width(columns: int) -> float:
        # In inches: the line beside a text, and its letters.
        return sum(0.55 + 0.068 * max(part) for part in np.array_split(lengths, columns))

    fitting = (n for n in range(len(shown), 1, -1) if width(n) <= figure.get_figwidth())
    # As few columns as the rows need, so that none stands almost empty.
    rows = ceil(len(shown) / next(fitting, 1))
    columns = ceil(len(shown) / rows)
    title = f"{MARK} {TRAINED}" if any(MARK in text for text in shown) else None
    where = "outside lower center"
    figure.legend(shown.values(), shown, loc=where, ncols=columns, title=title)


def tell_empty(figure: Figure) -> None:
    """Say in panels of lines that there is nothing that could be drawn."""
    for axis in figure.axes:
        lines = [line for line in axis.lines if line.get_transform() == axis.transData]
        points = [np.asarray(line.get_xydata()) for line in lines]
        points = [each for each in points if each.size]
        if points and not np.isfinite(np.concatenate(points)).all(axis=1).any():
            text = "no finite values"
            if axis.get_yscale() == "log":
                text += " above 0"
            axis.text(0.5, 0.5, text, ha="center", va="center", transform=axis.transAxes)


def styled(style: str = "") -> AbstractContextManager[None]:
    """The package's style, with a style of Matplotlib (name or file) on top."""
    return matplotlib.style.context([OWN_STYLE, *([style] if style else [])])


def picture_path(path: Path) -> Path:
    """A path that a picture may be written to: nothing stands there, or one of its format."""
    suffix = path.suffix.removeprefix(".").lower()
    if suffix not in FORMATS:
        raise InputError(f"{path}: a figure is one of {', '.join(FORMATS)}")
    return replaceable(path, f"picture as {suffix.upper()}", begins_with(BEGINNINGS[suffix]))


def save_figure(figure: Figure, path: Path) -> Path:
    """Write a complete figure; its format is the file's suffix."""
    suffix = picture_path(path).suffix.removeprefix(".").lower()
    metadata = METADATA[suffix]
    return write_whole(path, lambda part: figure.savefig(part, format=suffix, metadata=metadata))
