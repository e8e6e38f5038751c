"""The 14-DOF vehicle by d'Alembert's principle from positions and rotation matrices alone.

Every body's position and rotation is a function of the 14 coordinates.  Along a path
q + q1 t + q2 t^2 they are exact Taylor polynomials of degree 2 in t, computed by polynomial
arithmetic: unit paths give the Jacobians, the path of the motion gives velocities and
accelerations.  Rotational inertia is the second moment of a body's mass, so no angular momentum,
gyroscopic term or Euler rate is written down.  Everything is analytic: states may be complex.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from tests.oracles.taylor import Y, Z, axial, euler_321, times, turned

Numbers = Mapping[str, float]

# Vehicle, manoeuvre and tyre, in SI units; an unsprung mass is half that of an axle.
TEXT = """
g=9.81 m_s=965.7108098804363 m_u=31.8960913028392 Ixx=207.26524557936952 Iyy=1565.8178787125541
Ixz=0.0 Izz_whole_car=1791.5995300122856 a=1.1561957064 b=1.4227170936 T_f=1.38684 T_r=1.36398
h_s=0.61373004 k_f=24453.137879749014 k_r=19635.504745231297 c_f=1786.2441002440723
c_r=1649.0833034887382 R0=0.344 kt=158294.1398119115 ct=0.0 Is=1.7 Id=0.85 v0=0.1
speed=20.0 duration=25.0 t0=1.0 T=2.5 A=0.0300768 drop_height=0.03 drop_pitch=0.015
FNOMIN=4850.0 LFZO=0.81 PCX1=1.6411 PDX1=1.1739 PDX2=-0.16395 PEX1=0.46403 PEX2=0.25022
PEX3=0.067842 PKX1=22.303 PKX2=0.48896 PKX3=0.21253 PCY1=1.3507 PDY1=1.0489 PDY2=-0.18033
PEY1=-0.0074722 PEY2=-0.0063208 PKY1=-21.92 PKY2=2.0012 QBZ1=10.904 QBZ2=-1.8412 QBZ3=-0.52041
QCZ1=1.2136 QDZ1=0.093509 QDZ2=-0.0092183 QEZ1=-1.5697 QEZ2=0.33394 QEZ3=0.0 RBX1=13.276
RBX2=-13.778 RCX1=1.2568 REX1=0.65225 RBY1=7.1433 RBY2=9.1916 RCY1=1.0719 REY1=-0.27572
"""
PARAMETERS = {name: float(value) for name, value in (word.split("=") for word in TEXT.split())}


def derived(p: Numbers = PARAMETERS) -> dict[str, float]:
    """Numbers that follow from the primary ones; the static state is a level chassis."""
    m, wheelbase = p["m_s"] + 4 * p["m_u"], p["a"] + p["b"]
    a_s = (m * p["a"] - 2 * p["m_u"] * wheelbase) / p["m_s"]
    about_total = (
        2 * p["m_u"] * (p["a"] ** 2 + p["T_f"] ** 2 / 4)
        + 2 * p["m_u"] * (p["b"] ** 2 + p["T_r"] ** 2 / 4)
        + 4 * p["Id"]
        + p["m_s"] * (p["a"] - a_s) ** 2
    )
    d = {
        "m": m,
        "a_s": a_s,
        "b_s": wheelbase - a_s,
        "Izz": p["Izz_whole_car"] - about_total,
        "Fz0": p["FNOMIN"] * p["LFZO"],
    }
    for axle, lever in (("f", p["b"]), ("r", p["a"])):
        load = m * p["g"] * lever / (2 * wheelbase)
        d[f"Fz_{axle}"] = load
        d[f"S0_{axle}"] = load - p["m_u"] * p["g"]
        d[f"zc_{axle}"] = p["R0"] - load / p["kt"]
        d[f"h_{axle}"] = p["h_s"] - d[f"zc_{axle}"]
    d["h_total"] = (p["m_s"] * p["h_s"] + 2 * p["m_u"] * (d["zc_f"] + d["zc_r"])) / m
    return d


def per_wheel(p: Numbers, name: str) -> np.ndarray:
    """An axle's number at the wheels FL, FR, RL, RR."""
    return np.array([p[f"{name}_f"]] * 2 + [p[f"{name}_r"]] * 2)


def lane_change(
    t: float, amplitude: float = 1.0, frequency: float = 1.0, p: Numbers = PARAMETERS
) -> float:
    """Steering angle at time t."""
    tau = (t - p["t0"]) * frequency / p["T"]
    if not 0 <= tau <= 1:
        return 0.0
    return amplitude * p["A"] * (np.sin(2 * np.pi * tau) - np.sin(4 * np.pi * tau) / 2)


def curved(b: np.ndarray | float, e: np.ndarray | float, x: np.ndarray) -> np.ndarray:
    """The angle that the magic formula takes sine or cosine of, before its shape factor."""
    return np.arctan(b * x - e * (b * x - np.arctan(b * x)))


def cornering_stiffness(load: np.ndarray, p: Numbers) -> np.ndarray:
    """dFy/dalpha without slip: negative."""
    nominal = p["FNOMIN"] * p["LFZO"]
    return p["PKY1"] * nominal * np.sin(2 * np.arctan(load / (p["PKY2"] * nominal)))


def trail_at_rest(load: np.ndarray, p: Numbers) -> np.ndarray:
    """Pneumatic trail without side slip."""
    nominal = p["FNOMIN"] * p["LFZO"]
    return load * p["R0"] / nominal * (p["QDZ1"] + p["QDZ2"] * (load - nominal) / nominal)


def magic_formula(
    load: np.ndarray, kappa: np.ndarray, alpha: np.ndarray, p: Numbers = PARAMETERS
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fx, Fy and Mz at positive loads."""
    nominal = p["FNOMIN"] * p["LFZO"]
    d = (load - nominal) / nominal

    peak = (p["PDX1"] + p["PDX2"] * d) * load
    bend = p["PEX1"] + p["PEX2"] * d + p["PEX3"] * d**2
    slope = load * (p["PKX1"] + p["PKX2"] * d) * np.exp(p["PKX3"] * d)
    pure_x = peak * np.sin(p["PCX1"] * curved(slope / (p["PCX1"] * peak), bend, kappa))
    weight = p["RBX1"] * np.cos(np.arctan(p["RBX2"] * kappa))
    fx = pure_x * np.cos(p["RCX1"] * curved(weight, p["REX1"], alpha))

    peak = (p["PDY1"] + p["PDY2"] * d) * load
    bend = p["PEY1"] + p["PEY2"] * d
    slope = cornering_stiffness(load, p)
    pure_y = peak * np.sin(p["PCY1"] * curved(slope / (p["PCY1"] * peak), bend, alpha))
    weight = p["RBY1"] * np.cos(np.arctan(p["RBY2"] * alpha))
    fy = pure_y * np.cos(p["RCY1"] * curved(weight, p["REY1"], kappa))

    stiff = p["QBZ1"] + p["QBZ2"] * d + p["QBZ3"] * d**2
    bend = p["QEZ1"] + p["QEZ2"] * d + p["QEZ3"] * d**2
    trail = trail_at_rest(load, p) * np.cos(p["QCZ1"] * curved(stiff, bend, alpha)) * np.cos(alpha)
    return fx, fy, -trail * fy


def magic_formula_on(
    friction: np.ndarray, load: np.ndarray, kappa: np.ndarray, alpha: np.ndarray, p: Numbers
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fx, Fy and Mz by similarity; the cosine of the trail is that of the slip angle itself."""
    fx, fy, mz = magic_formula(load, kappa / friction, alpha / friction, p)
    turn = np.cos(alpha) / np.cos(alpha / friction)
    return friction * fx, friction * fy, friction * turn * mz


def single_track_yaw_gain(p: Numbers = PARAMETERS, speed: float = 20.0) -> float:
    """Steady r/delta of the linear single-track car: static stiffnesses and pneumatic trails.

    An axle's force acts its trail behind the axle; the slip angle is regularised as the tyre's.
    """
    d = derived(p)
    lever = np.array([p["a"], -p["b"]])
    load = np.array([d["Fz_f"], d["Fz_r"]])
    stiffness, trail = 2 * cornering_stiffness(load, p), trail_at_rest(load, p)
    slip = np.array([np.ones(2), lever]).T / np.hypot(speed, p["v0"])  # by lateral speed, yaw rate
    steered = np.array([-speed / np.hypot(speed, p["v0"]), 0.0])
    loads = np.array([stiffness, (lever - trail) * stiffness])  # force and moment by slip angle
    balance = loads @ slip - np.array([[0.0, d["m"] * speed], [0.0, 0.0]])
    return np.linalg.solve(balance, -loads @ steered)[1]


# Mechanics


@dataclass
class Driven:
    """What drives and carries the vehicle; arrays are of the wheels FL, FR, RL, RR."""

    drive: np.ndarray | float = 0.0
    brake: np.ndarray | float = 0.0
    friction: np.ndarray | float = 1.0
    road: np.ndarray | float = 0.0
    road_rate: np.ndarray | float = 0.0
    push: float = 0.0  # along the chassis at the sprung centre

    def torque(self, spin: np.ndarray) -> np.ndarray:
        """Torque on the wheels about their axes."""
        return self.drive - self.brake * spin / np.sqrt(1.0 + spin**2)


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

    def __init__(
        self, x: np.ndarray, delta: complex, p: Numbers, driven: Driven | None = None
    ) -> None:
        q, nu, self.driven = x[:14], x[14:], driven or Driven()
        self.p, self.z, self.z_dot, self.nu = p, q[6:10], nu[6:10], nu
        eye = np.eye(14, dtype=np.result_type(x, float))
        self.units = place(q, eye, delta, p)
        self.frame = self.units.chassis[0, 0]
        self.speeds = self.quasi_speeds(self.units, 1)  # d(nu)/d(qdot)
        self.q_dot = np.linalg.solve(self.speeds, nu)
        self.path = place(q, self.q_dot[None], delta, p)
        self.height = self.units.centres[0, 0, :, 2] - self.driven.road

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
        rise = centre_velocity[:, 2] - self.driven.road_rate
        load = p["kt"] * (p["R0"] - self.height) - p["ct"] * rise
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

    def shear_forces(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Fx, Fy, Mz."""
        regular = np.where(self.touches, self.load, self.p["FNOMIN"])
        slips = self.kappa, self.alpha
        forces = magic_formula_on(self.driven.friction + 0 * regular, regular, *slips, self.p)
        return tuple(np.where(self.touches, force, 0.0) for force in forces)

    def applied(self) -> np.ndarray:
        """Generalised forces (14,): virtual work over virtual displacement."""
        p, d = self.p, derived(self.p)
        fx, fy, mz = self.shear_forces()
        weight = np.full(4, p["m_u"] * p["g"])
        force = fx[:, None] * self.forward + fy[:, None] * self.sideward
        force = force + np.outer(self.load, [0, 0, 1])
        q = np.einsum("awx,wx->a", self.contact, force) + self.turning @ mz
        q -= self.units.centres[1, ..., 2] @ weight
        q -= p["m_s"] * p["g"] * self.units.cg[1, :, 2]
        q[6:10] -= per_wheel(d, "S0") + per_wheel(p, "k") * self.z
        q[6:10] -= per_wheel(p, "c") * self.z_dot
        q += self.driven.push * self.units.cg[1] @ self.frame[:, 0]
        q[10:14] += self.driven.torque(self.nu[10:])
        return q


def accelerations(
    x: np.ndarray, delta: complex, p: Numbers = PARAMETERS, driven: Driven | None = None
) -> np.ndarray:
    """Derivative (28,) of a real or complex state (q, nu), with the steering angle held."""
    now = Instant(np.asarray(x), delta, p, driven)
    mass = inner(now.units, 1, now.units, 1, p)
    bias = 2 * inner(now.units, 1, now.path, 2, p)[:, 0]
    q_second = np.linalg.solve(mass, now.applied() - bias)
    nu_dot = now.speeds @ q_second + 2 * now.quasi_speeds(now.path, 2)[:, 0]
    return np.concatenate([now.q_dot, nu_dot])


def kinetic_matrix(x: np.ndarray, delta: complex, p: Numbers = PARAMETERS) -> np.ndarray:
    """Mass matrix (14, 14) in the quasi-speeds nu."""
    now = Instant(np.asarray(x), delta, p)
    to_rates = np.linalg.inv(now.speeds)
    return to_rates.T @ inner(now.units, 1, now.units, 1, p) @ to_rates


def jacobian(x: np.ndarray, delta: float, p: Numbers = PARAMETERS) -> np.ndarray:
    """d(xdot)/dx (28, 28) by complex step."""
    steps = 1e-30j * np.eye(28)
    columns = [accelerations(x + step, delta, p).imag / 1e-30 for step in steps]
    return np.array(columns).T


def tire_forces(x: np.ndarray, delta: complex, p: Numbers = PARAMETERS) -> dict[str, np.ndarray]:
    """Forces, slips and centre heights of the four wheels."""
    now = Instant(np.asarray(x), delta, p)
    fx, fy, mz = now.shear_forces()
    slips = {"kappa": now.kappa, "alpha": now.alpha, "zc": now.height}
    return {"Fx": fx, "Fy": fy, "Fz": now.load, "Mz": mz, **slips}


def energy(
    x: np.ndarray, p: Numbers = PARAMETERS, delta: float = 0.0, driven: Driven | None = None
) -> float:
    """Kinetic and potential energy."""
    now, d = Instant(np.asarray(x), delta, p, driven), derived(p)
    kinetic = inner(now.path, 1, now.path, 1, p)[0, 0] / 2
    potential = p["m_s"] * p["g"] * x[2] + np.sum(
        p["m_u"] * p["g"] * now.units.centres[0, 0, :, 2]
        + per_wheel(d, "S0") * now.z
        + per_wheel(p, "k") * now.z**2 / 2
        + p["kt"] * np.maximum(0, p["R0"] - now.height) ** 2 / 2
    )
    return kinetic + potential


def power(
    x: np.ndarray, delta: float, p: Numbers = PARAMETERS, driven: Driven | None = None
) -> float:
    """Rate of the energy while the steering angle is held (without damping of the tyres)."""
    now = Instant(np.asarray(x), delta, p, driven)
    fx, fy, mz = now.shear_forces()
    turning = now.q_dot @ now.turning
    lost = per_wheel(p, "c") * now.z_dot**2
    inputs, spin = now.driven, now.nu[10:]
    put_in = inputs.torque(spin) * spin + inputs.road_rate * now.load
    pushed = inputs.push * now.nu[0]
    return pushed + np.sum(put_in + fx * now.slide_x + fy * now.slide_y + mz * turning - lost)


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
