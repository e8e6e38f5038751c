"""Lines, legends and selections that figures share: one style for each method."""

from collections.abc import Iterable, Mapping
from itertools import cycle
from typing import Any, Literal

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vehiclemor.report.labels import MARK, TRAINED
from vehiclemor.report.printing import alphabetic

Results = Mapping[str, "xr.Dataset"]
Style = dict[str, Any]
# Colour-blind safe (M. Okabe, K. Ito).
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
FULL: Style = {"color": "black", "linewidth": 2.6, "alpha": 0.45}
# Gaps of an upper line show the lower one where both coincide.
DEFAULT: Style = {"color": "#0072B2", "linestyle": (0, (3, 3)), "zorder": 2.5}
LITERAL: Style = {"color": "#D55E00", "linestyle": "-."}
REPLAY: Style = {"color": "#666666", "linestyle": ":", "linewidth": 1.2}
OTHER: Style = {"color": "#009E73", "linestyle": (0, (5, 1, 1, 1, 1, 1))}
# Lines differ where they are printed in grey too.
DASHES = ("--", (0, (8, 2)), (0, (1, 1)), (0, (4, 1, 1, 1)), (0, (8, 2, 2, 2)))
CROSS: Style = {"marker": "x", "markersize": 6, "markeredgewidth": 1.6, "linestyle": "none"}
# Of a legend in inches: what stands beside a text, and a letter of it.
HANDLE, LETTER = 0.55, 0.068
# Label of a method in a study -> its style.
STYLES = {
    "full_order": FULL,
    "replay": REPLAY,
    "pod": DEFAULT,
    "pod_literal": LITERAL,
    "pod_state": OTHER,
    "pod_r3": OTHER,
    "fixed_basis": OTHER,
}


def styles(methods: Iterable[str]) -> dict[str, Style]:
    """Style of each method by its label: its own, or a colour and dashes that no other line has."""
    methods = list(methods)
    own = {STYLES[method]["color"]: method for method in reversed(methods) if method in STYLES}
    free = cycle([color for color in COLORS if color not in own] or list(COLORS))
    dashes = cycle(DASHES)
    return {
        method: STYLES[method]
        if method in own.values()
        else {"color": next(free), "linestyle": next(dashes)}
        for method in methods
    }


def panels(
    rows: int, columns: int, size: tuple[float, float], **options: Any
) -> tuple[Figure, np.ndarray]:
    """Figure of a size in inches without a window, and its panels (rows, columns)."""
    figure = Figure(figsize=size)
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def letter(number: int) -> str:
    """Letter of a panel, counted from 0."""
    return f"({alphabetic(number)})"


def tell_empty(figure: Figure) -> None:
    """Say in panels of lines that there is nothing that could be drawn."""
    for axis in figure.axes:
        lines = [line for line in axis.lines if line.get_transform() == axis.transData]
        points = [found for line in lines if np.size(found := line.get_xydata())]
        if points and not any(np.isfinite(found).all(axis=1).any() for found in points):
            words = f"no finite values{' above 0' if axis.get_yscale() == 'log' else ''}"
            axis.text(0.5, 0.5, words, ha="center", va="center", transform=axis.transAxes)


def legend_outside(
    figure: Figure,
    axes: Iterable[Axes],
    columns: int = 4,
    place: Literal["upper", "lower"] = "upper",
) -> None:
    """One legend above (or `lower`: below) all panels, of the lines in some of them.

    With 0 `columns` it has as many as there is room for.
    """
    shown = {text: h for a in axes for h, text in zip(*a.get_legend_handles_labels(), strict=True)}
    longest = max(map(len, shown), default=0)
    room = int(figure.get_figwidth() / (HANDLE + LETTER * longest))
    columns = min(columns or max(1, room), len(shown))
    where = "outside upper center" if place == "upper" else "outside lower center"
    told = f"{MARK} {TRAINED}" if any(text.endswith(MARK) for text in shown) else None
    figure.legend(shown.values(), shown, loc=where, ncols=columns, title=told)
