"""A run of the reduced car with a steering angle that was never seen."""

from maneuvers import steering, t

import vehiclemor as vm

car = vm.rom("independent_suspension_vehicle")
run = car.simulate(vm.Signal.from_samples(t, steering[0], "cubic"))
lateral = run["lateral_position"]
