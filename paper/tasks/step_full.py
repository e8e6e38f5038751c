"""A step of 10 ms of the full car, inputs held."""

import vehiclemor as vm

coarse = {"solver": "ros34pw2", "tolerance": 2e-3}
car = vm.reduce("independent_suspension_vehicle", "full_order", **coarse)
state = car.step(car.state(), [0.02], 0.01)
