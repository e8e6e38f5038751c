"""Studies of a model by its declaration: nominal, perturbed and unseen inputs, every method.

What the package has is taken; else a study file is written beside the results, so that it runs,
resumes and can be read and changed like any other.
"""

from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from vehiclemor.exceptions import InputError
from vehiclemor.registry import component, names
from vehiclemor.report.labels import REDUCED, default_rank, tabled_outputs
from vehiclemor.report.published import INDISTINGUISHABLE, rms_numbers
from vehiclemor.simulation.build import build
from vehiclemor.simulation.model import Model
from vehiclemor.study.experiment import default_settings
from vehiclemor.study.plans.loading import write_study
from vehiclemor.study.plans.protocol import PREFIX, protocol_names
from vehiclemor.study.plans.study_file import schema_of

FACTORS = (0.8, 0.9, 1.0, 1.1, 1.2)
TOLERANCES = (1e-3, 1e-4, 1e-6, 1e-8)
# Method and preset: full order under both of its presets, the paper's methods, and what is measured
# against them.
FULL_ORDER = ("full_order", "recommended"), ("full_order", "strongest")
FIRST = (*FULL_ORDER, ("replay", "recommended"), *REDUCED)
# Of a protocol; every other method is a contender.
ROLES = {"full_order": "full order", "replay": "baseline"}
# Points [frequency factor, amplitude factor] of the sets of a protocol.
POINTS = {
    "training": [[1.0, 1.0], [0.7, 0.6]],
    "validation": [[1.2, 0.8], [0.8, -0.9]],
    "test": [[0.9, 1.0], [1.3, 1.0], [1.0, 0.5], [1.0, -1.0], [1.0, 0.0]],
    "outside": [[1.0, 1.2], [1.6, 1.0]],
}


def nominal(name: str, results: Path) -> str:
    """Study of the nominal run, that the methods are trained on."""
    return _study(name, "nominal", results, {"start": list(build(name).starts)})


def perturbed(name: str, results: Path) -> str:
    """Study over perturbations of both factors, trained on the nominal input."""
    factors = list(FACTORS)
    grid = {"frequency_factor": factors, "amplitude_factor": factors}
    further = {"training": "nominal", "keep": "metrics", "grid": grid}
    return _study(name, "perturbed", results, further)


def unseen(name: str, results: Path) -> str:
    """Study of inputs that no method has seen: the package's protocol, or one by default."""
    if name in protocol_names():
        return protocol_names()[name]
    model = build(name)
    entries = [entry for entry in _entries(model) if entry["preset"] != "literal"]
    for entry in entries:
        entry["role"] = ROLES.get(entry["method"], "contender")
        entry["label"] = entry["label"].removeprefix("full_order_").replace("_", " ")
        if entry["label"] == "full order":
            entry["candidates"] = [{"tolerance": value} for value in TOLERANCES]
    inputs = {"maneuver": model.definition.maneuver, "start": list(model.starts)}
    content = {
        "title": f"{name}: inputs that a reduced model has not seen",
        "model": name,
        "bounds": {o: {"measure": "rms", "bound": bound} for o, bound in bounds(model).items()},
        "methods": entries,
        **{purpose: [inputs | {"points": points}] for purpose, points in POINTS.items()},
    }
    return _written(results, f"{PREFIX}{name}", content)


def _entries(model: Model) -> list[dict[str, Any]]:
    """Every registered method that accepts the model, at a rank that the model is large enough for.

    A broken plug-in is named by `vehiclemor list`, and harmless here.
    """
    known: dict[str, Any] = {}
    for name in names("method"):
        with suppress(InputError):
            known[name] = component("method", name)
    every = dict.fromkeys([*FIRST, *((name, "recommended") for name in known)])
    return [
        {"method": name, "preset": preset, "settings": smaller_rank(model, name)}
        | {"label": name if preset == "recommended" else f"{name}_{preset}"}
        for name, preset in every
        if name in known
        and known[name].accepts(model)[0]
        and preset in known[name].presets_of(model.kind)
    ]


def bounds(model: Model) -> dict[str, float]:
    """Largest RMS errors that count as good: published, or a share of the range."""
    if published := rms_numbers(model.name):
        return {output: number.value for output, number in published.items()}
    outputs = model.simulate(component("maneuver", model.definition.maneuver)).outputs
    ranges = dict(zip(model.outputs, np.ptp(outputs, axis=0), strict=True))
    shown = [output for output in tabled_outputs(model.definition) if ranges[output] > 0.0]
    return {output: INDISTINGUISHABLE * float(ranges[output]) for output in shown}


def _study(name: str, kind: str, results: Path, further: dict[str, Any]) -> str:
    """Path of a study file of every method."""
    head = {"title": f"{name}: {kind} input, every method", "model": name}
    return _written(results, f"{name}-{kind}", head | {"methods": _entries(build(name))} | further)


def _written(results: Path, study: str, content: dict[str, Any]) -> str:
    path = results / "studies" / f"{study}.toml"
    return str(write_study(schema_of(content).model_validate(content), path))


def smaller_rank(model: Model, method: str) -> dict[str, int]:
    """The rank of a default row, for a method whose own default the model is too small for."""
    rank = default_rank(len(model.coordinates))
    own = default_settings(model, method).get("rank")
    return {"rank": rank} if isinstance(own, int) and own > rank else {}
