"""The same of the full car by SciPy on its compiled right-hand side."""

from maneuvers import steering, t
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

import vehiclemor as vm

car = vm.reduce("independent_suspension_vehicle", "full_order")
angle = CubicSpline(t, steering[0])
found = solve_ivp(
    lambda time, x: car.rhs(x, [angle(time)]), (0.0, 10.0), car.state(), "LSODA", t, rtol=1e-5
)
outputs = car.outputs(found.y.T, steering[0][:, None])
