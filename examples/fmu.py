"""
A functional mock-up unit
=========================

Any exported model is an FMU for Simulink, Dymola or OpenModelica. Here FMPy runs it beside the
package. A C compiler is needed; ``pip install fmpy`` installs FMPy.
"""

# %%
# The FMU holds the C source of the equations, an integrator and a binary for this platform.
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from fmpy import read_model_description, simulate_fmu

import vehiclemor as vm

car = vm.rom("independent_suspension_vehicle")
unit = vm.export(car, "fmu", Path(tempfile.mkdtemp()) / "car.fmu")
description = read_model_description(str(unit))
print(f"FMI {description.fmiVersion}, {unit.stat().st_size // 1000} kB")
print("inputs:", [v.name for v in description.modelVariables if v.causality == "input"])

# %%
# FMPy holds the input between exchanges every 10 ms. Steps in Python do the same.
t = np.arange(501) * 0.01
angle = 0.02 * np.sin(np.pi * t) * (t < 2.0)
table = np.array(list(zip(t, angle, strict=True)), [("time", float), ("delta", float)])
outputs = ["lateral_position", "trust_indicator"]
how = {"stop_time": 5.0, "step_size": 0.01, "output_interval": 0.01, "output": outputs}
unit_run = simulate_fmu(str(unit), input=table, fmi_type="CoSimulation", **how)

state, output, stepped = car.state(), car.output_names.index("lateral_position"), [0.0]
for delta in angle[:-1]:
    state = car.step(state, [delta], 0.01)
    stepped.append(car.outputs(state, [delta])[output])

# %%
# The two integrators differ by a small error. The FMU tells its trust indicator too.
figure, axes = plt.subplots(2, sharex=True, figsize=(6.7, 4.4))
axes[0].plot(t, stepped, label="steps in Python")
axes[0].plot(unit_run["time"], unit_run["lateral_position"], "--", label="FMU in FMPy")
axes[0].set_ylabel("lateral position (m)")
axes[0].legend()
axes[1].plot(unit_run["time"], unit_run["trust_indicator"])
axes[1].set(xlabel="time (s)", ylabel="trust indicator")
plt.show()
