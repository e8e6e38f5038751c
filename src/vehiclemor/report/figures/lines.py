"""Lines, legends and selections that figures share: one style for each method."""

from collections.abc import Iterable, Mapping
from itertools import cycle
from typing import Any

import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

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
CROSS: Style = {"marker": "x", "markersize": 6, "markeredgewidth": 1.6, "linestyle": "none"}
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
    """Style of each method by its label: its own, or a colour that no other line has."""
    methods = list(methods)
    taken = {STYLES[method]["color"] for method in methods if method in STYLES}
    free = cycle([color for color in COLORS if color not in taken] or list(COLORS))
    return {m: STYLES.get(m) or {"color": next(free), "linestyle": "--"} for m in methods}


def letter(number: int) -> str:
    """Letter of a panel, counted from 0."""
    return f"({'abcdefghijklmnopqrstuvwxyz'[number]})"


def legend_above(figure: Figure, axis: Axes, columns: int = 4) -> None:
    """One legend above all panels, of the lines in one of them."""
    handles, labels = axis.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=columns)
