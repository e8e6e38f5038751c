"""Studies of a model by its declaration: nominal, perturbed and unseen inputs, every method.

What the package has is taken; else a study file is written beside the results, so that it runs,
resumes and can be read and changed like any other.
"""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from vehiclemor.errors import InputError
from vehiclemor.files import write_text
from vehiclemor.registry import component, names
from vehiclemor.report.published import rms_numbers
from vehiclemor.report.shown import default_rank, tabled_outputs
from vehiclemor.simulation.build import build
from vehiclemor.simulation.model import Model
from vehiclemor.study.method_settings import complete_settings, default_settings
from vehiclemor.study.plans.loading import load_studies
from vehiclemor.study.plans.protocol import PREFIX, protocol_names

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
    return _study(name, "nominal", results, 'training = "matched"', "")


def perturbed(name: str, results: Path) -> str:
    """Study over perturbations of both factors, trained on the nominal input."""
    head = 'training = "nominal"\nkeep = "metrics"'
    grid = f"frequency_factor = {list(FACTORS)}\namplitude_factor = {list(FACTORS)}\n"
    return _study(name, "perturbed", results, head, grid)


def unseen(name: str, results: Path) -> str:
    """Study of inputs that no method has seen: the package's protocol, or one by default."""
    if name in protocol_names():
        return protocol_names()[name]
    path = results / "studies" / f"{PREFIX}{name}.toml"
    return str(write_text(path, _protocol(build(name))))


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


def _study(name: str, kind: str, results: Path, head: str, grid: str) -> str:
    """Path of a study file of every method; methods with a rank get the model's default one."""
    model = build(name)
    lines = [f'title = "{name}: {kind} input, every method"', f'model = "{name}"', head]
    # The map of perturbations has one start.
    starts = model.starts if not grid else model.starts[:1]
    lines += [f"start = {json.dumps(list(starts))}", "", "[grid]", grid]
    for label, (method, preset) in methods(model).items():
        lines += ["[[methods]]", f'method = "{method}"', f'label = "{label}"']
        lines += [f'preset = "{preset}"', f"settings = {_inline(smaller_rank(model, method))}", ""]
    return str(write_text(results / "studies" / f"{name}-{kind}.toml", "\n".join(lines)))


def smaller_rank(model: Model, method: str) -> dict[str, int]:
    """The rank of a default row, for a method whose own default the model is too small for."""
    rank = default_rank(len(model.coordinates))
    own = default_settings(model, method).get("rank")
    return {"rank": rank} if isinstance(own, int) and own > rank else {}


def _inline(table: Mapping[str, object]) -> str:
    return "{ " + ", ".join(f"{key} = {json.dumps(value)}" for key, value in table.items()) + " }"


def _protocol(model: Model) -> str:
    """Protocol of a model: full order at several tolerances, then every method."""
    maneuver = component("model", model.name).maneuver
    lines = [f'title = "{model.name}: inputs that a reduced model has not seen"']
    lines += [f'model = "{model.name}"', "", "[bounds]"]
    lines += [f'{o} = {{ measure = "rms", bound = {b!r} }}' for o, b in bounds(model).items()]
    for purpose, points in POINTS.items():
        lines += ["", f"[[{purpose}]]", f'maneuver = "{maneuver}"', f"points = {points}"]
        lines += [f"start = {json.dumps(list(model.starts))}"]
    tolerances: list[dict[str, object]] = [{"tolerance": value} for value in TOLERANCES]
    for label, (method, preset) in methods(model).items():
        if label == "pod_literal":
            continue
        candidates = tolerances if label == "full_order" else [{}]
        role = {"full_order": "full order", "replay": "baseline"}.get(method, "contender")
        own = {"preset": preset, **smaller_rank(model, method)}
        chosen = [own | entry for entry in candidates]
        words = label.replace("full_order_", "").replace("_", " ")
        lines += ["", "[[methods]]", f'label = "{words}"', f'method = "{method}"']
        lines += [f'role = "{role}"', f"candidates = [{', '.join(map(_inline, chosen))}]"]
    return "\n".join(lines) + "\n"
