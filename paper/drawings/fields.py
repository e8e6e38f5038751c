"""Reduced models beside full order, contenders and other tools; where reduction pays."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from mesh_sizes import FULL, KINDS, growth, size_rows

from drawings import look
from vehiclemor.report.figures.theme import THIN, Style, panels, tick_decades
from vehiclemor.report.labels import declared, raised
from vehiclemor.report.unseen import method_rows
from vehiclemor.study.plans.protocol import FULL_ORDER

MODELS = {
    "double_wishbone": "suspension",
    "independent_suspension_vehicle": "14-DOF vehicle",
    "high_fidelity_vehicle": "high-fidelity vehicle",
    "flexible_truck": "truck",
}


def figure_pareto(results: look.Results) -> Figure:
    """Worst error on the test set over the time of a whole call: every method, all four models."""
    figure, grid = look.lettered(1, 4, look.TWO, 2.9, MODELS.values())
    for axis, model in zip(grid.flat, MODELS, strict=True):
        methods: dict[tuple[str, str], dict[str, Any]] = {}
        for study in (f"contenders-{model}", f"predictive-{model}"):
            data = results[study]
            # Times of the protocol's study count where both have a row.
            for row in method_rows(data):
                methods[row["method"], row["label"]] = row
        rows = [r for r in methods.values() if r["seconds"] > 0.0 and np.isfinite(r["score"])]
        full = _least((r["score"], r["seconds"]) for r in rows if r["role"] == FULL_ORDER)
        _draw_front(axis, full)
        for row in rows:
            if row["role"] != FULL_ORDER and row["method"] != "replay":
                _draw_row(axis, row)
        axis.axhline(1.0, **look.THIN)
        axis.set_xscale("log")
        axis.set_yscale("log")
        axis.set_ylim(bottom=max(axis.get_ylim()[0], 1e-3))
        look.decades(axis.yaxis, 1)
        axis.xaxis.set_minor_formatter(NullFormatter())
        axis.set_xlabel("whole call (ms)")
    grid[0, 0].set_ylabel("worst error / bound")
    look.legend(figure, grid.flat, 5)
    return figure


def _draw_front(axis: Any, points: list[tuple[float, float]]) -> None:
    y, x = np.array(points).reshape(-1, 2).T
    style = {"color": "black", "marker": ".", "markersize": 4, "linewidth": 0.9}
    axis.plot(1e3 * x, y, label="full order, fastest", **style)


def _draw_row(axis: Any, row: Mapping[str, Any]) -> None:
    look = declared().methods[row["method"]]
    style = {"marker": look.mark, "linestyle": "none", "markersize": 4, "markerfacecolor": "none"}
    axis.plot(1e3 * row["seconds"], row["score"], color=look.color, label=look.words, **style)
    if row["winner"]:
        ring = {"marker": "o", "markersize": 10, "linestyle": "none", "color": "black"}
        ring |= {"markerfacecolor": "none", "markeredgewidth": 0.7}
        axis.plot(1e3 * row["seconds"], row["score"], label="chosen by validation", **ring)


# Of meshes of one kind; offsets of names of vehicles from their marks, in points.
LOOKS: tuple[Style, ...] = (
    {"color": "#0072B2", "marker": "o"},
    {"color": "#D55E00", "marker": "s"},
    {"color": "#CC79A7", "marker": "^"},
)
OFFSETS = (-8, -12), (-2, -29), (5, -10)
NAMES = {"double_wishbone": "suspension", "independent_suspension_vehicle": "14-DOF"}
NAMES |= {"high_fidelity_vehicle": "high-fidelity"}


def figure_size(results: look.Results) -> Figure:
    """CPU time of a run over the number of coordinates, and how many times reduction gains.

    The three models of the paper stand beside the truck.  Hollow marks: the reduced model, the
    first of the study.
    """
    dataset = results["mesh_sizes"]
    figure, axes = panels(1, 2, (look.TWO, 2.8))
    left, right = axes[0]
    n, kinds = dataset["coordinates_of_mesh"].values, dataset["kind"].values
    full = dataset["seconds_median"].sel(label=FULL).values
    name = str(dataset["label"].values[1])
    reduced = dataset["seconds_median"].sel(label=name).values
    meshes = [kind for kind in dict.fromkeys(kinds.tolist()) if kind != "vehicle"]
    for kind, line in zip(meshes, LOOKS, strict=False):
        of_kind, word = kinds == kind, KINDS.get(kind, (kind, ""))[0]
        sizes, times, reduced_times = n[of_kind], full[of_kind], reduced[of_kind]
        exponent = growth(dataset, kind, FULL)
        slope = raised(f": n^{exponent:.1f}") if np.isfinite(exponent) else ""
        left.plot(sizes, times, label=f"{word}, full{slope}", **line)
        hollow: Style = line | {"markerfacecolor": "none", "linestyle": "--"}
        left.plot(sizes, reduced_times, label=f"{word}, {name}", **hollow)
        right.plot(sizes, times / reduced_times, label=f"{word}, the same mesh", **line)
    cars = kinds == "vehicle"
    black: Style = {"color": "black", "linestyle": "none", "marker": "D", "markersize": 4}
    left.plot(n[cars], full[cars], label="the paper's models, full", **black)
    left.plot(n[cars], reduced[cars], markerfacecolor="none", label="reduced", **black)
    right.plot(n[cars], full[cars] / reduced[cars], label="the paper's models", **black)
    for index in np.flatnonzero(cars):
        car = str(dataset["mesh"].values[index])
        at = n[index], full[index] / reduced[index]
        text = NAMES.get(car, car)
        # So that neither marks nor the line of no gain cross a name.
        beside = OFFSETS[sum(n[cars] < n[index]) % len(OFFSETS)]
        right.annotate(text, at, beside, textcoords="offset points", fontsize=7)
    rivals = [row for row in size_rows(dataset) if row["label"] == name]
    for group, marker in (("motion", "x"), ("strain", "+")):
        at = [(row["coordinates"], row[f"gain_{group}"]) for row in rivals]
        style: Style = {"linestyle": "none", "marker": marker, "color": "#009E73"}
        label = f"cheapest mesh of equal error, {group}"
        right.plot(*zip(*at, strict=True), label=label, markersize=7, **style)
    right.axhline(1.0, **THIN)
    # Room for the names of the vehicles.
    right.set_ylim(0.1, 2.0 * float(np.nanmax(full / reduced)))
    for axis in (left, right):
        axis.set_xscale("log")
        axis.set_yscale("log")
        axis.set_xlabel("coordinates of the full model")
        axis.legend(fontsize=6.5)
    left.set_title("(a) CPU time of a whole run in s", loc="left")
    right.set_title("(b) times that the reduced model is faster", loc="left")
    return figure


# Errors in m that are shown of other tools, by what they compute.
SHOWN = {"": (0.1, 2e-8), "-steps": (0.1, 1e-9), "-batch": (0.1, 2e-8)}
# Beginning of a label in the results of the peers -> colour, dashes, text; later ones win.
PEERS: Mapping[str, tuple[str, Any, str]] = {
    "ours": ("black", "-", "fastest here"),
    "CVODE in C": (look.RED, "-", "CVODE, C by hand"),
    "CasADi CVODES": (look.BLUE, "-", "CasADi CVODES"),
    "CasADi Runge-Kutta": (look.BLUE, "--", "CasADi Runge-Kutta"),
    "scikit-sundae": (look.GREEN, "-", "scikit-sundae"),
    "SciPy": (look.PINK, "-", "SciPy, best"),
    "JAX": (look.ORANGE, "-", "JAX diffrax"),
}


def figure_peers(results: Mapping[str, Any]) -> Figure:
    """CPU time over error of both vehicles in other tools: a run, a step and a run of a batch."""
    texts = ["a run", "a step of 10 ms", "a run of a batch of 200"] * 2
    figure, grid = look.lettered(2, 3, look.TWO, 3.6, texts, sharex="col")
    models = "independent_suspension_vehicle", "high_fidelity_vehicle"
    for row, model in zip(grid, models, strict=True):
        for axis, part in zip(row, ("", "-steps", "-batch"), strict=True):
            case = results["peers"][model + part]
            for label, (color, dashes, text) in PEERS.items():
                points = _front(case, label, SHOWN[part])
                if points:
                    style = {"color": color, "linestyle": dashes, "marker": ".", "markersize": 3}
                    axis.loglog(*np.array(points).T, label=text, **style)
            axis.set_xlim(*SHOWN[part])
            tick_decades(axis.yaxis, *axis.get_ylim())
        row[0].set_ylabel(f"{MODELS[model]}\nCPU time (ms)")
    for axis in grid[-1]:
        axis.set_xlabel("largest error of the position (m)")
    look.legend(figure, grid.flat, 4)
    return figure


# Model of the study of steps -> colour; integrator -> dashes, text.
STEPPED = {
    "full": "black",
    "relaxed tires": look.ORANGE,
    "reduced": look.GREEN,
    "single track": look.PINK,
}
INTEGRATORS = {"rk4": ("-", "Runge-Kutta"), "ros2": ("--", "linearly implicit")}


def figure_steps(results: Mapping[str, Any], speed: float = 20.0) -> Figure:
    """CPU time of a simulated second in exported C over error, at fixed steps, of both vehicles."""
    figure, grid = look.lettered(1, 2, look.TWO, 2.7, [MODELS[m] for m in results["steps"]])
    for axis, part in zip(grid.flat, results["steps"].values(), strict=True):
        for cost in (row for row in part["costs"] if row["precision"] == "double"):
            model, integrator = cost["model"], cost["integrator"]
            if model not in STEPPED:
                continue
            case = {"model": model, "integrator": integrator, "speed": speed}
            rows = [row for row in part["scan"] if case.items() <= row.items()]
            points = [(r["score"], 1e-3 * cost["nanoseconds"] / r["step"]) for r in rows]
            dashes, text = INTEGRATORS[integrator]
            style = {"color": STEPPED[model], "linestyle": dashes, "marker": ".", "markersize": 4}
            axis.loglog(*np.array(points).T, label=f"{model}, {text}", **style)
        axis.axvline(1.0, **look.THIN)
        axis.set_xlim(1e3, 1e-4)
        axis.set_xlabel("largest error / bound")
    grid[0, 0].set_ylabel("CPU time of a simulated second (us)")
    look.legend(figure, grid.flat, 4)
    return figure


def _front(
    case: Mapping[str, Any], beginning: str, shown: tuple[float, float]
) -> list[tuple[float, float]]:
    """Errors and least milliseconds of curves with this beginning, outputs left out."""
    count = case.get("per", (1, ""))[0]
    points: list[tuple[float, float]] = []
    for label, curve in case["curves"].items():
        if not label.startswith(beginning) or curve["delivers"] == "outputs":
            continue
        near = [p for p in curve["points"] if shown[1] <= p["error"] <= shown[0]]
        points.extend((p["error"], 1e3 * p["seconds"] / count) for p in near)
    return _least(points)


def _least(points: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
    """Of points (error, time) those that no point of smaller error undercuts in time."""
    front: list[tuple[float, float]] = []
    for point in sorted(points):
        if not front or point[1] < front[-1][1]:
            front.append(point)
    return front
