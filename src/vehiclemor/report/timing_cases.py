"""What is timed for each model: methods with settings, run on the nominal maneuver."""

from dataclasses import dataclass

from vehiclemor.models.report import TimingCase


@dataclass(frozen=True)
class CostTable:
    """Cases that are timed of one model, and how their table is printed.

    Attributes
    ----------
    baseline, strongest
        What the cases of these ids are, in words.
    errors
        Outputs whose RMS errors are printed beside the times.
    counts
        Counts that are printed: name -> heading.
    """

    cases: tuple[TimingCase, ...]
    baseline: str
    strongest: str
    errors: tuple[str, ...]
    counts: dict[str, str]


# Full-order integrators and replay, which are timed of every dynamic model.
DYNAMIC_BASELINES = (
    TimingCase("baseline", "full order, explicit", "full_order"),
    TimingCase("strongest", "full order, strongest", "full_order", "strongest"),
    TimingCase(
        "explicit_1e-3", "full order, explicit, 1e-3", "full_order", settings={"tolerance": 1e-3}
    ),
    TimingCase(
        "rodas4_1e-4",
        "full order, RODAS4, 1e-4",
        "full_order",
        settings={"solver": "rodas4", "tolerance": 1e-4},
    ),
    TimingCase("replay", "replay", "replay"),
)
DYNAMIC_NAMES = ("the explicit pair at 1e-6", "the W-method with one Jacobian")
DYNAMIC_COUNTS = {"rhs_calls": "RHS calls", "steps": "steps", "rejected_steps": "rejected"}
COST_TABLES = {
    "double_wishbone": CostTable(
        (
            TimingCase("baseline", "full order, Newton", "full_order"),
            TimingCase("strongest", "full order, strongest", "full_order", "strongest"),
            TimingCase(
                "dense", "full order, dense", "full_order", settings={"solver": "newton_dense"}
            ),
            TimingCase(
                "newton_1e-6",
                "full order, Newton, 1e-6",
                "full_order",
                settings={"tolerance": 1e-6},
            ),
            TimingCase("replay", "replay", "replay"),
            TimingCase("pod_r3", "pod r=3", "pod", settings={"rank": 3}),
            TimingCase(
                "pod_r3_1e-6", "pod r=3, 1e-6", "pod", settings={"rank": 3, "tolerance": 1e-6}
            ),
            TimingCase("pod_literal_r3", "pod literal r=3", "pod", "literal", {"rank": 3}),
            TimingCase("pod_r4", "pod r=4", "pod", settings={"rank": 4}),
            TimingCase("pod_literal_r6", "pod literal r=6", "pod", "literal", {"rank": 6}),
            TimingCase("fixed_basis_r3", "fixed basis r=3", "fixed_basis", settings={"rank": 3}),
            TimingCase("fixed_basis_r4", "fixed basis r=4", "fixed_basis", settings={"rank": 4}),
        ),
        "Newton with fresh Jacobians at 1e-12",
        "the strongest full-order solver",
        ("second_euler_angle",),
        {
            "iterations": "iterations",
            "residual_evaluations": "residuals",
            "jacobian_evaluations": "Jacobians",
        },
    ),
    "independent_suspension_vehicle": CostTable(
        (
            *DYNAMIC_BASELINES,
            TimingCase("pod_r3", "pod r=3", "pod", settings={"rank": 3}),
            TimingCase(
                "pod_r3_1e-4", "pod r=3, 1e-4", "pod", settings={"rank": 3, "tolerance": 1e-4}
            ),
            TimingCase("pod_r1", "pod r=1", "pod", settings={"rank": 1}),
            TimingCase(
                "pod_state_r3", "pod state r=3", "pod", settings={"rank": 3, "formulation": "state"}
            ),
            TimingCase("pod_literal_r3", "pod literal r=3", "pod", "literal", {"rank": 3}),
            TimingCase("fixed_basis_r3", "fixed basis r=3", "fixed_basis", settings={"rank": 3}),
        ),
        *DYNAMIC_NAMES,
        ("pitch", "yaw", "lateral_position"),
        DYNAMIC_COUNTS,
    ),
    "high_fidelity_vehicle": CostTable(
        (
            *DYNAMIC_BASELINES,
            TimingCase("pod_r1", "pod r=1", "pod", settings={"rank": 1}),
            TimingCase(
                "pod_r1_1e-4", "pod r=1, 1e-4", "pod", settings={"rank": 1, "tolerance": 1e-4}
            ),
            TimingCase("pod_r3", "pod r=3", "pod", settings={"rank": 3}),
            TimingCase(
                "pod_coordinates_r3",
                "pod coordinates r=3",
                "pod",
                settings={"rank": 3, "formulation": "coordinates"},
            ),
            TimingCase("pod_literal_r1", "pod literal r=1", "pod", "literal", {"rank": 1}),
            TimingCase("fixed_basis_r3", "fixed basis r=3", "fixed_basis", settings={"rank": 3}),
        ),
        *DYNAMIC_NAMES,
        ("lateral_speed", "vertical_speed", "lateral_position"),
        DYNAMIC_COUNTS,
    ),
}
