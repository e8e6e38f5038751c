"""High-fidelity vehicle: 26 coordinates, 12 constraints (DAE), Fiala tires, prescribed rack.

Masoudi, Uchida, McPhee (2015), section 3.3 and figure 8: double-wishbone front suspension and
trailing-arm rear suspension.   Axes: ISO 8855, road z = 0.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from vehiclemor.multibody.definition import ModelDefinition
from vehiclemor.multibody.high_fidelity.equilibrium import (
    DECLARED,
    SOLVED,
    check,
    solve_equilibrium,
    starts,
)
from vehiclemor.multibody.quantities import FORWARD, TIRE_LOADS, UPRIGHT, WHEELS

if TYPE_CHECKING:
    from vehiclemor.symbolic.program import Program


def derive() -> Program:
    """Derive accelerations, outputs, and the unsolved descriptor form; parameters stay symbols."""
    from vehiclemor.multibody.high_fidelity import equations

    return equations.derive()


STATES = [q.name for q in (*DECLARED["coordinates"], *DECLARED["speeds"])]
DEFINITION = ModelDefinition(
    name="high_fidelity_vehicle",
    kind="dae",
    summary="vehicle with 26 coordinates and 12 constraints, double wishbones, Fiala tires (DAE)",
    maneuver="rack_lane_change",
    **DECLARED,
    derive=derive,
    check=check,
    starts=starts,
    solved=SOLVED,
    solve_equilibrium=solve_equilibrium,
    cyclic=("x", "y", *(f"gamma_{wheel}" for wheel in WHEELS)),
    planar=("x", "y", "psi"),
    heading_pairs=(("x", "y"), ("x_dot", "y_dot")),
    # A heading that is off integrates to a lateral position that is off: no other error matters
    # as much.
    error_scale=dict.fromkeys(STATES, 10.0) | {"psi": 1.0, "psi_dot": 1.0},
    # Slips need forward motion.  At 1.3 rad of steering the linkage locks; another branch lies
    # beyond.
    validity={
        "longitudinal_speed": FORWARD,
        **{f"steer_{wheel}": (-1.1, 1.1) for wheel in WHEELS[:2]},
        **UPRIGHT,
    },
    loads=TIRE_LOADS,
    tabled_outputs=(
        "lateral_speed",
        "vertical_speed",
        "lateral_position",
        "yaw",
        "roll",
        "position_drift",
        "velocity_drift",
    ),
)
