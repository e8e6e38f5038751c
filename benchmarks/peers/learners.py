"""What a run of a learned model costs by the library that has fitted it, beside our loop.

Usage: python benchmarks/peers/learners.py [MODEL]

Ten validation runs of a vehicle's protocol; CPU time of the thread.  The difference is that of the
components, of magnitude 1, at the end of the runs: what is timed is the same model.  Integrators of
the libraries know nothing of break points of the inputs.
"""

import sys
from collections.abc import Callable
from importlib import import_module
from itertools import pairwise
from time import thread_time
from typing import Any

import numpy as np

from vehiclemor.reduction.learned.learned_model import LearnedModel, Learning, columns, monomials
from vehiclemor.study.plans.protocol import load_protocol
from vehiclemor.study.scenario import start_of, training_run

RUNS, METHODS = 10, "vehiclemor.reduction.methods."
# Method -> settings: small ones that are stable in training.
SETTINGS: dict[str, dict[str, Any]] = {
    "operator_inference": {"form": "bilinear"},
    "sparse_identification": {"rank": 4, "degree": 2},
    "dynamic_mode_decomposition": {"rank": 4, "steps": 4},
    "gaussian_process": {"rank": 4, "samples": 1000, "length": 10.0, "noise": 1e-3},
    "neural_network": {"rank": 4},
}
Inputs = Callable[[float], np.ndarray]


def integrated(name: str, library: Any, z: np.ndarray, times: np.ndarray, u: Inputs) -> np.ndarray:
    """Components (samples, r) by the integrator that the library calls by default."""
    if name == "operator_inference":
        return library.predict(z, times, input_func=u).T
    return library.simulate(z, times, u=u)


def stepped(learning: Learning, fitted: Any, z: np.ndarray, times: np.ndarray, u: Inputs) -> Any:
    """Components by the library's `predict`, called for each step."""
    # Of dynamic mode decomposition the units of its arguments stand beside the library.
    library, scale, *_ = fitted if isinstance(fitted, tuple) else (fitted, learning.residual_scale)
    (equations, _), r, path = learning.linear, len(z), [z]
    names = monomials(len(equations.lengths), 1, constant=False)
    for now, after in pairwise(times):
        v = np.concatenate([path[-1], u(now), u(after)])[None]
        if hasattr(library, "coef_"):
            change = library.predict(v / scale)
        else:
            change = columns(names, v) @ equations.coefficients + library.predict(v) * scale
        path.append(path[-1] + change[0, :r])
    return np.array(path)


def timed(model: Any, runs: Any, tests: Any, name: str) -> tuple[float, float, float]:
    """Seconds a run by the library and by our loop, and how far they end apart."""
    module = import_module(METHODS + name)
    settings = module.METHOD.settings[model.kind](skipped=1.5, **SETTINGS[name])
    mapped = name not in ("operator_inference", "sparse_identification")
    learning = Learning.of(model, runs, settings, mapped, "numpy")
    fitted, ours = module.trained(learning, settings), module.fit(model, runs, settings)
    own, theirs, apart = [], [], []
    for scenario in tests:
        maneuver, state = scenario.maneuver, model.start(start_of(model, scenario))
        path, _ = ours._path(maneuver, state)
        began = thread_time()
        path, _ = ours._path(maneuver, state)
        own.append(thread_time() - began)
        times = ours.time_step * np.arange(len(path))
        r, inputs = len(learning.components.forward), scaled(ours, maneuver)
        began = thread_time()
        if mapped:
            found = stepped(learning, fitted, path[0, :r], times, inputs)
        else:
            found = integrated(name, fitted, path[0, :r], times, inputs)
        theirs.append(thread_time() - began)
        length = min(len(found), len(path))
        apart.append(np.abs(found[length - 1] - path[length - 1, :r]).max())
    return float(np.mean(theirs)), float(np.mean(own)), max(apart)


def scaled(model: LearnedModel, maneuver: Any) -> Inputs:
    """Standardised inputs at a time in s."""
    return lambda t: maneuver.at(np.atleast_1d(t))[0] / model.input_scale


def main() -> None:
    """Print a row for each library."""
    name = sys.argv[1] if len(sys.argv) > 1 else "independent_suspension_vehicle"
    protocol = load_protocol(f"predictive-{name}")
    runs = [training_run(protocol.model, scenario) for scenario in protocol.sets["training"]]
    tests = [s for s in protocol.sets["validation"] if s.start == "equilibrium"][:RUNS]
    print("| method | library (ms) | our loop (ms) | times | difference |\n|---|---|---|---|---|")
    for method in SETTINGS:
        theirs, ours, apart = timed(protocol.model, runs, tests, method)
        ratio = theirs / ours
        print(f"| {method} | {1e3 * theirs:.1f} | {1e3 * ours:.2f} | {ratio:.0f} | {apart:.1e} |")


if __name__ == "__main__":
    main()
