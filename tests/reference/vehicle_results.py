"""Small reference results of the 14-DOF vehicle, and how they are made.

`python -m tests.reference.vehicle_results` writes the file in `data/reference` anew.  Do that only
when a change of results is meant, and say so in the commit and the changelog.
"""

import json
from pathlib import Path

import numpy as np

import vehiclemor as vm

NAME = "independent_suspension_vehicle"
# Label -> arguments of a simulation.
RUNS = {
    "full order": {"method": "full_order"},
    "full order, strongest": {"method": "full_order", "preset": "strongest"},
    "pod r=3": {"method": "pod"},
    "pod state r=3": {"method": "pod", "formulation": "state"},
    "pod r=3, no steering": {"method": "pod", "training": "nominal", "amplitude": 0.0},
}
COUNTS = ("rhs_calls", "steps", "rejected_steps", "linear_solves")
OUTPUTS = ("lateral_position", "yaw", "pitch", "roll")


def current() -> dict:
    """Reference quantities as the code gives them now."""
    model = vm.model(NAME)
    turning = model.start("dropped") + 0.01 * np.sin(np.arange(28.0))
    result: dict = {
        "operations": {name: c["total"] for name, c in model.operation_counts.items()},
        "derivative": model.derivative(turning, [0.02]).tolist(),
        "runs": {},
    }
    for run, arguments in RUNS.items():
        for start in model.starts:
            data = vm.simulate(NAME, start=start, **arguments)
            chosen = data.sel(output=list(OUTPUTS))
            entry = {name: int(data[name]) for name in COUNTS}
            entry["last"] = chosen["outputs"].isel(time=-1).values.tolist()
            for kind in ("rms_error", "floor_rms_error"):
                entry[kind] = chosen[kind].values.tolist()
            result["runs"][f"{run}, {start}"] = entry
    return result


def main() -> None:
    path = Path(__file__).parents[2] / "data" / "reference" / f"{NAME}.json"
    path.write_text(json.dumps(current(), indent=1) + "\n")


if __name__ == "__main__":
    main()
