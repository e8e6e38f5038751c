"""Studies of a model by its declaration: nominal, perturbed and unseen inputs, every method.

What the package has is taken; else a study file is written beside the results, so that it runs,
resumes and can be read and changed like any other.
"""

from pathlib import Path
from typing import Any

import numpy as np

from vehiclemor.errors import InputError
from vehiclemor.registry import component, names
from vehiclemor.report.labels import default_rank, tabled_outputs
from vehiclemor.report.published import rms_numbers
from vehiclemor.simulation.build import build
from vehiclemor.simulation.model import Model
from vehiclemor.study.experiment import complete_settings, default_settings
from vehiclemor.study.plans.loading import load_studies, write_study
from vehiclemor.study.plans.protocol import PREFIX, protocol_names
from vehiclemor.study.plans.study_file import StudyFile

# Share of a signal's range within which two curves lie on top of each other: the bound of an output
# for which there is no published error.
INDISTINGUISHABLE = 0.01
FACTORS = (0.8, 0.9, 1.0, 1.1, 1.2)
TOLERANCES = (1e-3, 1e-4, 1e-6, 1e-8)
# Full order under both of its presets, the paper's methods, and what is measured against them.
FIRST = {
    "full_order": ("full_order", "recommended"),
    "full_order_strongest": ("full_order", "strongest"),
    "replay": ("replay", "recommended"),
    "pod": ("pod", "recommended"),
    "pod_literal": ("pod", "literal"),
    "fixed_basis": ("fixed_basis", "recommended"),
}
# Of a protocol; every other method is a contender.
ROLES = {"full_order": "full order", "replay": "baseline"}
# Points [frequency factor, amplitude factor] of the sets of a protocol.
POINTS = {
    "training": [[1.0, 1.0], [0.7, 0.6]],
    "validation": [[1.2, 0.8], [0.8, -0.9]],
    "test": [[0.9, 1.0], [1.3, 1.0], [1.0, 0.5], [1.0, -1.0], [1.0, 0.0]],
    "outside": [[1.0, 1.2], [1.6, 1.0]],
}


def of_paper(name: str) -> str:
    """Study of the paper's nominal run of a model, the first of its collection; else empty."""
    studies = load_studies("paper").items()
    return next((study for study, definition in studies if definition.model == name), "")


def nominal(name: str, results: Path) -> str:
    """Study of the nominal run, that the methods are trained on."""
    return _study(name, "nominal", results, {"start": list(build(name).starts)})


def perturbed(name: str, results: Path) -> str:
    """Study over perturbations of both factors, trained on the nominal input."""
    factors = list(FACTORS)
    grid = {"frequency_factor": factors, "amplitude_factor": factors}
    return _study(
        name, "perturbed", results, {"training": "nominal", "keep": "metrics", "grid": grid}
    )


def unseen(name: str, results: Path) -> str:
    """Study of inputs that no method has seen: the package's protocol, or one by default."""
    if name in protocol_names():
        return protocol_names()[name]
    path = results / "studies" / f"{PREFIX}{name}.toml"
    return str(write_study(_protocol(build(name)), path))


def methods(model: Model) -> dict[str, tuple[str, str]]:
    """Label -> (method, preset) of every registered method that accepts the model."""
    found: dict[str, tuple[str, str]] = {}
    for name in names("method"):
        try:
            method = component("method", name)
        except InputError:
            # A broken plug-in is named by `vehiclemor list`, and harmless elsewhere.
            continue
        if method.accepts(model)[0]:
            found[name] = (name, "recommended")
    presets = {label: e for label, e in FIRST.items() if e[0] in found and _has(model, *e)}
    return presets | found


def _has(model: Model, method: str, preset: str) -> bool:
    try:
        complete_settings(model, method, preset=preset)
    except InputError:
        return False
    return True


def bounds(model: Model) -> dict[str, float]:
    """Largest RMS errors that count as good: published, or a share of the range."""
    published = rms_numbers(model.name)
    if published:
        return {output: number.value for output, number in published.items()}
    definition = component("model", model.name)
    outputs = model.simulate(component("maneuver", definition.maneuver)).outputs
    ranges = dict(zip(model.outputs, np.ptp(outputs, axis=0), strict=True))
    shown = [output for output in tabled_outputs(definition) if ranges[output] > 0.0]
    return {output: INDISTINGUISHABLE * float(ranges[output]) for output in shown}


def _study(name: str, kind: str, results: Path, further: dict[str, Any]) -> str:
    """Path of a study file of every method; methods with a rank get the model's default one."""
    model = build(name)
    entries = [
        {"method": m, "label": label, "preset": preset, "settings": smaller_rank(model, m)}
        for label, (m, preset) in methods(model).items()
    ]
    title = f"{name}: {kind} input, every method"
    content = {"title": title, "model": name, "methods": entries, **further}
    path = results / "studies" / f"{name}-{kind}.toml"
    return str(write_study(StudyFile.model_validate(content), path))


def smaller_rank(model: Model, method: str) -> dict[str, int]:
    """The rank of a default row, for a method whose own default the model is too small for."""
    rank = default_rank(len(model.coordinates))
    own = default_settings(model, method).get("rank")
    return {"rank": rank} if isinstance(own, int) and own > rank else {}


def _protocol(model: Model) -> StudyFile:
    """Protocol of a model: full order at several tolerances, then every method."""
    entries = [
        {
            "method": method,
            "label": label.replace("full_order_", "").replace("_", " "),
            "preset": preset,
            "settings": smaller_rank(model, method),
            "role": ROLES.get(method, "contender"),
        }
        for label, (method, preset) in methods(model).items()
        if label != "pod_literal"
    ]
    for entry in entries:
        if entry["label"] == "full order":
            entry["candidates"] = [{"tolerance": value} for value in TOLERANCES]
    inputs = {"maneuver": component("model", model.name).maneuver, "start": list(model.starts)}
    sets = {purpose: [inputs | {"points": points}] for purpose, points in POINTS.items()}
    content = {
        "title": f"{model.name}: inputs that a reduced model has not seen",
        "model": model.name,
        "bounds": {o: {"measure": "rms", "bound": bound} for o, bound in bounds(model).items()},
        "methods": entries,
    }
    return StudyFile.model_validate(content | sets)
