"""A maneuver: its inputs, how long it takes, and what of it can be changed."""

from vehiclemor.maneuver import FACTORS, Maneuver
from vehiclemor.registry import component, names
from vehiclemor.report.description.schema import bounds


def maneuver_description(name: str) -> dict[str, object]:
    """Summary, duration, ranges of the inputs, factors, and the models that it drives."""
    maneuver: Maneuver = component("maneuver", name)
    models = {model: component("model", model).inputs for model in names("model")}
    driven = {m: i for m, i in models.items() if tuple(q.name for q in i) == maneuver.inputs}
    units = [q.unit for q in next(iter(driven.values()), ())] or [""] * len(maneuver.inputs)
    signals = maneuver.at(maneuver.times).T
    return {
        "maneuver": name,
        "summary": maneuver.summary,
        "duration": f"{maneuver.duration:g} s, {maneuver.samples} output times",
        "break points": [f"{time:g} s" for time in maneuver.break_points],
        "models": list(driven),
        "inputs": [
            {"name": i, "unit": unit, "smallest": float(s.min()), "largest": float(s.max())}
            for i, unit, s in zip(maneuver.inputs, units, signals, strict=True)
        ],
        "parameters": [
            {"name": f"{name} factor", "default": 1.0, "bounds": bounds(None, *limits)}
            for name, limits in FACTORS.items()
        ],
    }
