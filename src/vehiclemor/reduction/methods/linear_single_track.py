"""The linear single-track car (bicycle model): lateral speed V and yaw rate r at constant speed U.

P. Riekert, T. E. Schunck, Ing.-Arch. 11 (1940), 210-224; M. Mitschke, H. Wallentowitz, Dynamik der
Kraftfahrzeuge (Springer).  With C_i, l_i effective cornering stiffness and place of the axles:

    m V' = -m U r + sum_i F_i,   J r' = sum_i l_i F_i,   F_i = C_i (steer_i - (V + l_i r) / U)

The numbers come from the model itself: it is linearised at straight running (speed U0), and all
other lateral states are eliminated as if they were at rest (A_kk - A_kf A_ff^-1 A_fk, static
condensation).  So the stiffnesses are effective ones: pneumatic trail, roll steer, camber and, for
a prescribed rack, the wheels' angle per rack are in them; steady cornering is that of the
linearised model.  Masses and stiffnesses need not be told apart: the 2x2 matrix of the car is

    A(U) = U [[0, -1], [0, 0]] + U0 / U A1

so A1 follows from the matrix at U0, and the car holds at the speed of its start, which stays
constant.  Velocity and acceleration of the rack are left out.  Heave and pitch have no place in a
single-track car.
"""

import time

import numpy as np

from vehiclemor.reduction.interface import Method
from vehiclemor.reduction.settings import OnlineSettings
from vehiclemor.reduction.training import Training
from vehiclemor.reduction.vehicle.features import PLANAR, FeatureListing
from vehiclemor.reduction.vehicle.linear_modes import slow_modes
from vehiclemor.reduction.vehicle.linear_vehicle import (
    CORNERING,
    HEADING,
    MARGIN,
    PLACE,
    SPEED,
    linearisation_cost,
)
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.reduction.vehicle.shape import VehicleShape, no_steered_vehicle
from vehiclemor.simulation.dynamic import DynamicModel

# Lateral speed (m/s) of a typical maneuver.
SIDEWARD = 0.5


def fit(model: DynamicModel, training: Training, settings: OnlineSettings) -> ReducedVehicle:
    """Linearise and condense; no training run is looked at."""
    began = time.process_time()
    shape = VehicleShape(model)
    linear, modes, inputs = shape.linearised, slow_modes(shape, np.inf), len(model.inputs)
    # States of the shape that are nearest to V and r; the others follow them and the steering.
    kept = np.argmax(np.abs(linear.motion_a[[2, 0]]), axis=1)
    rest = np.setdiff1d(np.arange(len(linear.a)), kept)
    drive = np.column_stack([linear.a[np.ix_(rest, kept)], linear.b[rest, 0]])
    follow = np.zeros((len(linear.a), 3))
    # The speed's zero eigenvalue makes the matrix singular: the least-squares solution cuts it.
    follow[rest] = -np.linalg.lstsq(linear.a[np.ix_(rest, rest)], drive, rcond=1e-10)[0]
    follow[kept, [0, 1]] = 1.0
    condensed = linear.a[kept] @ follow
    condensed[:, 2] += linear.b[kept, 0]
    # What comes from the tires goes as one over the speed.
    tire = condensed[:, :2] - np.array([[0.0, -shape.speed], [0.0, 0.0]])
    # States V, r and the deviation of the speed.
    listing = FeatureListing(3, inputs)
    (v, r, slower), u, p = listing.z, listing.u[0], listing.p(0)
    part, speed = listing.let(p / (p + slower)), p + slower
    terms = ((v,), (r,), (u,), (part, v), (part, r), (speed, r), (speed,), (slower,))
    groups = (((0, 1, 2, 3, 4, 5), (0, 1, 3, 5)), ((6, 7), (4,)))
    features = listing.features(terms, groups)
    c = np.zeros((len(terms), 3 + PLANAR))
    c[[3, 4], :2], c[2, :2], c[5, 0] = tire.T, condensed[:, 2], -1.0
    c[1, 3], c[6, 4], c[0, 5] = 1.0, 1.0, 1.0
    decoding = np.zeros((len(terms), len(shape.reference)))
    decoding[:3], decoding[7] = follow.T, modes.speed_right
    turn = CORNERING / shape.speed
    return ReducedVehicle(
        model,
        shape,
        features,
        np.array([shape.speed]),
        c,
        decoding,
        np.vstack([np.eye(len(linear.a))[kept], modes.speed_left]),
        np.zeros((3, inputs)),
        np.array([MARGIN * SIDEWARD, MARGIN * turn, SPEED, HEADING, PLACE, PLACE]),
        linearisation_cost(shape, began),
        settings.solver,
        settings.tolerance,
    )


METHOD = Method(
    name="linear_single_track",
    summary="linear single-track car with the model's own effective stiffnesses",
    reference="10.1007/BF02086921",
    settings=dict.fromkeys(("ode", "dae"), OnlineSettings),
    refusal=no_steered_vehicle,
    fit=fit,
    learns_from="nothing",
)
