"""Ten thousand maneuvers of the full car, in as many threads as there are cores."""

from maneuvers import steering, t

import vehiclemor as vm

coarse = {"solver": "ros34pw2", "tolerance": 2e-3}
car = vm.reduce("independent_suspension_vehicle", "full_order", **coarse)
signals = vm.many_signals(t, steering, hold="cubic")
names = ["lateral_position", "yaw", "Fz_FL"]
found = vm.simulate_many(car, signals, outputs=names, times=t[::2])
