"""Interpolation (IRKA), by pyMOR, of a vehicle linearised at straight running, without training.

S. Gugercin, A. C. Antoulas, C. Beattie, H2 model reduction for large-scale linear dynamical
systems, SIAM J. Matrix Anal. Appl. 30 (2008), 609-638.  Of structures pyMOR has the same iteration
in second-order form (SOR-IRKA), which did not converge on the truck.
"""

import time

from vehiclemor.reduction.interface import Method, installed
from vehiclemor.reduction.training import Training
from vehiclemor.reduction.vehicle.linear_vehicle import LinearVehicleSettings, linear_reduction
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.reduction.vehicle.shape import no_steered_vehicle
from vehiclemor.simulation.dynamic import DynamicModel


def fit(model: DynamicModel, training: Training, settings: LinearVehicleSettings) -> ReducedVehicle:
    """Interpolate; no training run is looked at.  `InputError` if pyMOR is missing."""
    with installed("pyMOR"):
        from pymor.reductors.h2 import IRKAReductor
    return linear_reduction(IRKAReductor, model, settings, time.process_time())


METHOD = Method(
    name="irka",
    summary="lateral dynamics that interpolate the linearised ones best (IRKA), by pyMOR",
    reference="10.1137/060666123",
    settings=dict.fromkeys(("ode", "dae"), LinearVehicleSettings),
    refusal=no_steered_vehicle,
    fit=fit,
    learns_from="nothing",
    packages=("pymor",),
)
