"""Small reference results of the double-wishbone suspension, and how they are made.

`python -m tests.reference.results` writes `data/reference/double_wishbone.json` anew.  Do that only
when a change of results is meant, and say so in the commit and the changelog.
"""

import json
from pathlib import Path

import vehiclemor as vm

# Label -> arguments of a simulation.
RUNS = {
    "full order": {"method": "full_order"},
    "full order, strongest": {"method": "full_order", "preset": "strongest"},
    "pod r=3": {"method": "pod", "rank": 3},
    "pod literal r=3": {"method": "pod", "preset": "literal", "rank": 3},
    "pod r=4": {"method": "pod", "rank": 4},
    "fixed basis r=3": {"method": "fixed_basis", "rank": 3},
    "replay": {"method": "replay"},
}
INPUTS = {
    "nominal": {},
    "frequency 1.2": {"frequency": 1.2},
    "amplitude 1.2": {"amplitude": 1.2},
    "frequency 2.0": {"frequency": 2.0},
}
OUTPUTS = ("spindle_y", "second_euler_angle")
COUNTS = ("iterations", "residual_evaluations", "jacobian_evaluations", "linear_solves")


def current() -> dict:
    """Reference quantities as the code gives them now."""
    model = vm.model("double_wishbone")
    result: dict = {
        "operations": {name: c["total"] for name, c in model.operation_counts.items()},
        "reach": list(model.reach()),
        "coordinates": {str(z): model.solve([z, 0.0]).tolist() for z in (-0.1, 0.1)},
        "runs": {},
    }
    for run, arguments in RUNS.items():
        for case, factors in INPUTS.items():
            data = vm.simulate("double_wishbone", training="nominal", **arguments, **factors)
            entry = {name: int(data[name]) for name in COUNTS}
            for kind in ("rms_error", "floor_rms_error"):
                entry[kind] = [float(data[kind].sel(output=output)) for output in OUTPUTS]
            result["runs"][f"{run}, {case}"] = entry
    return result


def main() -> None:
    path = Path(__file__).parents[2] / "data" / "reference" / "double_wishbone.json"
    path.write_text(json.dumps(current(), indent=1) + "\n")


if __name__ == "__main__":
    main()
