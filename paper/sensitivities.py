"""What sensitivities cost and how exact they are, and what Sobol indices of reduced models are.

Usage: python paper/sensitivities.py [--results DIR]

Writes DIR/sensitivities.nc, named values with units, which `paper/facts.py` writes into the texts,
and prints them.  Loop times are CPU seconds of the thread, the least of interleaved rounds.  Errors
are the largest difference from central differences of order 6 of whole runs at a tolerance of
1e-12, relative to the largest derivative of that output; those of an index are from full order.
It wants an idle machine, and five minutes, most of them for the indices.
"""

from __future__ import annotations

import argparse
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from named_values import Values, measured_values

import vehiclemor as vm
from vehiclemor.maneuver import Maneuver
from vehiclemor.registry import component
from vehiclemor.report.sobol import sobol_dataset
from vehiclemor.simulation.build import reparametrised
from vehiclemor.simulation.model import Model

if TYPE_CHECKING:
    import xarray as xr

FILE, TITLE = "sensitivities.nc", "Sensitivities"
ROUNDS, COUNTS, TOLERANCES = 9, (1, 2, 4, 8), (1e-8, 1e-10)
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


def costs(name: str) -> Values:
    """CPU times of plain runs and of runs with derivatives, in ms."""
    model, parameters = vm.model(name), PARAMETERS[name]
    maneuver = component("maneuver", model.definition.maneuver)
    calls = {
        solver: partial(model.simulate, maneuver, solver=solver, tolerance=1e-10)
        for solver in ("dopri5", "exponential_adams")
    } | {
        f"with {k}": partial(vm.sensitivities, model, maneuver, parameters=parameters[:k])
        for k in COUNTS
    }
    rounds = [[float(call().seconds) for call in calls.values()] for _ in range(ROUNDS)]
    least = 1e3 * np.min(rounds, axis=0)
    return {f"{name} {what}, ms": ms for what, ms in zip(calls, least, strict=True)}


def errors(name: str) -> Values:
    """Largest relative errors of the derivatives of some outputs, by tolerance."""
    model, parameters = vm.model(name), PARAMETERS[name][:2]
    maneuver = component("maneuver", model.definition.maneuver)
    places = [model.outputs.index(output) for output in OUTPUTS]
    expected = [differences(model, own, maneuver, 2e-2)[:, places] for own in parameters]
    values = {}
    for tolerance in TOLERANCES:
        run = vm.sensitivities(model, maneuver, parameters=parameters, tolerance=tolerance)
        found = run["d_output"].values[:, :, places]
        values[f"{name} off at {tolerance:.0e}, 1"] = max(
            (np.abs(found[:, k] - own).max(axis=0) / np.abs(own).max(axis=0)).max()
            for k, own in enumerate(expected)
        )
    return values


def indices(name: str, folder: Path) -> Values:
    """CPU times of Sobol indices, and by how much total ones of reduced models are off."""
    found, values = sobol_dataset(name, folder), {}
    off = abs(found["total_order"] - found["total_order"][0]).max("parameter")
    for label in found["model"].values:
        own = f"{name} {label}"
        values[f"{own} seconds, s"] = found["seconds"].sel(model=label).item()
        values[f"{own} untrusted, 1"] = found["untrusted"].sel(model=label).item()
        for objective in found["objective"].values:
            values[f"{own} {objective}, 1"] = off.sel(model=label, objective=objective).item()
    return values


def measured(folder: Path, anew: bool = False) -> xr.Dataset:
    """What the results folder holds; measured where it lacks it, or once more."""
    parts = [partial(part, name) for name in PARAMETERS for part in (costs, errors)]
    parts += [partial(indices, name, folder) for name in PARAMETERS]
    return measured_values(folder / FILE, TITLE, parts, anew)


def main() -> None:
    """Measure, write and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--results", type=Path, default=Path("results"), help="results folder")
    for value in measured(parser.parse_args().results, anew=True)["value"]:
        print(f"{value['name'].item():70} {value.item():10.4g} {value['output_unit'].item()}")


if __name__ == "__main__":
    main()
