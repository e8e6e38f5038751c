"""Small reference results of the vehicles, and how they are made.

`python -m tests.reference.vehicle_results MODEL` writes its file in `data/reference` anew.  Do that
only when a change of results is meant, and say so in the commit and the changelog.
"""

import json
import sys
from pathlib import Path

import numpy as np

import vehiclemor as vm

# Model -> label -> arguments of a simulation.
RUNS = {
    "independent_suspension_vehicle": {
        "full order": {"method": "full_order"},
        "full order, strongest": {"method": "full_order", "preset": "strongest"},
        "pod r=3": {"method": "pod"},
        "pod state r=3": {"method": "pod", "formulation": "state"},
        "pod r=3, no steering": {"method": "pod", "training": "nominal", "amplitude": 0.0},
    },
    "high_fidelity_vehicle": {
        "full order": {"method": "full_order"},
        "full order, strongest": {"method": "full_order", "preset": "strongest"},
        "pod r=1": {"method": "pod"},
        "pod coordinates r=3": {"method": "pod", "rank": 3, "formulation": "coordinates"},
        "pod r=1, no steering": {"method": "pod", "training": "nominal", "amplitude": 0.0},
    },
}
COUNTS = ("rhs_calls", "steps", "rejected_steps", "linear_solves")
OUTPUTS = {
    "independent_suspension_vehicle": ("lateral_position", "yaw", "pitch", "roll"),
    "high_fidelity_vehicle": ("lateral_position", "yaw", "lateral_speed", "vertical_speed"),
}


def current(name: str) -> dict:
    """Reference quantities of a model as the code gives them now."""
    model = vm.model(name)
    size = 2 * len(model.coordinates)
    turning = model.start("dropped") + 0.01 * np.sin(np.arange(float(size)))
    inputs = [0.02, 0.03, -0.05][: len(model.inputs)]
    result: dict = {
        "operations": {kernel: c["total"] for kernel, c in model.operation_counts.items()},
        "derivative": model.derivative(turning, inputs).tolist(),
        "runs": {},
    }
    for run, arguments in RUNS[name].items():
        for start in model.starts:
            data = vm.simulate(name, start=start, **arguments)
            chosen = data.sel(output=list(OUTPUTS[name]))
            entry = {count: int(data[count]) for count in COUNTS}
            entry["last"] = chosen["outputs"].isel(time=-1).values.tolist()
            for kind in ("rms_error", "floor_rms_error"):
                entry[kind] = chosen[kind].values.tolist()
            result["runs"][f"{run}, {start}"] = entry
    return result


def main() -> None:
    name = sys.argv[1]
    path = Path(__file__).parents[2] / "data" / "reference" / f"{name}.json"
    path.write_text(json.dumps(current(name), indent=1) + "\n")


if __name__ == "__main__":
    main()
