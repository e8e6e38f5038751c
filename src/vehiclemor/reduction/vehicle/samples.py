"""Training runs of a vehicle, sample by sample, as its shape and the rates of that."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vehiclemor.reduction.vehicle.shape import VehicleShape
from vehiclemor.simulation.trajectory import Trajectory


class ShapeSamples(NamedTuple):
    """Samples of all runs, one after the other.

    Attributes
    ----------
    inputs, deviations
        Inputs (samples, inputs), deviations of the shape from straight running (samples, n).
    rates, motion
        Rates of the shape (samples, n), and psi', U, V (samples, 3), by the full equations.
    """

    inputs: np.ndarray
    deviations: np.ndarray
    rates: np.ndarray
    motion: np.ndarray


def shape_samples(shape: VehicleShape, runs: Sequence[Trajectory]) -> ShapeSamples:
    """Samples of training runs; one evaluation of the full equations for each."""
    inputs = np.concatenate([run.inputs for run in runs])
    shapes = np.concatenate([shape.of(run.states) for run in runs])
    return ShapeSamples(inputs, shapes - shape.reference, *shape.motion(shapes, inputs))
