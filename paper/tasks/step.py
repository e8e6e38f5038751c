"""A step of 10 ms of the reduced car, inputs held."""

import vehiclemor as vm

car = vm.rom("independent_suspension_vehicle")
state = car.step(car.state(), [0.02], 0.01)
