"""
What POD repeats and a slow manifold predicts
=============================================

Both methods are tested on steering that they have not seen: none at all, and the other way.
"""

# %%
# POD is trained on the lane change of the paper, as the paper does it. The slow manifold ships with
# the package; it is trained on many maneuvers.
import matplotlib.pyplot as plt

import vehiclemor as vm

car = vm.model("independent_suspension_vehicle")
models = {
    "POD, 3 coordinates": vm.reduce(car, "pod", rank=3, training="nominal"),
    "slow manifold": vm.rom("independent_suspension_vehicle"),
}

# %%
# Amplitude 1 is the training run of POD. Amplitude 0 drives straight on, amplitude -1 steers to the
# other side.
figure, axes = plt.subplots(1, 3, sharey=True, figsize=(8.0, 3.2))
titles = ("the training run", "no steering", "the other way")
for axis, amplitude, title in zip(axes, (1.0, 0.0, -1.0), titles, strict=True):
    maneuver = vm.maneuver("lane_change", amplitude=amplitude)
    full = car.simulate(maneuver)
    axis.plot(full["longitudinal_position"], full["lateral_position"], label="full model", lw=3)
    for (label, model), style in zip(models.items(), ("--", ":"), strict=True):
        run = model.simulate(maneuver)
        axis.plot(run["longitudinal_position"], run["lateral_position"], style, label=label)
        error = vm.errors(run, full).max_error.sel(output="lateral_position").item()
        print(f"{title:16} {label:20} off by at most {error:.1e} m")
    axis.set(xlabel="longitudinal position (m)", title=title)
axes[0].set_ylabel("lateral position (m)")
axes[0].legend()
plt.show()

# %%
# POD follows its training run whatever the driver does: it repeats. The slow manifold follows the
# steering: it predicts.
