"""
My own reduction method
=======================

A method fits something to training runs and then simulates any input. This one fits polynomials of
the inputs to the joint coordinates of a suspension. Fifty lines take part in every study.
"""

# %%
# ``Settings`` declares what a user can set. ``fit`` gets the model, training runs and settings, and
# returns an object with ``simulate``, ``best_approximation``, ``offline`` and ``order``.
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from numpy.polynomial.polynomial import polyvander2d
from pydantic import Field

import vehiclemor as vm
from vehiclemor.plugin import Method, OfflineCost, Settings, clock, offline_cost


class PolynomialSettings(Settings):
    degree: int = Field(4, ge=1, le=8, description="degree in each input")


@dataclass(frozen=True)
class Polynomials:
    model: Any
    degree: int
    largest: np.ndarray
    coefficients: np.ndarray
    offline: OfflineCost
    order: int = 2

    def simulate(self, maneuver, start):
        times, began = maneuver.times, clock()
        inputs = maneuver.at(times)
        terms = polyvander2d(*(inputs / self.largest).T, [self.degree] * 2)
        nothing = [0] * len(self.model.counts)
        seconds = clock() - began
        return self.model.trajectory(times, inputs, terms @ self.coefficients, nothing, seconds)

    def best_approximation(self, states):
        return None


def fit(model, training, settings):
    began = time.process_time()
    inputs = np.concatenate([run.inputs for run in training])
    coordinates = np.concatenate([run.coordinates for run in training])
    largest = np.maximum(np.abs(inputs).max(axis=0), 1e-9)
    terms = polyvander2d(*(inputs / largest).T, [settings.degree] * 2)
    coefficients = np.linalg.lstsq(terms, coordinates, rcond=1e-9)[0]
    cost = offline_cost(began, model, training)
    return Polynomials(model, settings.degree, largest, coefficients, cost)


METHOD = Method(
    name="polynomials",
    summary="joint coordinates as polynomials of the inputs",
    settings={"ae": PolynomialSettings},
    fit=fit,
)

# %%
# An entry point gives the method its name. A package declares it in ``pyproject.toml``.
folder = Path(tempfile.mkdtemp())
info = folder / "polynomials-1.0.dist-info"
info.mkdir()
(info / "entry_points.txt").write_text("[vehiclemor.methods]\npolynomials = __main__:METHOD\n")
(info / "METADATA").write_text("Name: polynomials\nVersion: 1.0\n")
sys.path.append(str(folder))

# Train on the sweep of wheel travel and rack, test on another input.
suspension, unseen = vm.model("double_wishbone"), vm.maneuver("travel_and_rack_multisine")
full, degrees = suspension.simulate(unseen), range(1, 9)
worst = []
for degree in degrees:
    reduced = vm.reduce(suspension, "polynomials", training="travel_and_rack_sweep", degree=degree)
    worst.append(vm.errors(reduced.simulate(unseen), full).max_error.sel(output="toe").item())

figure, axis = plt.subplots(figsize=(6.7, 3.2))
axis.semilogy(degrees, worst, "o-")
axis.set(xlabel="degree", ylabel="largest error of toe (rad)", title="unseen wheel travel and rack")
plt.show()
