"""
A truck on a random road
========================

A truck with a flexible frame drives over roads of ISO 8608. Craig-Bampton reduction keeps a few
vibration modes of the frame and reproduces what the driver feels.
"""

# %%
# The payload may change from run to run of one reduced model, so it is a parameter of the model.
import matplotlib.pyplot as plt
import numpy as np
from scipy.signal import welch

import vehiclemor as vm

truck = vm.model("flexible_truck", parameters={"payload": 3000.0})
reduced = vm.reduce(truck, "craig_bampton", training=vm.road("D", seed=1, speed=25.0))
print(f"{2 * truck.system.structure.mass.shape[0]} states become {len(reduced.states)}")

# %%
# Drive over a road of class C that neither model has seen.
unseen = vm.road("C", seed=7, speed=22.0)
full, run = truck.simulate(unseen), reduced.simulate(unseen)
for label, result in (("full", full), ("reduced", run)):
    felt = vm.weighted_rms(result.times, result["driver_acceleration"])
    print(f"{label:8} {felt:.3f} m/s² weighted after ISO 2631-1")

# %%
# The spectrum shows up to which frequency the reduced truck is the same.
figure, axes = plt.subplots(2, figsize=(6.7, 5.0))
rate = 1.0 / (full.times[1] - full.times[0])
for result, style, label in ((full, "-", "full"), (run, "--", "reduced")):
    axes[0].plot(result.times, result["driver_acceleration"], style, label=label)
    frequency, power = welch(result["driver_acceleration"], rate, nperseg=512)
    axes[1].loglog(frequency[1:], np.sqrt(power[1:]), style)
axes[0].set(xlim=(5.0, 8.0), xlabel="time (s)", ylabel="acceleration (m/s²)")
axes[0].legend()
axes[1].set(xlabel="frequency (Hz)", ylabel="spectrum (m/s²/√Hz)")
plt.show()
