"""
Reduce a suspension in ten lines
================================

Proper orthogonal decomposition (POD) replaces the eight joint coordinates of a double wishbone
suspension by three. It is trained on one run and then simulates a wheel that moves 20 % faster.
"""

# %%
# The model solves its loop equations at every sample. Its inputs are the height of the wheel and
# the displacement of the rack. Training on ``nominal`` uses the maneuver of the paper.
import vehiclemor as vm

suspension = vm.model("double_wishbone")
reduced = vm.reduce(suspension, "pod", rank=3, training="nominal")

faster = vm.maneuver("sine_travel", frequency=1.2)
full = suspension.simulate(faster)
run = reduced.simulate(faster)

# %%
# Both runs have the same outputs. The differences are the error of the reduction.
error = vm.errors(run, full)
for name in ("spindle_y", "toe", "camber"):
    row = error.sel(output=name)
    print(f"{name:10} RMS error {row.rms_error.item():.1e} {row.output_unit.item()}")

# %%
# ``vm.plot`` draws a run beside the full model.
figure = vm.plot(run, full)
