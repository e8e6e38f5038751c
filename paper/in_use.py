"""Measures models in use: calls with new signals, steps, control periods that start anew.

Usage: python paper/in_use.py [--results DIR]

Writes DIR/in_use.nc, named values with units, which `paper/measured_numbers.py` reads, in about a
minute.  Times are CPU times of one thread, medians over signals, reduced and full order in turn;
full order is the fastest whose largest error is not above that of the reduced vehicle alone.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import xarray as xr
from reduced_models import in_bounds

import vehiclemor as vm
from vehiclemor.files import make_folder
from vehiclemor.netcdf_file import write_dataset
from vehiclemor.provenance import attributes
from vehiclemor.reduction.reduced_model import ReducedOrderModel
from vehiclemor.simulation.run_timer import one_thread, timed
from vehiclemor.study.plans.protocol import load_protocol, protocol_names

# `name, unit` -> value.
Values = dict[str, float]
# Model -> largest steering (rad, of the rack in m), far inside of the training.
VEHICLES = {"independent_suspension_vehicle": 0.02, "high_fidelity_vehicle": 0.003}
# Full order, of which the fastest of like accuracy is taken, and every how manyth signal tells.
SOLVER, TOLERANCES, TOLD = "etdrk4", (5e-2, 2e-2, 1e-2, 5e-3, 2e-3, 1e-3, 1e-4), 7
TIMES = np.linspace(0.0, 10.0, 501)
# Steering that begins gently after 1 s, and that begins with the run.
ONSETS = {"after_1_s": np.tanh(np.maximum(TIMES - 1.0, 0.0)) ** 2, "at_once": np.ones_like(TIMES)}
SIGNALS, WARM_UP, STEPS, MANY = 140, 40, 1000, 2000
ASIDE = "lateral_position"


def signal(model: str, onset: str, number: float) -> vm.Signal:
    """A sampled sine of 0.3 to 0.44 Hz that no earlier call has seen."""
    sine = np.sin(2.0 * np.pi * (0.3 + 0.001 * number) * TIMES)
    samples = VEHICLES[model] * ONSETS[onset] * sine
    steered = vm.model(model).inputs[0]
    return vm.Signal.from_samples(TIMES, samples[:, None], hold="cubic", inputs=[steered])


class Contestant(NamedTuple):
    """A model in a comparison, and whether its error is estimated."""

    who: str
    model: ReducedOrderModel
    trust: str = "estimate"

    def simulate(self, driven: vm.Signal, *start: Any, **outputs: Any) -> Any:
        """A run."""
        return self.model.simulate(driven, *start, trust=self.trust, **outputs)


def reduced_vehicles(model: str) -> list[Contestant]:
    """The reduced vehicle that ships, with and without an estimate of its error."""
    reduced = vm.rom(model)
    return [Contestant("reduced", reduced), Contestant("unjudged", reduced, "off")]


def largest_error(model: str, onset: str, contestant: Contestant) -> float:
    """Largest error over some of the signals, in bounds of the model's protocol."""
    protocol = load_protocol(protocol_names()[model])
    largest = 0.0
    for number in range(0, SIGNALS, TOLD):
        driven = signal(model, onset, number)
        run, exact = contestant.simulate(driven), protocol.model.simulate(driven)
        largest = max(largest, in_bounds(protocol, run, exact))
    return largest


def contestants(model: str, onset: str) -> Iterator[tuple[Contestant, float]]:
    """Reduced vehicles, and the fastest full order as accurate as they alone; largest errors."""
    error = np.inf
    for reduced in reduced_vehicles(model):
        error = largest_error(model, onset, reduced)
        yield reduced, error
    for tolerance in TOLERANCES:
        full = vm.reduce(vm.model(model), "full_order", solver=SOLVER, tolerance=tolerance)
        of_full = largest_error(model, onset, Contestant("full", full))
        if of_full <= error or tolerance == TOLERANCES[-1]:
            yield Contestant("full", full), of_full
            return


def calls(model: str) -> Iterator[tuple[str, float]]:
    """Calls with new signals and again with the same, one output read; how often it warns."""
    for onset in ONSETS:
        models: list[Contestant] = []
        for contestant, error in contestants(model, onset):
            models.append(contestant)
            yield f"{model} {onset} {contestant.who} error, 1", error
        yield f"{model} {onset} tolerance, 1", float(models[-1].model.settings["tolerance"])
        seconds: dict[str, list[tuple[float, float]]] = {each.who: [] for each in models}
        warned = 0
        for number in range(SIGNALS):
            for contestant in models:
                driven = signal(model, onset, number)
                call = partial(contestant.simulate, driven, outputs=[ASIDE])
                (run, new), (_, repeated) = timed(call), timed(call)
                if number >= WARM_UP:
                    seconds[contestant.who].append((new, repeated))
                    warned += contestant.who == "reduced" and bool(run.message or run.remark)
        for who, every in seconds.items():
            new, repeated = 1e6 * np.median(every, axis=0)
            yield f"{model} {onset} {who} new, us", new
            yield f"{model} {onset} {who} repeated, us", repeated
        yield f"{model} {onset} warned, 1", warned


def batches() -> Iterator[tuple[str, float]]:
    """CPU time of many runs with new signals that steer at once, in one batch, one output kept."""
    model, *_ = VEHICLES
    for part, contestant in enumerate(reduced_vehicles(model)):
        numbers = 0.5 * part + np.arange(MANY) / (0.01 * MANY)
        signals = [signal(model, "at_once", number) for number in numbers]
        began = time.process_time()
        vm.simulate_many(contestant.model, signals, outputs=[ASIDE], trust=contestant.trust)
        yield f"{model} {contestant.who} many, s", time.process_time() - began


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
    values: Values = {}
    with one_thread():
        values |= dict(batches())
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
