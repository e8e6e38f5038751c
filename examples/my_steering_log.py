"""
My steering log as an input
===========================

A steering angle from a test drive becomes the input of a model. Here the log is a CSV file with
100 samples a second in degrees.
"""

# %%
# First we write such a log. Yours is a file that you have already.
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import vehiclemor as vm

t = np.linspace(0.0, 8.0, 801)
angle = 1.2 * np.sin(2.5 * t) * np.exp(-(((t - 4.0) / 2.0) ** 2))
log = Path(tempfile.mkdtemp()) / "log.csv"
table = np.column_stack([t, angle])
np.savetxt(log, table, "%.4f", ",", header="time,steering angle", comments="")
print(log.read_text()[:62])

# %%
# ``inputs`` maps the input of the model to the column. ``ratio=16`` would take the angle of a
# steering wheel. In a shell: ``vehiclemor simulate MODEL --maneuver log.csv --csv unit=deg ...``.
signal = vm.Signal.from_csv(log, "cubic", inputs={"delta": "steering angle"}, unit="deg")
print(signal)

# %%
# A reduced car with 12 states ships with the package. It has never seen this log.
reduced = vm.rom("independent_suspension_vehicle")
full = reduced.model.simulate(signal)
run = reduced.simulate(signal)
print(f"status: {run.status}, trust indicator: {run.trust.indicator:.2f} (1 is the limit)")

# %%
figure, axes = plt.subplots(3, sharex=True, figsize=(6.7, 5.5))
axes[0].plot(full.times, np.degrees(full.inputs))
axes[0].set_ylabel("steering angle (deg)")
for axis, name, unit in zip(axes[1:], ("lateral_position", "roll"), ("m", "rad"), strict=True):
    axis.plot(full.times, full[name], label="full model, 28 states")
    axis.plot(run.times, run[name], "--", label="reduced model, 12 states")
    axis.set_ylabel(f"{name.replace('_', ' ')} ({unit})")
axes[1].legend()
axes[2].set_xlabel("time (s)")
plt.show()
