"""Short ways to fit methods for the tests."""

from typing import Any

import numpy as np

from vehiclemor.error_measures import rms
from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.inputs.steering import lane_change, rack_lane_change
from vehiclemor.reduction.interface import FittedModel
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.reduction.validation import validated
from vehiclemor.registry import component
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Trajectory
from vehiclemor.study.plans.training import training_set
from vehiclemor.study.scenario import Scenario, training_run

# Vehicle -> its lane change.
CARS = {"independent_suspension_vehicle": lane_change, "high_fidelity_vehicle": rack_lane_change}
FIGURES = ("spindle_y", "second_euler_angle")


def training_runs(
    model: Model, maneuver: Maneuver, training: str = "matched", factors: Any = ()
) -> list[TrainingRun]:
    """What is trained on before a maneuver from the first start is tested."""
    test = Scenario(maneuver, model.starts[0])
    found = training_set(model, "", training, test, factors)
    return [training_run(model, scenario) for scenario in found]


def fitted(
    model: AlgebraicModel,
    maneuver: Maneuver,
    method: str,
    policy: str = "matched",
    **settings: object,
) -> FittedModel:
    """Reduced model by a registered method, its recommended preset and these settings."""
    definition = component("method", method)
    complete = validated(definition, model.kind, settings)
    definition.check(model, complete)
    return definition.fit(model, training_runs(model, maneuver, policy), complete)


def figure_errors(model: AlgebraicModel, outputs: np.ndarray, reference: Trajectory) -> np.ndarray:
    """RMS errors (2,) of the paper's two figures: spindle y (m) and second Euler angle (rad)."""
    columns = [model.outputs.index(name) for name in FIGURES]
    return rms(outputs - reference.outputs)[columns]


def floor_errors(model: AlgebraicModel, reduced: FittedModel, reference: Trajectory) -> np.ndarray:
    """The same of the best approximation in the reduced model's subspaces."""
    best = reduced.best_approximation(reference.states)
    assert best is not None
    return figure_errors(model, model.outputs_at(best, reference.inputs), reference)


def two_way_travel() -> Maneuver:
    """Travel that sweeps in frequency while the rack moves to both sides."""

    def signal(times: np.ndarray, frequency: float, amplitude: float) -> np.ndarray:
        travel = 0.1 * np.sin(2.0 * np.pi * frequency * (0.1 + 0.015 * times) * times)
        rack = 0.04 * np.sin(2.0 * np.pi * frequency * 0.17 * times)
        return amplitude * np.column_stack([travel, rack])

    return Maneuver("two_way", "", signal, ("z", "s0"), 10.0, 401, lambda _: ())
