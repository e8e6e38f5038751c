"""A reduction method: the slow modes of a model that is linearised at its first start."""

from dataclasses import dataclass
from time import process_time
from typing import Any

import numpy as np
from pydantic import Field
from scipy.linalg import expm, schur

from vehiclemor.plugin import Method, OfflineCost, Settings, clock, offline_cost


class ModalSettings(Settings):
    """What a user can set, with type, default, bounds and meaning."""

    fastest: float = Field(100.0, gt=0.0, description="modes up to this |lambda| in 1/s are kept")


@dataclass(frozen=True)
class Modal:
    """A reduced model: x = centre + right z with z' = a z + b u + c, z = left (x - centre)."""

    model: Any
    centre: np.ndarray
    left: np.ndarray
    right: np.ndarray
    equations: tuple[np.ndarray, np.ndarray, np.ndarray]
    offline: OfflineCost
    order: int

    def simulate(self, maneuver, start):
        """The run at the maneuver's output times, from a start's name or a full state."""
        (a, b, c), times, inputs = self.equations, maneuver.times, maneuver.at(maneuver.times)
        began, step, n = clock(), times[1], len(a)
        # Exact where inputs are linear between the output times.
        held = np.kron([[0.0, step, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]], np.eye(n))
        held[:n, :n] = step * a
        free, at_start, change = np.hsplit(expm(held)[:n], 3)
        forces = inputs @ b.T + c
        forces = forces[:-1] @ at_start.T + np.diff(forces, axis=0) @ change.T
        z = [self.left @ (self.model.start(start) - self.centre)]
        for force in forces:
            z.append(free @ z[-1] + force)
        states, seconds = self.centre + np.array(z) @ self.right.T, clock() - began
        # Outputs follow from the states; what the full model counts hasn't been called.
        return self.model.trajectory(times, inputs, states, [0] * len(self.model.counts), seconds)

    def best_approximation(self, states):
        """Full states (samples, n) projected on the subspace; None where there is no subspace."""
        return self.centre + (states - self.centre) @ self.left.T @ self.right.T


def fit(model, training, settings):
    """Reduce a model; `training` holds runs (times, inputs, states, outputs) to learn from."""
    # CPU time of all threads; of runs, which studies take in one thread, `clock`.
    began, x, none = process_time(), model.start(), np.zeros(len(model.inputs))
    a, b = model.jacobian(x, none), model.jacobian(x, none, "inputs")
    rate = model.rhs(x, none)
    spaces = (schur(m, sort=lambda re, im: np.hypot(re, im) <= settings.fastest) for m in (a, a.T))
    right, left = (vectors[:, :number] for _, vectors, number in spaces)
    left = np.linalg.solve(left.T @ right, left.T)
    # A column of a Jacobian costs about one evaluation.
    cost = offline_cost(began, model, further=1 + len(x) + len(none))
    return Modal(model, x, left, right, (left @ a @ right, left @ b, left @ rate), cost, len(left))


METHOD = Method(
    name="quarter_car_modes",
    summary="modes of the linearised model",
    # Kinds of models that it reduces.
    settings={"ode": ModalSettings},
    fit=fit,
    # What `fit` reads of the training: "runs", their "inputs", or "nothing".
    learns_from="nothing",
)
