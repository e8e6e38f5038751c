"""The high-fidelity vehicle from positions and rotation matrices alone, in absolute terms.

Every body's position and rotation is a function of the 26 coordinates and the rack's position.
Along a path q + q1 t + q2 t^2 they are exact Taylor polynomials of degree 2 in t, computed by
polynomial arithmetic: unit paths give the Jacobians, the path of the motion gives velocities and
accelerations.  The loops' equations of motion are solved as one dense system.

Arrays of polynomials have their coefficients along the first axis and their paths along the
second one: 26 unit paths, then the motion.  SI units throughout.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np

from tests.oracles.high_fidelity_data import (
    AXLES,
    HOLDERS,
    PARAMETERS,
    WHEELS,
    Numbers,
    arm_axis,
    brush,
    fiala,
    front_points,
    masses_and_tensors,
    rear_points,
    tie_rod_length,
)
from tests.oracles.taylor import X, Y, Z, axial, euler_321, times, turned
from tests.oracles.vehicle_lagrange import Driven


def along(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Polynomial matrices times constant vectors."""
    return (matrix @ vector[..., None])[..., 0]


def about(pivot: np.ndarray, turn: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Where a turn about a pivot carries a point; all but the turn is constant."""
    moved = along(turn, point - pivot)
    moved[0] += pivot
    return moved


# kinematics


@dataclass
class Axle:
    """Places relative to the chassis along paths, in C-coordinates."""

    cgs: list[np.ndarray]  # (3, paths, 2, 3) of each kind of body
    turns: list[np.ndarray]  # (3, paths, 2, 3, 3)
    springs: np.ndarray  # from chassis to arm, (3, paths, 2, 3)
    loops: np.ndarray | None = None  # Phi, (3, paths, 12)


def paths(
    q: np.ndarray, qd: np.ndarray, s: float, sd: float, sdd: float
) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates (3, 27, 26) and rack positions (3, 27) along unit paths and the motion."""
    directions = np.vstack([np.eye(26), qd])
    coordinates = np.array([np.tile(q, (27, 1)), directions, 0 * directions])
    rack = np.zeros((3, 27))
    rack[0] = s
    rack[1:, -1] = sd, sdd / 2
    return coordinates, rack


def front_axle(path: np.ndarray, rack: np.ndarray, p: Numbers) -> Axle:
    """Upper arms, lower arms, carriers, tie rods and wheels."""
    at = front_points(p)
    corner = path[..., 6:20].reshape(*path.shape[:2], 2, 7)
    theta_u, theta_l, alpha, beta = np.moveaxis(corner[..., 3:], -1, 0)

    upper, lower = turned(arm_axis("upper", at), theta_u), turned(arm_axis("lower", at), theta_l)
    carrier = euler_321(corner[..., :3])
    rod = times(turned(Z, alpha), turned(X, beta))

    on_upper = partial(about, at["upper_pivot_rear"], upper)
    on_lower = partial(about, at["lower_pivot_rear"], lower)
    ball = on_upper(at["upper_ball"])

    def on_carrier(point: np.ndarray) -> np.ndarray:
        return ball + along(carrier, point - at["upper_ball"])

    outward = tie_rod_length(at) * np.array([Y, -Y])
    end = rack[..., None, None] * np.array([Y, Y])
    end[0] += at["rack_end"]
    loops = [
        on_carrier(at["lower_ball"]) - on_lower(at["lower_ball"]),
        on_carrier(at["tie_rod_outer"]) - (end + along(rod, outward)),
    ]
    springs = on_lower(at["spring_arm"])
    springs[0] -= at["spring_chassis"]
    return Axle(
        cgs=[
            on_upper(at["upper_arm_cg"]),
            on_lower(at["lower_arm_cg"]),
            on_carrier(at["upright_cg"]),
            end + along(rod, outward / 2),
            on_carrier(at["wheel_centre"]),
        ],
        turns=[upper, lower, carrier, rod, times(carrier, turned(Y, path[..., 22:24]))],
        springs=springs,
        # the left corner's six rows come before the right one's
        loops=np.concatenate(loops, axis=-1).reshape(*path.shape[:2], 12),
    )


def rear_axle(path: np.ndarray, p: Numbers) -> Axle:
    """Arms and wheels."""
    at = rear_points(p)
    arm = turned(Y, path[..., 20:22])
    on_arm = partial(about, at["pivot"], arm)
    springs = on_arm(at["spring_arm"])
    springs[0] -= at["spring_chassis"]
    return Axle(
        cgs=[on_arm(at["arm_cg"]), on_arm(at["wheel_centre"])],
        turns=[arm, times(arm, turned(Y, path[..., 24:26]))],
        springs=springs,
    )


class Instant:
    """The vehicle in a state: velocities, accelerations without qdd, and Jacobians of bodies."""

    def __init__(
        self,
        q: np.ndarray,
        qd: np.ndarray,
        s: float,
        sd: float,
        sdd: float,
        p: Numbers,
        driven: Driven | None = None,
    ) -> None:
        path, rack = paths(np.asarray(q), np.asarray(qd), s, sd, sdd)
        front, rear = front_axle(path, rack, p), rear_axle(path, p)
        self.p, self.spins, self.driven = p, np.asarray(qd)[22:], driven
        self.loops = front.loops
        self.springs = np.concatenate([front.springs, rear.springs], axis=2)
        self.masses, tensors = masses_and_tensors(p)

        chassis = euler_321(path[..., 3:6])[:, :, None]
        still, level = np.zeros((3, 27, 1, 3)), np.zeros((3, 27, 1, 3, 3))
        level[0] = np.eye(3)
        cgs = np.concatenate([still, *front.cgs, *rear.cgs], axis=2)
        turns = times(chassis, np.concatenate([level, *front.turns, *rear.turns], axis=2))
        cgs = path[..., None, :3] + times(chassis, cgs[..., None])[..., 0]

        self.places, self.turns = cgs[0, 0], turns[0, 0]  # (15, 3), (15, 3, 3)
        backward = np.swapaxes(self.turns, -1, -2)
        self.inertias = self.turns @ tensors @ backward
        rates = axial(turns[1] @ backward)
        self.moving, self.turning = cgs[1, :26], rates[:26]  # J, L as (26, 15, 3)
        self.v, self.w = cgs[1, 26], rates[26]
        self.v_dot, self.w_dot = 2 * cgs[2, 26], 2 * axial(turns[2, 26] @ backward)

    def mass_and_bias(self) -> tuple[np.ndarray, np.ndarray]:
        """M and h."""
        momenta = np.einsum("bxy,kby->kbx", self.inertias, self.turning)
        mass = np.einsum("b,kbx,lbx->kl", self.masses, self.moving, self.moving)
        mass = mass + np.einsum("kbx,lbx->kl", self.turning, momenta)
        force = self.masses[:, None] * self.v_dot
        torque = np.einsum("bxy,by->bx", self.inertias, self.w_dot)
        torque = torque + np.cross(self.w, np.einsum("bxy,by->bx", self.inertias, self.w))
        bias = np.einsum("kbx,bx->k", self.moving, force)
        return mass, bias + np.einsum("kbx,bx->k", self.turning, torque)

    def spring(self, number: int) -> tuple[float, float, np.ndarray]:
        """Length in m, its rate and its gradient (26,) of the spring at FL, FR, RL or RR."""
        line = self.springs[0, 0, number]
        length = np.linalg.norm(line)
        gradient = self.springs[1, :, number] @ line / length
        return length, gradient[26], gradient[:26]

    def tyres(self) -> list[dict[str, float | np.ndarray]]:
        """Kinematics, forces and moments of the tyres: FL, FR, RL, RR."""
        p, axis = self.p, self.turns[HOLDERS][:, :, 1]
        heading = np.cross(axis, Z)
        heading = heading / np.linalg.norm(heading, axis=1, keepdims=True)
        down = np.cross(axis, heading)
        cos_camber = -down @ Z
        driven = self.driven or Driven()
        road, road_rate, friction = (
            np.broadcast_to(values, 4)
            for values in (driven.road, driven.road_rate, driven.friction)
        )
        radii = (self.places[WHEELS][:, 2] - road) / cos_camber
        arms = radii[:, None] * down
        velocities = self.v[WHEELS] + np.cross(self.w[HOLDERS], arms)
        found = []
        for number, (r, velocity) in enumerate(zip(radii, velocities, strict=True)):
            frame = np.array([heading[number], np.cross(Z, heading[number]), Z])
            v_x, v_y, v_z = frame @ velocity
            elastic = p["tyre.vertical_stiffness"] * max(p["tyre.unloaded_radius"] - r, 0.0)
            rise = v_z - road_rate[number]
            damping = -p["tyre.vertical_damping"] * rise / cos_camber[number]
            fz = elastic + min(elastic, damping) if elastic + damping > 0 else 0.0
            bound = max(abs(v_x), p["tyre.v_low"])
            kappa, t = (self.spins[number] * r - v_x) / bound, v_y / bound
            if self.driven is None:
                fx, fy, mz = fiala(fz, kappa, t, p)
            else:
                fx, fy, mz = brush(friction[number], fz, kappa, t, p)
            force = np.array([fx, fy, fz]) @ frame
            torque = np.cross(arms[number], force) + mz * Z
            values = {"r": r, "V_x": v_x, "kappa": kappa, "t": t, "Fx": fx, "Fy": fy, "Fz": fz}
            found.append({**values, "Mz": mz, "force": force, "torque": torque})
        return found

    def applied_forces(self) -> np.ndarray:
        """Q."""
        p = self.p
        forces = -p["general.gravity"] * self.moving[..., 2] @ self.masses
        for number, axle in enumerate(AXLES):
            length, rate, gradient = self.spring(number)
            push = p[f"{axle}.spring.stiffness"] * (p[f"{axle}.spring.free_length"] - length)
            forces = forces + (push - p[f"{axle}.spring.damping"] * rate) * gradient
        for wheel, tyre in zip(WHEELS, self.tyres(), strict=True):
            forces = forces + self.moving[:, wheel] @ tyre["force"]
            forces = forces + self.turning[:, wheel] @ tyre["torque"]
        return forces if self.driven is None else forces + self.driven_forces(self.driven)

    def driven_forces(self, driven: Driven) -> np.ndarray:
        """Virtual work of half shafts from the chassis, of calipers on the carriers, of a push."""
        axes = self.turns[HOLDERS][:, :, 1]
        drive = np.broadcast_to(driven.drive, 4)
        forces = driven.push * self.moving[:, 0] @ self.turns[0][:, 0]
        for k, (wheel, holder) in enumerate(zip(WHEELS, HOLDERS, strict=True)):
            against = driven.torque(self.spins)[k] - drive[k]
            forces += (self.turning[:, wheel] - self.turning[:, 0]) @ axes[k] * drive[k]
            forces += (self.turning[:, wheel] - self.turning[:, holder]) @ axes[k] * against
        return forces


def stabilised(
    loops: np.ndarray, p: Numbers
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Phi, Phi', Phi_q and gamma from the constraints' polynomials (3, 27, 12)."""
    phi, rate, second = loops[0, 26], loops[1, 26], 2 * loops[2, 26]
    a, b = p["general.baumgarte_a"], p["general.baumgarte_b"]
    return phi, rate, loops[1, :26].T, -second - 2 * a * rate - b**2 * phi


def accelerations(
    q: np.ndarray,
    qd: np.ndarray,
    s: float,
    sd: float,
    sdd: float,
    p: Numbers = PARAMETERS,
    driven: Driven | None = None,
) -> np.ndarray:
    """The second derivative qdd (26,) of the coordinates."""
    now = Instant(q, qd, s, sd, sdd, p, driven)
    mass, bias = now.mass_and_bias()
    _, _, jacobian, gamma = stabilised(now.loops, p)
    system = np.block([[mass, -jacobian.T], [jacobian, np.zeros((12, 12))]])
    return np.linalg.solve(system, np.concatenate([now.applied_forces() - bias, gamma]))[:26]


def energy(q: np.ndarray, qd: np.ndarray, s: float, sd: float, p: Numbers = PARAMETERS) -> float:
    """Kinetic energy and the potential of gravity and springs in J, without the tyres'."""
    now = Instant(q, qd, s, sd, 0.0, p)
    kinetic = now.masses @ np.sum(now.v**2, axis=1) / 2
    kinetic += np.einsum("bx,bxy,by->", now.w, now.inertias, now.w) / 2
    stored = p["general.gravity"] * now.masses @ now.places[:, 2]
    for number, axle in enumerate(AXLES):
        squeezed = p[f"{axle}.spring.free_length"] - now.spring(number)[0]
        stored += p[f"{axle}.spring.stiffness"] * squeezed**2 / 2
    return kinetic + stored
