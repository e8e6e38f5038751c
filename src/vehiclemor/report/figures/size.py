"""From which size on reducing a vehicle pays: times of whole runs over the size of the model."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from vehiclemor.report.figures import theme
from vehiclemor.report.figures.theme import Style
from vehiclemor.report.sizes import KINDS, growth, size_rows
from vehiclemor.study.plans.size import FULL

LOOKS: tuple[Style, ...] = (
    {"color": "#0072B2", "marker": "o"},
    {"color": "#D55E00", "marker": "s"},
    {"color": "#CC79A7", "marker": "^"},
)
# Places of names beside marks, in points.
OFFSETS = (4, 4), (-16, -13), (4, -17)
VEHICLES = {"double_wishbone": "suspension", "independent_suspension_vehicle": "14-DOF"}
VEHICLES |= {"high_fidelity_vehicle": "high-fidelity"}


def figure_size(dataset: xr.Dataset) -> Figure:
    """CPU time of a whole run over the number of coordinates, and how many times reduction gains.

    The three models of the paper stand beside the truck.  Hollow marks: the reduced model, the
    first of the study.
    """
    figure, axes = theme.panels(1, 2, (7.2, 3.6))
    left, right = axes[0]
    n, kinds = dataset["coordinates_of_mesh"].values, dataset["kind"].values
    full = dataset["seconds_median"].sel(label=FULL).values
    name = str(dataset["label"].values[1])
    reduced = dataset["seconds_median"].sel(label=name).values
    meshes = [kind for kind in dict.fromkeys(kinds.tolist()) if kind != "vehicle"]
    for kind, look in zip(meshes, LOOKS, strict=False):
        own, word = kinds == kind, KINDS.get(kind, (kind, ""))[0]
        slope = f"{word}, full: n^{growth(dataset, kind, FULL):.1f}"
        left.plot(n[own], full[own], label=slope, **look)
        hollow: Style = look | {"markerfacecolor": "none", "linestyle": "--"}
        left.plot(n[own], reduced[own], label=f"{word}, {name}", **hollow)
        right.plot(n[own], full[own] / reduced[own], label=f"{word}, the same mesh", **look)
    cars = kinds == "vehicle"
    black: Style = {"color": "black", "linestyle": "none", "marker": "D", "markersize": 4}
    left.plot(n[cars], full[cars], label="the paper's models, full", **black)
    left.plot(n[cars], reduced[cars], markerfacecolor="none", label="reduced", **black)
    right.plot(n[cars], full[cars] / reduced[cars], label="the paper's models", **black)
    for car, place in zip(dataset["mesh"].values[cars], np.flatnonzero(cars), strict=True):
        at = n[place], full[place] / reduced[place]
        text = VEHICLES.get(str(car), str(car))
        # So that neither marks nor the line of no gain cross a name.
        beside = OFFSETS[sum(n[cars] < n[place]) % len(OFFSETS)]
        right.annotate(text, at, beside, textcoords="offset points", fontsize=7)
    rivals = [row for row in size_rows(dataset) if row["label"] == name]
    for group, marker in (("motion", "x"), ("strain", "+")):
        at = [(row["coordinates"], row[f"gain_{group}"]) for row in rivals]
        style: Style = {"linestyle": "none", "marker": marker, "color": "#009E73"}
        label = f"cheapest mesh of equal error, {group}"
        right.plot(*zip(*at, strict=True), label=label, markersize=7, **style)
    right.axhline(1.0, **theme.THIN)
    right.set_ylim(0.5, 2.0 * float(np.nanmax(full / reduced)))
    for axis in (left, right):
        axis.set_xscale("log")
        axis.set_yscale("log")
        axis.set_xlabel("coordinates of the full model")
        axis.legend(fontsize=6.5)
    left.set_title("(a) CPU time of a whole run in s", loc="left")
    right.set_title("(b) times that the reduced model is faster", loc="left")
    return figure
