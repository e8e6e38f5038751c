"""The 14-DOF vehicle by d'Alembert's principle from positions and rotation matrices alone.

Every body's position and rotation is a function of the 14 coordinates.  Along a path
q + q1 t + q2 t^2 they are exact Taylor polynomials of degree 2 in t, computed by polynomial
arithmetic: unit paths give the Jacobians, the path of the motion gives velocities and
accelerations.  Rotational inertia is the second moment of a body's mass, so no angular momentum,
gyroscopic term or Euler rate is written down.  Everything is analytic: states may be complex.
"""

from dataclasses import dataclass

import numpy as np

from tests.oracles.taylor import Y, Z, axial, euler_321, times, turned
from tests.oracles.vehicle_data import (
    PARAMETERS,
    Numbers,
    derived,
    lane_change,
    magic_formula,
    per_wheel,
    single_track_yaw_gain,
)

__all__ = [
    "PARAMETERS",
    "accelerations",
    "derived",
    "dropped",
    "energy",
    "equilibrium",
    "jacobian",
    "kinetic_matrix",
    "lane_change",
    "mirror",
    "power",
    "single_track_yaw_gain",
    "tire_forces",
]


@dataclass
class Placement:
    """Taylor coefficients of all bodies' places along paths."""

    cg: np.ndarray  # (3, paths, 3)
    chassis: np.ndarray  # (3, paths, 3, 3)
    centres: np.ndarray  # (3, paths, 4, 3)
    wheels: np.ndarray  # (3, paths, 4, 3, 3)


def place(q: np.ndarray, directions: np.ndarray, delta: complex, p: Numbers) -> Placement:
    """Positions and rotations along the paths q + directions t."""
    d = derived(p)
    path = np.array([np.broadcast_to(q, directions.shape), directions, 0 * directions])
    cg = path[..., :3]
    chassis = euler_321(path[..., 3:6])
    attached = np.zeros((*path.shape[:2], 4, 3), dtype=path.dtype)
    attached[0, ..., 0] = [d["a_s"]] * 2 + [-d["b_s"]] * 2
    attached[0, ..., 1] = per_wheel(p, "T") / 2 * [1, -1, 1, -1]
    attached[0, ..., 2] = -per_wheel(d, "h")
    attached[..., 2] += path[..., 6:10]
    carried = times(attached, np.swapaxes(chassis, -1, -2))
    steer = np.zeros((*path.shape[:2], 4), dtype=np.result_type(path, delta))
    steer[0, :, :2] = delta
    wheels = times(chassis[..., None, :, :], turned(Z, steer))
    wheels = times(wheels, turned(Y, path[..., 10:14]))
    return Placement(cg, chassis, cg[..., None, :] + carried, wheels)


def second_moments(p: Numbers) -> tuple[np.ndarray, np.ndarray]:
    """Second moments of the mass of the sprung body and of a wheel, whose axis is y."""
    inertia = np.diag([p["Ixx"], p["Iyy"], derived(p)["Izz"]])
    inertia[0, 2] = inertia[2, 0] = -p["Ixz"]
    wheel = np.diag([p["Id"], p["Is"], p["Id"]])
    eye = np.eye(3)
    return np.trace(inertia) / 2 * eye - inertia, np.trace(wheel) / 2 * eye - wheel


def inner(a: Placement, i: int, b: Placement, j: int, p: Numbers) -> np.ndarray:
    """Mass-weighted inner products (paths of a, paths of b) of Taylor coefficients i and j."""
    sprung, wheel = second_moments(p)
    return (
        p["m_s"] * np.einsum("ax,bx->ab", a.cg[i], b.cg[j])
        + p["m_u"] * np.einsum("awx,bwx->ab", a.centres[i], b.centres[j])
        + np.einsum("axy,yz,bxz->ab", a.chassis[i], sprung, b.chassis[j])
        + np.einsum("awxy,yz,bwxz->ab", a.wheels[i], wheel, b.wheels[j])
    )


class Instant:
    """A vehicle in a state: Jacobians, the coordinates' rates and the tyres' contact."""

    def __init__(self, x: np.ndarray, delta: complex, p: Numbers) -> None:
        q, nu = x[:14], x[14:]
        self.p, self.z, self.z_dot, self.nu = p, q[6:10], nu[6:10], nu
        eye = np.eye(14, dtype=np.result_type(x, float))
        self.units = place(q, eye, delta, p)
        self.frame = self.units.chassis[0, 0]
        self.speeds = self.quasi_speeds(self.units, 1)  # d(nu)/d(qdot)
        self.q_dot = np.linalg.solve(self.speeds, nu)
        self.path = place(q, self.q_dot[None], delta, p)
        self.height = self.units.centres[0, 0, :, 2]

        # the material point of every wheel on the road vertically below its centre
        arm = np.stack([0 * self.height, 0 * self.height, -self.height], axis=-1)
        rotation = self.units.wheels[0, 0]
        arm_in_wheel = np.einsum("wyx,wy->wx", rotation, arm)
        self.contact = self.units.centres[1] + np.einsum(
            "awxy,wy->awx", self.units.wheels[1], arm_in_wheel
        )  # d(velocity)/d(qdot), (14, 4, 3)
        self.turning = axial(np.einsum("awxy,wzy->awxz", self.units.wheels[1], rotation))[..., 2]
        axis = rotation[..., 1]
        length = np.sqrt(axis[:, 0] ** 2 + axis[:, 1] ** 2)
        self.forward = np.stack([axis[:, 1], -axis[:, 0], 0 * length], axis=-1) / length[:, None]
        self.sideward = np.stack([axis[:, 0], axis[:, 1], 0 * length], axis=-1) / length[:, None]

        sliding = np.einsum("awx,a->wx", self.contact, self.q_dot)
        centre_velocity = self.path.centres[1, 0]
        self.slide_x = np.sum(self.forward * sliding, axis=-1)
        self.slide_y = np.sum(self.sideward * sliding, axis=-1)
        rolling = np.sqrt(np.sum(self.forward * centre_velocity, axis=-1) ** 2 + p["v0"] ** 2)
        self.kappa, self.alpha = -self.slide_x / rolling, np.arctan(self.slide_y / rolling)
        load = p["kt"] * (p["R0"] - self.height) - p["ct"] * centre_velocity[:, 2]
        self.touches = load.real > 0
        self.load = np.where(self.touches, load, 0.0)

    def quasi_speeds(self, places: Placement, order: int) -> np.ndarray:
        """Chassis components (14, paths) of velocities at order 1; half their rates at order 2.

        At order 2 this is for straight paths in q, and only the part that is not in q's rates.
        """
        frame, moved = self.frame, places.chassis[order]
        linear = places.cg[order] @ frame
        if order == 2:  # d/dt (R^T v) = R^T a + dR^T/dt v
            linear = linear + np.einsum("ayx,ay->ax", places.chassis[1], places.cg[1]) / 2
        joints = 0 if order == 2 else np.eye(14)[:, 6:]
        angular = axial(np.einsum("yx,ayz->axz", frame, moved))
        return np.hstack([linear, angular, np.zeros((len(linear), 8)) + joints]).T

    def shear_forces(self, shear: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Fx, Fy, Mz."""
        if not shear:
            return 0 * self.load, 0 * self.load, 0 * self.load
        regular = np.where(self.touches, self.load, self.p["FNOMIN"])
        forces = magic_formula(regular, self.kappa, self.alpha, self.p)
        return tuple(np.where(self.touches, force, 0.0) for force in forces)

    def applied(self, dampers: bool, shear: bool) -> np.ndarray:
        """Generalised forces (14,): virtual work over virtual displacement."""
        p, d = self.p, derived(self.p)
        fx, fy, mz = self.shear_forces(shear)
        weight = np.full(4, p["m_u"] * p["g"])
        force = fx[:, None] * self.forward + fy[:, None] * self.sideward
        force = force + np.outer(self.load, [0, 0, 1])
        q = np.einsum("awx,wx->a", self.contact, force) + self.turning @ mz
        q -= self.units.centres[1, ..., 2] @ weight
        q -= p["m_s"] * p["g"] * self.units.cg[1, :, 2]
        q[6:10] -= per_wheel(d, "S0") + per_wheel(p, "k") * self.z
        if dampers:
            q[6:10] -= per_wheel(p, "c") * self.z_dot
        return q


def accelerations(
    x: np.ndarray,
    delta: complex,
    p: Numbers = PARAMETERS,
    *,
    dampers: bool = True,
    shear: bool = True,
) -> np.ndarray:
    """Derivative (28,) of a real or complex state (q, nu), with the steering angle held."""
    now = Instant(np.asarray(x), delta, p)
    mass = inner(now.units, 1, now.units, 1, p)
    bias = 2 * inner(now.units, 1, now.path, 2, p)[:, 0]
    q_second = np.linalg.solve(mass, now.applied(dampers, shear) - bias)
    nu_dot = now.speeds @ q_second + 2 * now.quasi_speeds(now.path, 2)[:, 0]
    return np.concatenate([now.q_dot, nu_dot])


def kinetic_matrix(x: np.ndarray, delta: complex, p: Numbers = PARAMETERS) -> np.ndarray:
    """Mass matrix (14, 14) in the quasi-speeds nu."""
    now = Instant(np.asarray(x), delta, p)
    to_rates = np.linalg.inv(now.speeds)
    return to_rates.T @ inner(now.units, 1, now.units, 1, p) @ to_rates


def jacobian(x: np.ndarray, delta: float, p: Numbers = PARAMETERS, **parts: bool) -> np.ndarray:
    """d(xdot)/dx (28, 28) by complex step."""
    steps = 1e-30j * np.eye(28)
    columns = [accelerations(x + step, delta, p, **parts).imag / 1e-30 for step in steps]
    return np.array(columns).T


def tire_forces(x: np.ndarray, delta: complex, p: Numbers = PARAMETERS) -> dict[str, np.ndarray]:
    """Forces, slips and centre heights of the four wheels."""
    now = Instant(np.asarray(x), delta, p)
    fx, fy, mz = now.shear_forces(shear=True)
    slips = {"kappa": now.kappa, "alpha": now.alpha, "zc": now.height}
    return {"Fx": fx, "Fy": fy, "Fz": now.load, "Mz": mz, **slips}


def energy(x: np.ndarray, p: Numbers = PARAMETERS, delta: float = 0.0) -> float:
    """Kinetic and potential energy."""
    now, d = Instant(np.asarray(x), delta, p), derived(p)
    kinetic = inner(now.path, 1, now.path, 1, p)[0, 0] / 2
    potential = p["m_s"] * p["g"] * x[2] + np.sum(
        p["m_u"] * p["g"] * now.height
        + per_wheel(d, "S0") * now.z
        + per_wheel(p, "k") * now.z**2 / 2
        + p["kt"] * np.maximum(0, p["R0"] - now.height) ** 2 / 2
    )
    return kinetic + potential


def power(
    x: np.ndarray,
    delta: float,
    p: Numbers = PARAMETERS,
    *,
    dampers: bool = True,
    shear: bool = True,
) -> float:
    """Rate of the energy while the steering angle is held (without damping of the tyres)."""
    now = Instant(np.asarray(x), delta, p)
    fx, fy, mz = now.shear_forces(shear)
    turning = now.q_dot @ now.turning
    lost = dampers * per_wheel(p, "c") * now.z_dot**2
    return np.sum(fx * now.slide_x + fy * now.slide_y + mz * turning - lost)


def mirror(x: np.ndarray) -> np.ndarray:
    """The mirrored state, or derivative of a state; steering angles change their sign with it."""
    coordinates = [1, -1, 1, -1, 1, -1]
    speeds = [1, -1, 1, -1, 1, -1]
    swapped = [1, 0, 3, 2]
    mirrored = np.array(x)
    mirrored[:6] *= coordinates
    mirrored[14:20] *= speeds
    for start in (6, 10, 20, 24):
        mirrored[start : start + 4] = mirrored[start : start + 4][swapped]
    return mirrored


def equilibrium(p: Numbers = PARAMETERS) -> np.ndarray:
    """Straight running."""
    x = np.zeros(28)
    x[2], x[14] = p["h_s"], p["speed"]
    x[24:] = p["speed"] / per_wheel(derived(p), "zc")
    return x


def dropped(p: Numbers = PARAMETERS) -> np.ndarray:
    """Straight running, lifted and pitched; the CG's velocity stays horizontal."""
    x = equilibrium(p)
    x[2], x[4] = p["h_s"] + p["drop_height"], p["drop_pitch"]
    x[14], x[16] = p["speed"] * np.cos(x[4]), p["speed"] * np.sin(x[4])
    return x
