"""Ten thousand maneuvers of the reduced car by JAX: Runge-Kutta of order 4, steps of 10 ms."""

import jax
import numpy as np
from maneuvers import steering, t
from scipy.interpolate import CubicSpline

import vehiclemor as vm

jax.config.update("jax_enable_x64", True)
car = vm.rom("independent_suspension_vehicle")
rates, start = vm.export(car, "jax"), car.state()
chosen = [car.output_names.index(name) for name in ("lateral_position", "yaw", "Fz_FL")]
fine = CubicSpline(t, steering, axis=1)(np.linspace(0.0, 10.0, 2001))[:, :, None]
inputs = np.stack([fine[:, :-1:2], fine[:, 1::2], fine[:, 2::2]], axis=2)


def step(x, u):
    first, outputs = rates(x, u[0])
    second = rates(x + 0.005 * first, u[1])[0]
    third = rates(x + 0.005 * second, u[1])[0]
    last = rates(x + 0.01 * third, u[2])[0]
    x = x + 0.01 / 6.0 * (first + 2.0 * second + 2.0 * third + last)
    return x, outputs[np.array(chosen)]


batch = jax.jit(jax.vmap(lambda u: jax.lax.scan(step, start, u)[1][::10]))
found = np.asarray(batch(inputs))
