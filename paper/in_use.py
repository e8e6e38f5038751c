"""Measures models in use: calls with new signals, steps, control periods that start anew.

Usage: python paper/in_use.py [--results DIR]

Writes DIR/in_use.nc, named values with units, which `paper/measured_numbers.py` reads, in about a
minute.  Times are CPU times of one thread, medians over signals, reduced and full order in turn.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

import vehiclemor as vm
from vehiclemor.files import make_folder
from vehiclemor.netcdf_file import write_dataset
from vehiclemor.provenance import attributes
from vehiclemor.simulation.run_timer import one_thread, timed

# `name, unit` -> value.
Values = dict[str, float]
# Model -> largest steering (rad, of the rack in m), far inside of the training.
VEHICLES = {"independent_suspension_vehicle": 0.02, "high_fidelity_vehicle": 0.003}
# Full order of like accuracy.
FULL = {"solver": "etdrk4", "tolerance": 5e-3}
TIMES = np.linspace(0.0, 10.0, 501)
# Steering that begins gently after 1 s, and that begins with the run.
ONSETS = {"after_1_s": np.tanh(np.maximum(TIMES - 1.0, 0.0)) ** 2, "at_once": np.ones_like(TIMES)}
SIGNALS, WARM_UP, STEPS = 140, 40, 1000
ASIDE = "lateral_position"


def signal(model: str, onset: str, number: int) -> vm.Signal:
    """A sampled sine of 0.3 to 0.44 Hz that no earlier call has seen."""
    sine = np.sin(2.0 * np.pi * (0.3 + 0.001 * number) * TIMES)
    samples = VEHICLES[model] * ONSETS[onset] * sine
    steered = vm.model(model).inputs[0]
    return vm.Signal.from_samples(TIMES, samples[:, None], hold="cubic", inputs=[steered])


def contestants(model: str) -> dict[str, Any]:
    """The reduced vehicle that ships, and full order of like accuracy."""
    reduced = vm.rom(model)
    return {"reduced": reduced, "full": vm.reduce(reduced.model, "full_order", **FULL)}


def calls(model: str) -> Iterator[tuple[str, float]]:
    """Calls with new signals and again with the same, one output read; how often it warns."""
    models = contestants(model)
    for onset in ONSETS:
        seconds: dict[str, list[tuple[float, float]]] = {who: [] for who in models}
        warned = 0
        for number in range(SIGNALS):
            for who, contestant in models.items():
                driven = signal(model, onset, number)
                call = partial(contestant.simulate, driven, outputs=[ASIDE])
                (run, new), (_, repeated) = timed(call), timed(call)
                if number >= WARM_UP:
                    seconds[who].append((new, repeated))
                    warned += who == "reduced" and (run.status != "ok" or bool(run.remark))
        for who in models:
            new, repeated = 1e6 * np.median(seconds[who], axis=0)
            yield f"{model} {onset} {who} new, us", new
            yield f"{model} {onset} {who} repeated, us", repeated
        yield f"{model} {onset} warned, 1", warned


def steps(model: str) -> Iterator[tuple[str, float]]:
    """Steps of 10 ms with outputs, as a controller in Python takes them."""
    reduced = vm.rom(model)
    strongest = vm.reduce(reduced.model, "full_order", preset="strongest")
    for who, contestant in (("reduced", reduced), ("full", strongest)):
        seconds: list[float] = []
        for _ in range(5):
            state, inputs = contestant.state(), np.zeros(len(contestant.inputs))
            began = time.thread_time()
            for step in range(STEPS):
                inputs[0] = VEHICLES[model] * np.sin(0.02 * step)
                state = contestant.step(state, inputs, 0.01)
                contestant.outputs(state, inputs)
            seconds.append((time.thread_time() - began) / STEPS)
        yield f"{model} {who} step, us", 1e6 * min(seconds)


def restarts() -> Iterator[tuple[str, float]]:
    """`pod` of the nominal run whose control periods begin at a measured state."""
    for restart in ("projected", "full_model"):
        settings: dict[str, Any] = {"restart": restart, "amplitude": 1.2, "training": "nominal"}
        run = vm.simulate("independent_suspension_vehicle", "pod", **settings)
        yield f"restart {restart} 1.2, m", run["rms_error"].sel(output=ASIDE).item()


def store(values: Values, title: str, path: Path, runs: pd.DataFrame | None = None) -> None:
    """Write values named `name, unit`, and what there is to know of single runs."""
    names, units = zip(*(name.rsplit(", ", 1) for name in values), strict=True)
    coordinates = {"name": list(names), "output_unit": ("name", list(units))}
    data = xr.Dataset({"value": ("name", [*map(float, values.values())])}, coordinates)
    if runs is not None:
        data = data.merge(runs.rename_axis("run").to_xarray())
    make_folder(path.parent)
    write_dataset(data.assign_attrs(attributes(title, "")), path)


def measured() -> Values:
    """Values of every part."""
    values: Values = dict(restarts())
    with one_thread():
        for model in VEHICLES:
            values |= dict(calls(model)) | dict(steps(model))
    return values


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--results", type=Path, default=Path("results"), help="results folder")
    results = parser.parse_args().results
    store(measured(), "Models in use", results / "in_use.nc")


if __name__ == "__main__":
    main()
