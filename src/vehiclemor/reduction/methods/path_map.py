"""Path map: the coordinates of a mechanism with one degree of freedom as polynomials in its travel.

At a constant rack displacement the configurations of a suspension form a curve.  It is smooth, so
that least squares on Chebyshev polynomials converge geometrically with the degree (L. N. Trefethen,
Approximation Theory and Approximation Practice, 2013, chapter 8).  No equation is solved online.
"""

import time
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.polynomial import chebyshev
from pydantic import Field

from vehiclemor.errors import InputError
from vehiclemor.maneuver import Maneuver
from vehiclemor.reduction.interface import Method, Offline, offline_cost
from vehiclemor.reduction.polynomials.kernels import map_loop
from vehiclemor.reduction.polynomials.map_loops import BLOCK
from vehiclemor.reduction.settings import Settings
from vehiclemor.reduction.solved_path import solved_path
from vehiclemor.reduction.training import Training
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.simulation.checks import loop_array
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Start, Trajectory

# Above this degree, powers of the travel lose digits to rounding.
HIGHEST_DEGREE = 20
# Tolerance of the range of training, relative to the range of the travel.
SLACK = 1e-9


class PathMapSettings(Settings):
    """Settings for a kinematic model."""

    degree: int = Field(10, ge=1, description="degree of the polynomials in the travel")
    outside: Literal["stop", "extrapolate"] = Field(
        "stop",
        description="stop: a run that leaves the inputs of training has diverged; extrapolate: it "
        "goes on",
    )


@dataclass(frozen=True)
class PathMapModel(ShortRepr):
    """Coordinates as polynomials of the travel.

    Attributes
    ----------
    centre, scale
        The polynomials' argument is (travel - centre) * scale; m and 1/m.
    coefficients
        Those of the highest power first (degree + 1, n), rad or m.
    travel, rack
        Lowest and highest travel, and the rack displacement, of training, in m.
    stops
        Whether a run stops that leaves them.
    """

    model: AlgebraicModel
    centre: float
    scale: float
    coefficients: np.ndarray
    travel: tuple[float, float]
    rack: float
    stops: bool
    offline: Offline

    @property
    def effective_rank(self) -> int:
        """The travel is the only coordinate."""
        return 1

    def simulate(self, maneuver: Maneuver, start: Start) -> Trajectory:
        """Polynomials at the maneuver's output times."""
        model, times = self.model, maneuver.times
        model.start(start)
        inputs = model.inputs_of(maneuver, times)
        degree, n = len(self.coefficients) - 1, len(model.coordinates)
        (low, high), slack = self.travel, SLACK * (self.travel[1] - self.travel[0])
        limits = np.array([low - slack, high + slack, self.rack - slack, self.rack + slack])
        if not self.stops:
            limits = np.array([-np.inf, np.inf, -np.inf, np.inf])
        loop, buffer = map_loop(n, degree), np.zeros(BLOCK * (n + 1))
        fixed = (inputs, self.centre, self.scale, limits, self.coefficients)
        found, sample = solved_path(
            model, times, inputs, lambda to: loop.prepared(*fixed, to, buffer)
        )
        if found.status == "ok":
            return found
        return replace(found, message=self._outside(float(times[sample]), *inputs[sample].tolist()))

    def _outside(self, moment: float, travel: float, rack: float) -> str:
        low, high = self.travel
        return (
            f"height {travel:.5g} m with the rack at {rack:.5g} m at t = {moment:.6g} s is outside "
            f"of the training: {low:.5g} to {high:.5g} m with the rack at {self.rack:.5g} m"
        )

    def best_approximation(self, states: np.ndarray) -> None:
        """There is no subspace to project onto."""
        del states


def check(model: Model, settings: PathMapSettings) -> None:
    """Raise `InputError` if the degree is too high for powers of the travel."""
    if settings.degree > HIGHEST_DEGREE:
        raise InputError(f"degree {settings.degree} is above {HIGHEST_DEGREE}")


def fit(model: AlgebraicModel, training: Training, settings: PathMapSettings) -> PathMapModel:
    """Least squares over all output times of the training runs.

    Raises
    ------
    InputError
        If the rack moves in training, or the travel takes too few values for the degree.
    """
    began = time.process_time()
    degree = settings.degree
    runs = [run.recorded() for run in training]
    inputs = np.concatenate([run.inputs for run in runs])
    travel, racks = inputs[:, 0], inputs[:, 1]
    low, high = float(travel.min()), float(travel.max())
    if np.ptp(racks) > SLACK * (high - low):
        raise InputError(
            f"path_map needs a constant rack: in training it moves from {racks.min():.4g} to "
            f"{racks.max():.4g} m"
        )
    centre, scale = 0.5 * (low + high), 2.0 / (high - low) if high > low else 0.0
    x = (travel - centre) * scale
    # Heights nearer to each other than the tolerance count once.
    heights = len(np.unique(np.round(x / SLACK)))
    if heights <= degree:
        raise InputError(f"degree {degree} needs {degree + 1} heights; training has {heights}")
    samples = np.concatenate([run.coordinates for run in runs])
    # The fit is ill-conditioned in powers, their evaluation is not.
    series = np.linalg.lstsq(chebyshev.chebvander(x, degree), samples, rcond=None)[0]
    powers = np.zeros((degree + 1, samples.shape[1]))
    for i, column in enumerate(series.T):
        power = chebyshev.cheb2poly(column)
        powers[: len(power), i] = power
    return PathMapModel(
        model,
        centre,
        scale,
        loop_array(powers[::-1]),
        (low, high),
        float(racks[0]),
        settings.outside == "stop",
        offline_cost(began, model, runs),
    )


METHOD = Method(
    name="path_map",
    summary="the coordinates as polynomials in the wheel travel: no equation is solved",
    reference="10.1137/1.9781611975949",
    settings={"ae": PathMapSettings},
    check=check,
    fit=fit,
    own_limits=True,
)
