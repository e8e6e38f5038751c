"""
A thousand maneuvers
====================

``simulate_many`` runs one model over many inputs in threads and returns one labelled dataset.
"""

# %%
# A thousand steering angles: three random sine waves each, starting after one second.
import matplotlib.pyplot as plt
import numpy as np

import vehiclemor as vm

rng, t = np.random.default_rng(1), np.linspace(0.0, 10.0, 201)
rate, phase = rng.uniform(0.5, 4.0, (1000, 3, 1)), rng.uniform(0.0, 6.28, (1000, 3, 1))
onset = np.tanh(np.maximum(t - 1.0, 0.0)) ** 2
steering = 0.008 * onset * np.sin(rate * t + phase).sum(axis=1)

# %%
# Each run equals a single ``simulate`` to the bit. Choose the outputs that you need.
car = vm.rom("independent_suspension_vehicle")
signals = vm.many_signals(t, steering, hold="cubic")
runs = vm.simulate_many(car, signals, outputs=["lateral_position", "yaw_rate"])
print(f"{runs.sizes['run']} runs, {runs.seconds.sum().item():.2f} s in compiled loops")

# %%
# Where is the car after ten seconds, and how hard was it driven? A run that leaves the training of
# the reduced model has the status ``untrusted``.
ends = runs["values"].sel(output="lateral_position").isel(time=-1)
hardest = abs(runs["values"].sel(output="yaw_rate")).max("time")
trusted = runs.status == "ok"
figure, axis = plt.subplots(figsize=(6.7, 3.6))
for chosen, label in ((trusted, "ok"), (~trusted, "untrusted")):
    axis.scatter(hardest[chosen], ends[chosen], s=6, label=f"{label}: {int(chosen.sum())} runs")
axis.set(xlabel="largest yaw rate (rad/s)", ylabel="lateral position at 10 s (m)")
axis.legend()
plt.show()
