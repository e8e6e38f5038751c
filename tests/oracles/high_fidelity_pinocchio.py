"""The high-fidelity vehicle's open tree of bodies, computed by Pinocchio.

Pinocchio's composite bodies and recursive Newton-Euler know nothing of the constraints, springs
and tyres.  Two kinds of joints of its tree are not coordinates of the vehicle:

- the carrier hangs on the upper arm but is oriented relative to the chassis, so a joint between
  them undoes the arm's rotation: its angle is -theta_u;
- each tie rod stands on a massless slide, whose position is the rack's.

All joints of the tree are linear in the coordinates and the rack's position, so a constant
matrix converts between both, and derivatives need no further terms.
"""

from typing import Any

import numpy as np

from tests.oracles.high_fidelity_data import (
    BODIES,
    COORDINATES,
    PARAMETERS,
    Numbers,
    arm_axis,
    front_points,
    masses_and_tensors,
    rear_points,
    tie_rod_length,
)

CHASSIS = (("x", "PX"), ("y", "PY"), ("z", "PZ"), ("psi", "RZ"), ("theta", "RY"), ("phi", "RX"))


def tree(p: Numbers = PARAMETERS) -> tuple[Any, np.ndarray]:
    """Pinocchio's model without gravity, and the matrix from (q, s) (27,) to its joints (30,)."""
    import pinocchio as pin

    model = pin.Model()
    model.gravity = pin.Motion.Zero()
    masses, tensors = masses_and_tensors(p)

    def joint(parent: int, kind: str | np.ndarray, name: str, place: np.ndarray) -> int:
        """Add a joint at a place in its parent's axes, all joints being at zero."""
        if isinstance(kind, str):
            motion = getattr(pin, f"JointModel{kind}")()
        else:
            motion = pin.JointModelRevoluteUnaligned(kind)
        return model.addJoint(parent, motion, pin.SE3(np.eye(3), place), name)

    def body(parent: int, name: str, cg: np.ndarray) -> None:
        """Attach a body whose axes are the joint's."""
        k = BODIES.index(name)
        inertia = pin.Inertia(masses[k], cg, tensors[k])
        model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())

    origin, chassis = np.zeros(3), 0
    for name, kind in CHASSIS:
        chassis = joint(chassis, kind, name, origin)
    body(chassis, "chassis", origin)

    for side, corner in enumerate(("FL", "FR")):
        at = {name: point[side] for name, point in front_points(p).items()}
        for arm in ("lower", "upper"):  # the upper one comes last: the carrier hangs on it
            pivot, axis = at[f"{arm}_pivot_rear"], arm_axis(arm, front_points(p))[side]
            held = joint(chassis, axis, f"theta_{arm[0]}_{corner}", pivot)
            body(held, f"{arm}_arm_{corner}", at[f"{arm}_arm_cg"] - pivot)
        held = joint(held, axis, f"undone_{corner}", at["upper_ball"] - pivot)
        for name, kind in (("zeta", "RZ"), ("eta", "RY"), ("xi", "RX")):
            held = joint(held, kind, f"{name}_{corner}", origin)
        body(held, f"carrier_{corner}", at["upright_cg"] - at["upper_ball"])
        held = joint(held, "RY", f"spin_{corner}", at["wheel_centre"] - at["upper_ball"])
        body(held, f"wheel_{corner}", origin)

        held = joint(chassis, "PY", f"rack_{corner}", at["rack_end"])
        held = joint(held, "RZ", f"alpha_{corner}", origin)
        held = joint(held, "RX", f"beta_{corner}", origin)
        outward = tie_rod_length(front_points(p)) * np.array([0.0, 1.0 - 2.0 * side, 0.0])
        body(held, f"tie_rod_{corner}", outward / 2)

    for side, corner in enumerate(("RL", "RR")):
        at = {name: point[side] for name, point in rear_points(p).items()}
        held = joint(chassis, "RY", f"a_{corner}", at["pivot"])
        body(held, f"arm_{corner}", at["arm_cg"] - at["pivot"])
        held = joint(held, "RY", f"spin_{corner}", at["wheel_centre"] - at["pivot"])
        body(held, f"wheel_{corner}", origin)

    return model, conversion(model)


def conversion(model: Any) -> np.ndarray:
    """The tree's joint positions (30,) by (q, s) (27,).  Pinocchio numbers joints depth-first."""
    matrix = np.zeros((model.nq, 27))
    for name in list(model.names)[1:]:  # the first is the world
        row = model.joints[model.getJointId(name)].idx_q
        if name.startswith("rack"):
            matrix[row, 26] = 1.0
        elif name.startswith("undone"):
            matrix[row, COORDINATES.index(name.replace("undone", "theta_u"))] = -1.0
        else:
            matrix[row, COORDINATES.index(name)] = 1.0
    return matrix


def mass_and_bias(
    q: np.ndarray, qd: np.ndarray, s: float, sd: float, sdd: float, p: Numbers = PARAMETERS
) -> tuple[np.ndarray, np.ndarray]:
    """M (26, 26) and h (26,) of the open loops, with the rack's motion, without gravity."""
    import pinocchio as pin

    model, matrix = tree(p)
    joints, rates = matrix @ [*q, s], matrix @ [*qd, sd]
    second = matrix[:, 26] * sdd  # qdd = 0
    mass = np.triu(pin.crba(model, model.createData(), joints))  # its lower part may be left empty
    mass = mass + np.triu(mass, 1).T
    bias = pin.rnea(model, model.createData(), joints, rates, second)
    coordinates = matrix[:, :26]
    return coordinates.T @ mass @ coordinates, coordinates.T @ bias
