"""Tables of what was measured: whoever is faster stands first."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np

OURS = "ours"
HEADER = ("who", "CPU time", "spread", "over ours", "at tolerance", "error", "rhs calls")
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


def seconds_at(case: Mapping[str, Any], delivers: str, target: float) -> dict[str, float]:
    """Seconds of one run, step or run of a batch at a target error, of all who reach it."""
    count = case.get("per", ONCE)[0]
    curves = {k: c["points"] for k, c in case["curves"].items() if c["delivers"] == delivers}
    chosen = {label: choose(points, target) for label, points in curves.items()}
    return {label: point["seconds"] / count for label, point in chosen.items() if point}


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
