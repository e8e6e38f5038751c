"""Tables and figures of what was measured: whoever is faster stands first."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vehiclemor.report.figures import theme

OURS = "ours"
HEADER = ("who", "CPU time", "spread", "over ours", "at tolerance", "error", "rhs calls")
# Beginning of a label -> its line; those of one package that begin alike are drawn as the best.
LINES: dict[str, dict[str, Any]] = {
    "ours ros34pw2": {"color": "black", "linestyle": (0, (1, 1))},
    "ours etdrk4": {"color": "black", "linestyle": "-", "linewidth": 2.2},
    "ours exponential_adams": {"color": "black", "linestyle": "--"},
    "ours newton_lanes": {"color": "black", "linestyle": "-", "linewidth": 2.2},
    "ours newton": {"color": "black", "linestyle": "--"},
    "ours": {"color": "black", "linestyle": "-", "linewidth": 2.2},
    "CVODE in C": {"color": theme.COLORS[1], "linestyle": "--"},
    "CVODE in C, bare rhs": {"color": theme.COLORS[1], "linewidth": 2.2},
    "CasADi CVODES, C code": {"color": theme.COLORS[0], "linestyle": "-"},
    "CasADi Runge-Kutta": {"color": theme.COLORS[0], "linestyle": (0, (1, 1))},
    "CasADi": {"color": theme.COLORS[0], "linestyle": "--"},
    "scikit-sundae CVODE": {"color": theme.COLORS[2], "linestyle": "-"},
    "scikit-sundae IDA": {"color": theme.COLORS[2], "linestyle": "--"},
    "SciPy": {"color": theme.COLORS[3], "linestyle": "-"},
    "JAX": {"color": theme.COLORS[4], "linestyle": "-"},
    "Exudyn": {"color": theme.COLORS[5], "linestyle": "-"},
    "pyMOR": {"color": theme.COLORS[4], "linestyle": "--"},
}

# Errors are drawn down to this part of the tightest target; smaller ones stand there.
SEEN = 0.02

Points = Sequence[Mapping[str, Any]]


def choose(points: Points, target: float) -> Mapping[str, Any] | None:
    """Cheapest point of a scan at a target error; none if it isn't reached.

    Only a tolerance counts for which it and all tighter ones of the scan stay at or below the
    target: no lucky runs.

    Parameters
    ----------
    points
        With `tolerance`, `error` and `seconds`, in any order.
    target
        Largest error.
    """
    good: list[Mapping[str, Any]] = []
    for point in sorted(points, key=lambda p: p["tolerance"]):
        if not point["error"] <= target:
            break
        good.append(point)
    return min(good, key=lambda p: p["seconds"], default=None)


def front(points: Points) -> list[tuple[float, float]]:
    """Errors that are kept from a tolerance on, and the least seconds for them, by error."""
    errors = sorted({p["error"] for p in points})
    best = [(error, choose(points, error)) for error in errors]
    found: list[tuple[float, float]] = []
    for error, point in best:
        if point is not None and (not found or point["seconds"] < found[-1][1]):
            found.append((error, point["seconds"]))
    return found


def rows(case: Mapping[str, Any], target: float, delivers: str) -> list[tuple[str, ...]]:
    """Rows of all who deliver this at a target error, the fastest first; then who can't.

    The ratio is that to the fastest of ours.  A peer that is faster is said to be so in words.
    """
    curves = {k: c for k, c in case["curves"].items() if c["delivers"] == delivers}
    chosen = {label: choose(curve["points"], target) for label, curve in curves.items()}
    reached = {label: point for label, point in chosen.items() if point is not None}
    own = min((p["seconds"] for k, p in reached.items() if k.startswith(OURS)), default=np.nan)
    found = []
    for label, point in sorted(reached.items(), key=lambda pair: pair[1]["seconds"]):
        ratio = point["seconds"] / own
        verdict = f"{ratio:.2g}" if ratio < 10.0 else f"{ratio:.0f}"
        if not label.startswith(OURS) and not ratio >= 1.0:
            verdict = f"{verdict}: FASTER THAN OURS" if own > 0.0 else "OURS DO NOT REACH IT"
        low, _, high = (time_text(s / case.get("per", [1])[0]) for s in point["spread"])
        seconds = time_text(point["seconds"] / case.get("per", [1])[0])
        tolerance, error = f"{point['tolerance']:.1e}", f"{point['error']:.1e}"
        calls = str(point.get("evaluations", ""))
        found.append((label, seconds, f"{low} to {high}", verdict, tolerance, error, calls))
    for label, curve in curves.items():
        if chosen[label] is None:
            least = min((p["error"] for p in curve["points"]), default=np.nan)
            found.append((label, "not reached", "", "", "", f"at best {least:.1e}", ""))
    return found


def summary(cases: Mapping[str, Mapping[str, Any]]) -> str:
    """Of each comparison and target error who is first, and the fastest of all others."""
    body = []
    for name, case in cases.items():
        for delivers in dict.fromkeys(c["delivers"] for c in case["curves"].values()):
            for target in case["targets"]:
                reached = [row for row in rows(case, target, delivers) if row[3]]
                own = next((row for row in reached if row[0].startswith(OURS)), None)
                other = next((row for row in reached if not row[0].startswith(OURS)), None)
                pair = sorted([row for row in (own, other) if row], key=reached.index)
                first, then = ([f"{row[0]} {row[1]}" for row in pair] + ["", ""])[:2]
                ratio = other[3] if other else ""
                body.append((name, delivers, f"{target:g} {case['unit']}", first, then, ratio))
    header = ("case", "delivers", "error", "first", "then", "other over ours")
    return "\n".join(["## In short: ours, and the fastest other", "", *table(header, body)])


def time_text(seconds: float) -> str:
    """Seconds with three digits and a unit."""
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if seconds >= size:
            return f"{seconds / size:#.3g} {unit}".replace(". ", " ")
    return f"{seconds / 1e-6:#.3g} us".replace(". ", " ")


def table(header: Iterable[str], body: Iterable[Iterable[str]]) -> list[str]:
    """Lines of a table in Markdown."""
    cells = [[*map(str, row)] for row in (header, *body)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = [
        "| " + " | ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)) + " |"
        for row in cells
    ]
    return [lines[0], "|" + "|".join("-" * (w + 2) for w in widths) + "|", *lines[1:]]


def case_text(case: Mapping[str, Any]) -> str:
    """Tables of one comparison, and who is missing and why."""
    per = f", for each {case['per'][1]}" if "per" in case else ""
    lines = [f"## {case['title']}", "", f"{case['clock']}{per}; {case['about']}", ""]
    kinds = list(dict.fromkeys(c["delivers"] for c in case["curves"].values()))
    for delivers in kinds:
        for target in case["targets"]:
            lines += [f"Error of at most {target:g} {case['unit']}, {delivers}:", ""]
            lines += [*table(HEADER, rows(case, target, delivers)), ""]
    accuracy = [
        (label, f"{min((p['error'] for p in curve['points']), default=np.nan):.1e}")
        for label, curve in case["curves"].items()
    ]
    lines += ["Least distance from the reference (do they solve the same equations?):", ""]
    lines += [*table(("who", case["unit"]), accuracy), ""]
    return "\n".join(lines + missing_lines(case))


def missing_lines(case: Mapping[str, Any]) -> list[str]:
    """A row for each peer that is not there, or that can't do it."""
    absent = case.get("missing", {})
    return [*table(("not measured", "why"), absent.items()), ""] if absent else []


def context_text(case: Mapping[str, Any]) -> str:
    """Other vehicles and scenes, for scale alone."""
    lines = [f"## {case['title']}", "", f"{case['clock']}; {case['about']}", ""]
    by_time = sorted(case["rows"].items(), key=lambda pair: pair[1]["seconds"])
    body = [(k, time_text(r["seconds"]), r["what"]) for k, r in by_time]
    lines += table(("who", "CPU time for a simulated second", "what"), body)
    return "\n".join([*lines, "", *missing_lines(case)])


def style_of(label: str) -> dict[str, Any]:
    """Line of a label: that of the longest beginning."""
    known = max((k for k in LINES if label.startswith(k)), key=len, default="")
    return LINES.get(known, {"color": "gray"})


def drawn(case: Mapping[str, Any]) -> dict[str, list[tuple[float, float]]]:
    """Work-precision lines of a comparison; those of SciPy as the best of them."""
    kinds = [curve["delivers"] for curve in case["curves"].values()]
    lines: dict[str, list[tuple[float, float]]] = {}
    for label, curve in case["curves"].items():
        if curve["delivers"] == kinds[0]:
            name = "SciPy, the best" if label.startswith("SciPy") else label
            lines[name] = lines.get(name, []) + front(curve["points"])
    least, per = SEEN * min(case["targets"]), case.get("per", [1])[0]
    found = {}
    for label, points in lines.items():
        kept: list[tuple[float, float]] = []
        for error, seconds in sorted((max(e, least), s / per) for e, s in points):
            if not kept or seconds < kept[-1][1]:
                kept.append((error, seconds))
        found[label] = kept
    return found


def figure(cases: Mapping[str, Mapping[str, Any]], path: Path) -> list[Path]:
    """Work-precision of the comparisons of one model, a panel each, as PNG and PDF."""
    with theme.styled():
        made, panels = theme.panels(1, len(cases), (3.3 * max(len(cases), 1.4), 3.7))
        for number, (case, panel) in enumerate(zip(cases.values(), panels[0], strict=True)):
            for label, points in drawn(case).items():
                x, y = np.array(points).reshape(-1, 2).T
                panel.loglog(x, 1e3 * y, label=label, marker=".", markersize=4, **style_of(label))
            panel.invert_xaxis()
            theme.tick_decades(panel.yaxis, *panel.get_ylim())
            panel.set_xlabel(f"error ({case['unit']})")
            panel.set_title(theme.letter(number, case["panel"]) if len(cases) > 1 else "")
        panels[0, 0].set_ylabel("CPU time (ms)")
        theme.legend_below(made, made.axes)
        return [
            theme.save_figure(made, path.with_name(f"{path.name}.{kind}"))
            for kind in ("png", "pdf")
        ]
