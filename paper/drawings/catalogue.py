"""Which figures the paper has: drawing, datasets, options."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from matplotlib.figure import Figure

from drawings import coverage, fields, schematics, suspension, vehicles

PROTOCOLS = [f"{kind}-{model}" for kind in ("contenders", "predictive") for model in fields.MODELS]


class Entry(NamedTuple):
    """One figure: what draws it, from which datasets in `studies/` of the results, its options."""

    draw: Callable[..., Figure]
    studies: Sequence[str] = ()
    options: Mapping[str, Any] = {}


# Name of the file -> figure.  A number is that of the figure in the paper of 2015.
FIGURES: Mapping[str, Entry] = {
    "figure-01": Entry(schematics.figure_schematic, options={"name": "vehicle"}),
    "figure-02": Entry(vehicles.figure_paths, ["figures-2-4"], {"study": "figures-2-4"}),
    "figure-03": Entry(vehicles.figure_pitch_and_yaw, ["figures-2-4"]),
    "figure-04": Entry(vehicles.figure_pitch_and_yaw, ["figures-2-4"], {"errors": True}),
    "figure-05": Entry(schematics.figure_schematic, options={"name": "suspension"}),
    "figure-06": Entry(suspension.figure_histories, ["figures-6-7"], {"study": "figures-6-7"}),
    "figure-07": Entry(
        suspension.figure_histories, ["figures-6-7"], {"study": "figures-6-7", "errors": True}
    ),
    "figure-08": Entry(schematics.figure_schematic, options={"name": "high_fidelity"}),
    "figure-09": Entry(vehicles.figure_paths, ["figures-9-10"], {"study": "figures-9-10"}),
    "figure-10": Entry(vehicles.figure_speeds, ["figures-9-10"]),
    "figure-11": Entry(suspension.figure_histories, ["figure-11"], {"study": "figure-11"}),
    "figure-12": Entry(suspension.figure_histories, ["figure-12"], {"study": "figure-12"}),
    "figure-13": Entry(
        suspension.figure_perturbations, ["figure-13-frequency", "figure-13-amplitude"]
    ),
    "figure-14": Entry(suspension.figure_spread, ["figure-14", "figure-14-spread"]),
    "truck": Entry(schematics.figure_truck),
    "equation-order": Entry(suspension.figure_equation_order, ["equation-order", "figures-6-7"]),
    "zero-steer": Entry(
        vehicles.figure_zero_steer, ["vehicle-zero-steer", "high-fidelity-zero-steer"]
    ),
    "unseen-inputs": Entry(vehicles.figure_unseen, ["unseen-inputs", "unseen-inputs-ranks"]),
    "pareto": Entry(fields.figure_pareto, PROTOCOLS),
    "size": Entry(fields.figure_size, ["mesh_sizes"]),
    "coverage": Entry(coverage.figure_coverage, ["other_steering"]),
    "estimate": Entry(coverage.figure_estimate, ["other_steering"]),
    "peers": Entry(fields.figure_peers, ["peers"]),
    "steps": Entry(fields.figure_steps, ["steps"]),
}
