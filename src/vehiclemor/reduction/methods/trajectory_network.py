"""A network trained on whole trajectories, by jax-sysid: its errors add up as those of a run do.

    z_(k+1) = z_k + A v_k + C (tanh(W v_k + b) - tanh(b)),   v_k = (z_k, u_k, u_(k+1))

A. Bemporad, Linear and nonlinear system identification under l1- and group-Lasso regularization via
L-BFGS-B, arXiv 2403.03827 (2024).
"""

import contextlib
import io
import warnings
from typing import Any

import numpy as np
from pydantic import Field

from vehiclemor.reduction.interface import Method, installed
from vehiclemor.reduction.learned_model import (
    LearnedModel,
    LearnedSettings,
    TrainingData,
    stepped,
)
from vehiclemor.reduction.training import Training
from vehiclemor.reduction.vehicle.shape import no_steered_vehicle

# By which weights begin, and passes over all steps before runs are fitted.
SEED, STEPS = 0, 60
# Standardised coordinates are cut there while the network is trained.
CUT = 20.0


class TrajectoryNetworkSettings(LearnedSettings):
    """Settings for a vehicle."""

    width: int = Field(32, ge=1, le=512, description="neurons of the hidden layer, with tanh")
    epochs: int = Field(300, ge=0, le=10_000, description="steps of L-BFGS over all runs, at most")
    penalty: float = Field(1e-6, ge=0.0, description="weight of the squared weights in the fit")


def fit(model: Any, training: Training, settings: TrajectoryNetworkSettings) -> LearnedModel:
    """The network of jax-sysid, begun from one step that scikit-learn has fitted."""
    # The library prints, and builds on a package that warns.
    with contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return _fitted(model, training, settings)


def _fitted(model: Any, training: Training, settings: TrajectoryNetworkSettings) -> LearnedModel:
    with installed("jax-sysid", "trajectories"):
        import jax  # pyright: ignore[reportMissingImports]
        import jax.numpy as jnp  # pyright: ignore[reportMissingImports]
        from jax_sysid.models import Model  # pyright: ignore[reportMissingImports]
        from sklearn.neural_network import MLPRegressor

    data = TrainingData.of(model, training, settings)
    now, inputs, _ = data.steps
    r, m, lanes = now.shape[1], inputs.shape[1], in_lanes([*map(len, data.inputs)])

    def step(x: Any, u: Any, parameters: Any) -> Any:
        """Coordinates of one run or of all, one behind the other, after a step."""
        a, w, b, c = parameters
        z = x.reshape(-1, r)
        v = jnp.hstack([z, u.reshape(-1, m)])
        return (z + v @ a + (jnp.tanh(v @ w + b) - jnp.tanh(b)) @ c).reshape(-1)

    def step_of_lanes(x: Any, u: Any, parameters: Any) -> Any:
        """Coordinates after a step, those of the next run of a lane where it begins."""
        u, start = jnp.split(u.reshape(-1, m + r), [m], axis=1)
        after = step(x, u, parameters)
        return jnp.where(jnp.isnan(start.reshape(-1)), after, start.reshape(-1))

    # All lanes are one experiment: the library would compile a loop for each.
    longest = max(map(len, data.inputs))
    wanted, driven = (np.full((longest, len(lanes), size), np.nan) for size in (r, m + r))
    driven[..., :m] = 0.0
    for lane, of_lane in enumerate(lanes):
        for run, first in of_lane:
            rows = slice(first, first + len(data.inputs[run]))
            wanted[rows, lane] = data.paths[run][:-1]
            driven[rows, lane, :m] = data.inputs[run]
            driven[first - 1 : first, lane, m:] = data.paths[run][0]
    wanted, driven = wanted.reshape(longest, -1), driven.reshape(longest, -1)
    known = np.isfinite(wanted)
    wanted[~known] = 0.0
    # Whole runs are no start for small random weights: one step is fitted first.
    shape: Any = {"hidden_layer_sizes": (settings.width,), "activation": "tanh"}
    begun: Any = MLPRegressor(**shape, max_iter=STEPS, random_state=SEED)
    linear, size = data.fit_residual(begun, slice(None))
    first = [linear.coef_.T, begun.coefs_[0], begun.intercepts_[0], begun.coefs_[1] * size]
    sizes = len(lanes) * r, len(lanes) * r, len(lanes) * (m + r)
    network = Model(*sizes, state_fcn=step_of_lanes, output_fcn=lambda x, *_: x)
    network.init(params=first, x0=wanted[0])

    # Runs are of different lengths.
    def loss(found: Any, true: Any) -> Any:
        return (jnp.where(known, found - true, 0.0) ** 2).sum() / known.sum()  # type: ignore[operator]

    network.loss(loss, rho_th=settings.penalty, train_x0=False, xsat=CUT)
    network.optimization(adam_epochs=0, lbfgs_epochs=settings.epochs, iprint=-1)
    network.fit(wanted, driven)
    parameters, compiled = network.params, jax.jit(step)

    def of_runs(z: np.ndarray, u: np.ndarray) -> np.ndarray:
        return np.asarray(compiled(z, u, parameters)).reshape(z.shape)

    return data.model(stepped(of_runs))


def in_lanes(lengths: list[int]) -> list[list[tuple[int, int]]]:
    """Lanes as long as the longest run, of runs one behind the other and their first rows."""
    lanes: list[list[tuple[int, int]]] = []
    taken: list[int] = []
    for run in sorted(range(len(lengths)), key=lambda run: -lengths[run]):
        fitting = (k for k, rows in enumerate(taken) if rows + lengths[run] <= max(lengths))
        lane = next(fitting, len(lanes))
        if lane == len(lanes):
            lanes.append([])
            taken.append(0)
        lanes[lane].append((run, taken[lane]))
        taken[lane] += lengths[run]
    return lanes


METHOD = Method(
    name="trajectory_network",
    summary="a linear step and a network, trained on whole trajectories by jax-sysid",
    settings=dict.fromkeys(("ode", "dae"), TrajectoryNetworkSettings),
    refusal=no_steered_vehicle,
    fit=fit,
    reference="10.48550/arXiv.2403.03827",
    packages=("jax-sysid",),
)
