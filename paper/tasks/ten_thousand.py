"""Ten thousand maneuvers of the reduced car, in as many threads as there are cores."""

from maneuvers import steering, t

import vehiclemor as vm

car = vm.rom("independent_suspension_vehicle")
signals = vm.many_signals(t, steering, hold="cubic")
names = ["lateral_position", "yaw", "Fz_FL"]
found = vm.simulate_many(car, signals, outputs=names, times=t[::2])
