"""Tables and figures of what was measured: whoever is faster stands first."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from vehiclemor.report.figures import theme

OURS = "ours"
HEADER = ("who", "CPU time", "spread", "over ours", "at tolerance", "error", "rhs calls")
BLUE, RED, GREEN, PINK, ORANGE, CYAN = theme.COLORS
DOTTED = (0, (1, 1))
# Beginning of a label -> color, line and its width.
LINES: dict[str, tuple[str, Any, float]] = {
    "ours": ("black", "-", 2.2),
    "ours ros34pw2": ("black", DOTTED, 1.4),
    "ours exponential_adams": ("black", "--", 1.4),
    "ours newton": ("black", "--", 1.4),
    "ours newton_lanes": ("black", "-", 2.2),
    "CVODE in C": (RED, "--", 1.4),
    "CVODE in C, bare rhs": (RED, "-", 2.2),
    "CasADi": (BLUE, "--", 1.4),
    "CasADi CVODES, C code": (BLUE, "-", 1.4),
    "CasADi Runge-Kutta": (BLUE, DOTTED, 1.4),
    "scikit-sundae CVODE": (GREEN, "-", 1.4),
    "scikit-sundae IDA": (GREEN, "--", 1.4),
    "SciPy": (PINK, "-", 1.4),
    "JAX": (ORANGE, "-", 1.4),
    "Exudyn": (CYAN, "-", 1.4),
}
# Errors are drawn down to this part of the tightest target; smaller ones stand there.
SEEN = 0.02

# What times are divided by, where it is nothing.
ONCE = (1, "")

Points = Sequence[Mapping[str, Any]]


def choose(points: Points, target: float) -> Mapping[str, Any] | None:
    """Cheapest point of a scan at a target error; none if it isn't reached.

    Only a tolerance counts for which it and all tighter ones of the scan stay at or below the
    target: no lucky runs.
    """
    good: list[Mapping[str, Any]] = []
    for point in sorted(points, key=lambda p: p["tolerance"]):
        if not point["error"] <= target:
            break
        good.append(point)
    return min(good, key=lambda p: p["seconds"], default=None)


def front(scans: Iterable[Points], least: float = 0.0) -> list[tuple[float, float]]:
    """Errors, the smallest `least`, and the least seconds in which a scan keeps them."""
    scans, found = list(scans), []
    for error in sorted({max(p["error"], least) for points in scans for p in points}):
        chosen = [point for points in scans if (point := choose(points, error))]
        seconds = min((point["seconds"] for point in chosen), default=np.inf)
        if seconds < (found[-1][1] if found else np.inf):
            found.append((error, seconds))
    return found


def rows(case: Mapping[str, Any], target: float, delivers: str) -> list[tuple[str, ...]]:
    """Rows of all who deliver this at a target error, the fastest first; then who can't."""
    curves = {k: c for k, c in case["curves"].items() if c["delivers"] == delivers}
    chosen = {label: choose(curve["points"], target) for label, curve in curves.items()}
    reached = [(label, point) for label, point in chosen.items() if point is not None]
    own = min((p["seconds"] for label, p in reached if label.startswith(OURS)), default=np.nan)
    count, found = case.get("per", ONCE)[0], []
    for label, point in sorted(reached, key=lambda pair: pair[1]["seconds"]):
        times = (point["seconds"], point["spread"][0], point["spread"][2])
        seconds, low, high = (time_text(s / count) for s in times)
        ratio, calls = ratio_text(label, point["seconds"] / own), point.get("evaluations", "")
        tolerance, error = f"{point['tolerance']:.1e}", f"{point['error']:.1e}"
        found.append((label, seconds, f"{low} to {high}", ratio, tolerance, error, str(calls)))
    for label, curve in curves.items():
        if chosen[label] is None:
            error = f"at best {least_error(curve)}"
            found.append((label, "not reached", "", "", "", error, ""))
    return found


def ratio_text(label: str, ratio: float) -> str:
    """Time over that of the fastest of ours; a peer that is faster is said to be so in words."""
    if np.isnan(ratio):
        return "OURS DO NOT REACH IT"
    text = f"{ratio:.2g}" if ratio < 10.0 else f"{ratio:.0f}"
    return f"{text}: FASTER THAN OURS" if ratio < 1.0 and not label.startswith(OURS) else text


def least_error(curve: Mapping[str, Any]) -> str:
    """Least distance of a curve from the reference."""
    return f"{min((p['error'] for p in curve['points']), default=np.nan):.1e}"


def kinds(case: Mapping[str, Any]) -> list[str]:
    """What the curves of a comparison deliver: states, outputs."""
    return list(dict.fromkeys(curve["delivers"] for curve in case["curves"].values()))


def summary(cases: Mapping[str, Mapping[str, Any]]) -> str:
    """Of each comparison and target error who is first, and the fastest of all others."""
    body = []
    for name, case in cases.items():
        for delivers, target in product(kinds(case), case["targets"]):
            reached = [row for row in rows(case, target, delivers) if row[3]]
            own = [row for row in reached if row[0].startswith(OURS)][:1]
            other = [row for row in reached if not row[0].startswith(OURS)][:1]
            pair = sorted(own + other, key=reached.index)
            first, then = ([f"{row[0]} {row[1]}" for row in pair] + ["", ""])[:2]
            ratio = other[0][3] if other else ""
            body.append((name, delivers, f"{target:g} {case['unit']}", first, then, ratio))
    header = ("case", "delivers", "error", "first", "then", "other over ours")
    return "\n".join(["## In short: ours, and the fastest other", "", *table(header, body)])


def time_text(seconds: float) -> str:
    """Seconds with three digits and a unit."""
    units = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
    unit = next((unit for unit, size in units.items() if seconds >= size), "us")
    return f"{seconds / units[unit]:#.3g} {unit}".replace(". ", " ")


def table(header: Iterable[str], body: Iterable[Iterable[str]]) -> list[str]:
    """Lines of a table in Markdown."""
    cells = [[*map(str, row)] for row in (header, *body)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    padded = [map(str.ljust, row, widths) for row in cells]
    head, *lines = (f"| {' | '.join(row)} |" for row in padded)
    return [head, f"|{'|'.join('-' * (w + 2) for w in widths)}|", *lines]


def case_text(case: Mapping[str, Any]) -> str:
    """Tables of one comparison, and who is missing and why."""
    each = case.get("per", ONCE)[1]
    per = f", for each {each}" if each else ""
    lines = [f"## {case['title']}", "", f"{case['clock']}{per}; {case['about']}", ""]
    for delivers, target in product(kinds(case), case["targets"]):
        lines += [f"Error of at most {target:g} {case['unit']}, {delivers}:", ""]
        lines += [*table(HEADER, rows(case, target, delivers)), ""]
    accuracy = [(label, least_error(curve)) for label, curve in case["curves"].items()]
    lines += ["Least distance from the reference (do they solve the same equations?):", ""]
    lines += [*table(("who", case["unit"]), accuracy), ""]
    return "\n".join(lines + absent(case))


def absent(case: Mapping[str, Any]) -> list[str]:
    """A row for each peer that is not there, or that can't do it."""
    missing = case["missing"].items()
    return [*table(("not measured", "why"), missing), ""] if missing else []


def context_text(case: Mapping[str, Any]) -> str:
    """Other vehicles and scenes, for scale alone."""
    lines = [f"## {case['title']}", "", f"{case['clock']}; {case['about']}", ""]
    by_time = sorted(case["rows"].items(), key=lambda pair: pair[1]["seconds"])
    body = [(k, time_text(r["seconds"]), r["what"]) for k, r in by_time]
    lines += table(("who", "CPU time for a simulated second", "what"), body)
    return "\n".join([*lines, "", *absent(case)])


def drawn(case: Mapping[str, Any]) -> dict[str, list[tuple[float, float]]]:
    """Work-precision lines of what is delivered first; those of SciPy as the best of them."""
    scans: dict[str, list[Points]] = {}
    for label, curve in case["curves"].items():
        if curve["delivers"] == kinds(case)[0]:
            name = "SciPy, the best" if label.startswith("SciPy") else label
            scans.setdefault(name, []).append(curve["points"])
    least = SEEN * min(case["targets"])
    return {label: front(points, least) for label, points in scans.items()}


def draw(panel: Any, case: Mapping[str, Any]) -> None:
    """Lines of one comparison."""
    for label, points in drawn(case).items():
        x, y = np.array(points).reshape(-1, 2).T
        known = max((k for k in LINES if label.startswith(k)), key=len)
        color, dashes, width = LINES[known]
        style = {"color": color, "linestyle": dashes, "linewidth": width}
        milliseconds = 1e3 * y / case.get("per", ONCE)[0]
        panel.loglog(x, milliseconds, label=label, marker=".", markersize=4, **style)
    panel.invert_xaxis()
    theme.tick_decades(panel.yaxis, *panel.get_ylim())
    panel.set_xlabel(f"error ({case['unit']})")


def figure(cases: Mapping[str, Mapping[str, Any]], path: Path) -> None:
    """Work-precision of the comparisons of one model, a panel each, as PNG and PDF."""
    with theme.styled():
        made, panels = theme.panels(1, len(cases), (3.3 * max(len(cases), 1.4), 3.7))
        for number, (case, panel) in enumerate(zip(cases.values(), panels[0], strict=True)):
            draw(panel, case)
            panel.set_title(theme.letter(number, case["panel"]) if len(cases) > 1 else "")
        panels[0, 0].set_ylabel("CPU time (ms)")
        theme.legend_below(made, made.axes)
        for kind in ("png", "pdf"):
            theme.save_figure(made, path.with_name(f"{path.name}.{kind}"))
