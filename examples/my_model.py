"""
My own model
============

A quarter car drives over a bump: a body on a spring and a damper, a wheel on a tire. You write the
equations with SymPy. The package derives Jacobians, compiles, integrates and reduces.
"""

# %%
# Parameters have units and bounds. Their values are in a file that names a source for each.
import sys
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import sympy as sp

import vehiclemor as vm
from vehiclemor.plugin import Declared, Maneuver, ModelDefinition, Quantity, Tape, assemble

folder = Path(tempfile.mkdtemp())
VALUES = {"m_s": (250, "kg"), "m_u": (45, "kg"), "k": (16e3, "N/m"), "c": (1e3, "N s/m")}
VALUES["k_t"] = (160e3, "N/m")
lines = ['model = "quarter_car"\ntitle = "a quarter of a car"\nsources.assumption.text = "assumed"']
lines.append('sources.assumption.licence = "BSD-3-Clause"')
for name, (value, unit) in VALUES.items():
    lines.append(f'[parameters.{name}]\nsymbol = "{name}"\ndescription = "{name}"')
    lines.append(f'value = {value}\nunit = "{unit}"\nsource = "assumption"\nstatus = "assumed"')
(folder / "quarter_car.toml").write_text("\n".join(lines))


# %%
# The equations: rates of the state, outputs, and M and F of M q'' = F for reduction.
def derive():
    z_s, z_u, v_s, v_u = x = sp.symbols("z_s z_u v_s v_u", real=True)
    (road,) = u = sp.symbols("road,", real=True)
    m_s, m_u, k, c, k_t = p = sp.symbols([f"p_{name}" for name in VALUES], real=True)
    strut, tire = k * (z_u - z_s) + c * (v_u - v_s), k_t * (road - z_u)
    functions = {
        "derivative": ([v_s, v_u, strut / m_s, (tire - strut) / m_u], (4,)),
        "outputs": ([strut / m_s, tire], (2,)),
        "second_order": ([m_s, 0, strut, 0, m_u, tire - strut], (2, 3)),
        "speeds": ([v_s, v_u], (2,)),
    }
    return assemble(Tape(), {"x": x, "u": u}, p, functions)


def bump(times, frequency, amplitude):
    z = np.clip(frequency * times - 0.5, 0.0, 0.2) / 0.2
    return 0.04 * amplitude * np.sin(np.pi * z)[:, None] ** 2


BUMP = Maneuver(
    name="my_bump",
    summary="a bump of 4 cm",
    signal=bump,
    inputs=("road",),
    duration=3.0,
    samples=301,
    corners=lambda frequency: (0.5 / frequency, 0.7 / frequency),
)
CAR = ModelDefinition(
    name="quarter_car",
    kind="ode",
    summary="quarter car, 2 degrees of freedom",
    maneuver="my_bump",
    coordinates=(Quantity("z_s", "m", "body"), Quantity("z_u", "m", "wheel")),
    speeds=(Quantity("v_s", "m/s", "body"), Quantity("v_u", "m/s", "wheel")),
    inputs=(Quantity("road", "m", "height of the road"),),
    outputs=(Quantity("acceleration", "m/s^2", "of the body"), Quantity("tire", "N", "tire force")),
    parameters={name: Declared(unit, above=0.0) for name, (_, unit) in VALUES.items()},
    parameter_file=folder / "quarter_car.toml",
    derive=derive,
    starts=lambda values: {"equilibrium": np.zeros(4)},
)

# %%
# Names come from entry points. A package declares them in ``pyproject.toml``
# (``vehiclemor new-plugin`` writes one); a script can write the same lines itself.
entries = "[vehiclemor.models]\nquarter_car = __main__:CAR\n"
entries += "[vehiclemor.maneuvers]\nmy_bump = __main__:BUMP\n"
(folder / "quarter_car-1.0.dist-info").mkdir()
(folder / "quarter_car-1.0.dist-info" / "entry_points.txt").write_text(entries)
(folder / "quarter_car-1.0.dist-info" / "METADATA").write_text("Name: quarter_car\nVersion: 1.0\n")
sys.path.append(str(folder))

# From here on the model is like any other.
figure, axis = plt.subplots(figsize=(6.7, 3.4))
for stiffness in (8e3, 16e3, 32e3):
    run = vm.model("quarter_car", parameters={"k": stiffness}).simulate("my_bump")
    axis.plot(run.times, run["acceleration"], label=f"{stiffness / 1e3:.0f} N/mm")
axis.set(xlabel="time (s)", ylabel="acceleration of the body (m/s²)", xlim=(0.4, 3.0))
axis.legend(title="stiffness")
plt.show()

# %%
# Methods reduce it, too. One coordinate is not enough for a car that moves at two frequencies.
car, twice = vm.model("quarter_car"), vm.maneuver("my_bump", amplitude=2.0)
full = car.simulate(twice)
for rank in (1, 2):
    run = vm.reduce(car, "pod", rank=rank, training="nominal").simulate(twice)
    error = vm.errors(run, full)["rms_error"].sel(output="acceleration").item()
    print(f"{rank} coordinates: RMS error {error:.1e} m/s²")
