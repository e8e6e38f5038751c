"""What is timed for each model: methods with settings, run on the nominal maneuver."""

from dataclasses import dataclass, field

from vehiclemor.reduction.settings import Value


@dataclass(frozen=True)
class Contestant:
    """One line of a timing table: a method with settings, run on the nominal maneuver."""

    label: str
    method: str
    preset: str = "recommended"
    settings: dict[str, Value] = field(default_factory=dict)


@dataclass(frozen=True)
class Race:
    """Contestants of one model, and how their table is printed.

    Attributes
    ----------
    contestants
        The first is the paper's kind of baseline, the second the strongest full-order solver.
    baseline, strongest
        What these two are, in words.
    errors
        Outputs whose RMS errors are printed beside the times.
    counts
        Counts that are printed: name -> heading.
    """

    contestants: tuple[Contestant, ...]
    baseline: str
    strongest: str
    errors: tuple[str, ...]
    counts: dict[str, str]


# Full-order integrators and replay, which stand in the race of every dynamic model.
DYNAMIC_BASELINES = (
    Contestant("full order, explicit", "full_order"),
    Contestant("full order, strongest", "full_order", "strongest"),
    Contestant("full order, explicit, 1e-3", "full_order", settings={"tolerance": 1e-3}),
    Contestant(
        "full order, RODAS4, 1e-4",
        "full_order",
        settings={"solver": "rodas4", "tolerance": 1e-4},
    ),
    Contestant("replay", "replay"),
)
DYNAMIC_NAMES = ("the explicit pair at 1e-6", "the W-method with one Jacobian")
DYNAMIC_COUNTS = {"rhs_calls": "RHS calls", "steps": "steps", "rejected_steps": "rejected"}
RACES = {
    "double_wishbone": Race(
        (
            Contestant("full order, Newton", "full_order"),
            Contestant("full order, strongest", "full_order", "strongest"),
            Contestant("full order, dense", "full_order", settings={"solver": "newton_dense"}),
            Contestant("full order, Newton, 1e-6", "full_order", settings={"tolerance": 1e-6}),
            Contestant("replay", "replay"),
            Contestant("pod r=3", "pod", settings={"rank": 3}),
            Contestant("pod r=3, 1e-6", "pod", settings={"rank": 3, "tolerance": 1e-6}),
            Contestant("pod literal r=3", "pod", "literal", {"rank": 3}),
            Contestant("pod r=4", "pod", settings={"rank": 4}),
            Contestant("pod literal r=6", "pod", "literal", {"rank": 6}),
            Contestant("fixed basis r=3", "fixed_basis", settings={"rank": 3}),
            Contestant("fixed basis r=4", "fixed_basis", settings={"rank": 4}),
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
    "independent_suspension_vehicle": Race(
        (
            *DYNAMIC_BASELINES,
            Contestant("pod r=3", "pod", settings={"rank": 3}),
            Contestant("pod r=3, 1e-4", "pod", settings={"rank": 3, "tolerance": 1e-4}),
            Contestant("pod r=1", "pod", settings={"rank": 1}),
            Contestant("pod state r=3", "pod", settings={"rank": 3, "formulation": "state"}),
            Contestant("pod literal r=3", "pod", "literal", {"rank": 3}),
            Contestant("fixed basis r=3", "fixed_basis", settings={"rank": 3}),
        ),
        *DYNAMIC_NAMES,
        ("pitch", "yaw", "lateral_position"),
        DYNAMIC_COUNTS,
    ),
    "high_fidelity_vehicle": Race(
        (
            *DYNAMIC_BASELINES,
            Contestant("pod r=1", "pod", settings={"rank": 1}),
            Contestant("pod r=1, 1e-4", "pod", settings={"rank": 1, "tolerance": 1e-4}),
            Contestant("pod r=3", "pod", settings={"rank": 3}),
            Contestant(
                "pod coordinates r=3", "pod", settings={"rank": 3, "formulation": "coordinates"}
            ),
            Contestant("pod literal r=1", "pod", "literal", {"rank": 1}),
            Contestant("fixed basis r=3", "fixed_basis", settings={"rank": 3}),
        ),
        *DYNAMIC_NAMES,
        ("lateral_speed", "vertical_speed", "lateral_position"),
        DYNAMIC_COUNTS,
    ),
}
