"""What sensitivities cost and how exact they are.

Usage: python paper/sensitivities.py

Loop times are CPU seconds of the thread, the least of interleaved rounds.  Errors are the largest
difference from central differences of order 6 of whole runs at a tolerance of 1e-12, relative to
the largest derivative of that output.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

import vehiclemor as vm
from vehiclemor.maneuver import Maneuver
from vehiclemor.registry import component
from vehiclemor.simulation.build import reparametrised
from vehiclemor.simulation.model import Model

ROUNDS, COUNTS = 9, (1, 2, 4, 8)
OUTPUTS = ("lateral_position", "yaw", "roll", "yaw_rate")
PARAMETERS = {
    "independent_suspension_vehicle": (
        *("front_stiffness", "rear_stiffness", "front_damping", "rear_damping"),
        *("sprung_mass", "sprung_height", "roll_inertia", "front_track"),
    ),
    "high_fidelity_vehicle": (
        *("front_stiffness", "rear_stiffness", "front_damping", "rear_damping"),
        *("chassis_mass", "cornering_stiffness", "tire_stiffness", "initial_speed"),
    ),
}


def differences(model: Model, name: str, maneuver: Maneuver, step: float) -> np.ndarray:
    """Derivatives (samples, outputs) of a run by a parameter: `step` is a part of it."""
    value = float(model.parameters[name])

    def outputs(part: float) -> np.ndarray:
        changed = reparametrised(model, {name: value * (1.0 + part)})
        return changed.simulate(maneuver, tolerance=1e-12).outputs

    first = [(outputs(h) - outputs(-h)) / (2.0 * h) for h in (step, step / 2.0, step / 4.0)]
    second = [(4.0 * b - a) / 3.0 for a, b in pairwise(first)]
    return (16.0 * second[1] - second[0]) / 15.0 / value


def errors(model: Model, maneuver: Maneuver, names: Sequence[str]) -> None:
    """Print the largest relative error of the derivatives of some outputs, by tolerance."""
    places = [model.outputs.index(output) for output in OUTPUTS]
    expected = [differences(model, name, maneuver, 2e-2)[:, places] for name in names]
    for tolerance in (1e-6, 1e-8, 1e-10):
        run = vm.sensitivities(model, maneuver, parameters=names, tolerance=tolerance)
        found = run["d_output"].values[:, :, places]
        worst = max(
            (np.abs(found[:, k] - own).max(axis=0) / np.abs(own).max(axis=0)).max()
            for k, own in enumerate(expected)
        )
        print(
            f"  tolerance {tolerance:.0e}: {1e3 * float(run['seconds']):.1f} ms, off by {worst:.1e}"
        )


def main() -> None:
    """Print times and errors of the vehicles."""
    for name, parameters in PARAMETERS.items():
        model = vm.model(name)
        maneuver = component("maneuver", model.definition.maneuver)
        calls = {
            "plain run, dopri5": lambda m=model, w=maneuver: m.simulate(w, tolerance=1e-10).seconds,
            "plain run, exponential_adams": lambda m=model, w=maneuver: (
                m.simulate(w, solver="exponential_adams", tolerance=1e-10).seconds
            ),
        } | {
            f"with {k} derivatives": lambda m=model, w=maneuver, p=parameters[:k]: float(
                vm.sensitivities(m, w, parameters=p)["seconds"]
            )
            for k in COUNTS
        }
        rounds = [[call() for call in calls.values()] for _ in range(ROUNDS)]
        print(f"{name}, {maneuver.name}, tolerance 1e-10")
        for label, seconds in zip(calls, np.min(rounds, axis=0), strict=True):
            print(f"  {label}: {1e3 * seconds:.2f} ms")
        errors(model, maneuver, parameters[:2])


if __name__ == "__main__":
    main()
