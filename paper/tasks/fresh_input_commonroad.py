"""A run of the multi-body model of CommonRoad, whose input is the rate of the steering angle."""

import numpy as np
from maneuvers import steering, t
from scipy.integrate import odeint
from vehiclemodels.init_mb import init_mb
from vehiclemodels.parameters_vehicle2 import parameters_vehicle2
from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb

parameters, rates = parameters_vehicle2(), np.gradient(steering[0], t)
start = init_mb([0.0, 0.0, 0.0, 20.0, 0.0, 0.0, 0.0], parameters)


def motion(x, time):
    return vehicle_dynamics_mb(x, [np.interp(time, t, rates), 0.0], parameters)


states = odeint(motion, start, t)
