"""A run of the full car with a steering angle that was never seen."""

from maneuvers import steering, t

import vehiclemor as vm

coarse = {"solver": "ros34pw2", "tolerance": 2e-3}
car = vm.reduce("independent_suspension_vehicle", "full_order", **coarse)
run = car.simulate(vm.Signal.from_samples(t, steering[0], "cubic"))
lateral = run["lateral_position"]
