"""A study: what it runs, and how many cells its grid has."""

from vehiclemor.registry import component
from vehiclemor.study.plans.loading import load_studies, study_path
from vehiclemor.study.plans.study_file import SETS, Sampling, StudyFile, values
from vehiclemor.toml_files import read_toml

# Values of an axis that are printed.
SHOWN = 40


def study_description(name: str) -> dict[str, object]:
    """Grid and methods of a study, its members if it is a collection, or its protocols."""
    path = study_path(name)
    study = read_toml(path, StudyFile)
    head: dict[str, object] = {"study": path.stem, "summary": study.title, "file": str(path)}
    if study.studies:
        rows = [
            {"study": member, "grid points": content.points, "summary": content.title}
            for member, content in load_studies(name).items()
        ]
        return {**head, "grid points": sum(row["grid points"] for row in rows), "studies": rows}
    if study.bounds:
        return head | _test(study)
    grid = {key: values(entry) for key, entry in study.grid.items()}
    return {
        **head,
        "model": study.model,
        "maneuver": study.maneuver or component("model", study.model).maneuver,
        "starts": study.start or ["the model's first"],
        "training": study.training_words,
        "parameters": ", ".join(f"{key}={value}" for key, value in study.parameters.items()),
        "grid points": study.points,
        "keeps": study.keep,
        "grid": [{"dimension": key, "values": _shown(entry)} for key, entry in grid.items()],
        "sampling": _sampling(study.sampling),
        "methods": [
            {
                "label": label,
                "method": entry.method,
                "preset": entry.preset,
                "settings": ", ".join(f"{k}={v}" for k, v in entry.settings.items()),
            }
            for label, entry in study.labelled.items()
        ],
    }


def _shown(axis: list[int | float | str]) -> str:
    """Values of an axis; of a long one both ends."""
    if len(axis) <= SHOWN:
        return ", ".join(map(str, axis))
    return f"{axis[0]}, {axis[1]}, ..., {axis[-1]} ({len(axis)} values)"


def _sampling(plan: Sampling | None) -> list[dict[str, object]]:
    """Ranges of a sampling plan, each with how it is sampled."""
    if plan is None:
        return []
    how = f"{plan.plan}, {plan.count} points, seed {plan.seed}"
    return [
        {"name": name, "from": low, "to": high, "plan": how}
        for name, (low, high) in plan.ranges.items()
    ]


def _test(study: StudyFile) -> dict[str, object]:
    """What a study with bounds trains, chooses by and tests; scenarios are counted."""
    counted = {s: sum(g.scenarios for g in getattr(study, s)) for s in SETS}
    draws = {"drawn": study.drawn, "drawn outside": study.drawn_outside}
    counted |= {name: draw.runs for name, draw in draws.items() if draw}
    return {
        "model": study.model,
        "runs": [f"{count} {purpose}" for purpose, count in counted.items() if count],
        "methods": list(study.labelled),
    }
