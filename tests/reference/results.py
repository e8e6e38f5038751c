"""Small reference results of the models, and how they are made.

`python -m tests.reference.results MODEL` writes its file beside this one anew.  Do that only
when a change of results is meant, and say so in the commit and the changelog.
"""

import json
import sys
from pathlib import Path

import numpy as np

import vehiclemor as vm

FOLDER = Path(__file__).parent
MECHANISM = "double_wishbone"
STRONGEST = {"method": "full_order", "preset": "strongest"}
PAPER = {"method": "full_order", "preset": "paper"}
NO_STEERING = {"training": "nominal", "amplitude": 0.0}
# Model -> label -> arguments of a simulation.
RUNS = {
    MECHANISM: {
        "full order": {"method": "full_order"},
        "full order, strongest": STRONGEST,
        "pod r=3": {"method": "pod", "rank": 3},
        "pod literal r=3": {"method": "pod", "preset": "literal", "rank": 3},
        "pod r=4": {"method": "pod", "rank": 4},
        "fixed basis r=3": {"method": "fixed_basis", "rank": 3},
        "replay": {"method": "replay"},
    },
    "independent_suspension_vehicle": {
        "full order": PAPER,
        "full order, strongest": STRONGEST,
        "pod r=3": {"method": "pod"},
        "pod state r=3": {"method": "pod", "formulation": "state"},
        "pod r=3, no steering": {"method": "pod", **NO_STEERING},
    },
    "high_fidelity_vehicle": {
        "full order": PAPER,
        "full order, strongest": STRONGEST,
        "pod r=1": {"method": "pod"},
        "pod coordinates r=3": {"method": "pod", "rank": 3, "formulation": "coordinates"},
        "pod r=1, no steering": {"method": "pod", **NO_STEERING},
    },
}
INPUTS = {
    "nominal": {},
    "frequency 1.2": {"frequency": 1.2},
    "amplitude 1.2": {"amplitude": 1.2},
    "frequency 2.0": {"frequency": 2.0},
}
OUTPUTS = {
    MECHANISM: ("spindle_y", "second_euler_angle"),
    "independent_suspension_vehicle": ("lateral_position", "yaw", "pitch", "roll"),
    "high_fidelity_vehicle": ("lateral_position", "yaw", "lateral_speed", "vertical_speed"),
}
ALGEBRAIC = ("iterations", "residual_evaluations", "jacobian_evaluations", "linear_solves")
DYNAMIC = ("rhs_calls", "steps", "rejected_steps", "linear_solves")


def current(name: str) -> dict:
    """Reference quantities of a model as the code gives them now."""
    model, result = vm.model(name), {}
    counts = ALGEBRAIC if name == MECHANISM else DYNAMIC
    result["operations"] = {kernel: c["total"] for kernel, c in model.operation_counts.items()}
    if name == MECHANISM:
        result["reach"] = list(model.reach())
        result["coordinates"] = {str(z): model.solve([z, 0.0]).tolist() for z in (-0.1, 0.1)}
        cases = {case: {"training": "nominal", **factors} for case, factors in INPUTS.items()}
    else:
        size = 2 * len(model.coordinates)
        turning = model.start("dropped") + 0.01 * np.sin(np.arange(float(size)))
        inputs = [0.02, 0.03, -0.05][: len(model.inputs)]
        result["derivative"] = model.rhs(turning, inputs).tolist()
        cases = {start: {"start": start} for start in model.starts}
    result["runs"] = {}
    for run, arguments in RUNS[name].items():
        for case, further in cases.items():
            data = vm.simulate(name, **arguments, **further)
            chosen = data.sel(output=list(OUTPUTS[name]))
            entry = {count: int(data[count]) for count in counts}
            if name != MECHANISM:
                entry["last"] = chosen["outputs"].isel(time=-1).values.tolist()
            for kind in ("rms_error", "floor_rms_error"):
                entry[kind] = chosen[kind].values.tolist()
            result["runs"][f"{run}, {case}"] = entry
    return result


def main() -> None:
    name = sys.argv[1]
    path = FOLDER / f"{name}.json"
    path.write_text(json.dumps(current(name), indent=1) + "\n")


if __name__ == "__main__":
    main()
