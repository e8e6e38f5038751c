"""The high-fidelity vehicle's numbers, points, tensors, steering input and tyre.

Written from the text of the vehicle's specification alone; `high_fidelity_vehicle` and
`high_fidelity_pinocchio` use it.  Numbers are of the left side; the right side is mirrored.
Arrays over two sides are in the order left, right.  SI units throughout.
"""

import tomllib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

Numbers = Mapping[str, float | list]

CORNER = ("zeta", "eta", "xi", "theta_u", "theta_l", "alpha", "beta")
COORDINATES = (
    *("x", "y", "z", "psi", "theta", "phi"),
    *(f"{name}_FL" for name in CORNER),
    *(f"{name}_FR" for name in CORNER),
    *("a_RL", "a_RR"),
    *("spin_FL", "spin_FR", "spin_RL", "spin_RR"),
)
BODIES = (
    "chassis",
    *("upper_arm_FL", "upper_arm_FR", "lower_arm_FL", "lower_arm_FR", "carrier_FL", "carrier_FR"),
    *("tie_rod_FL", "tie_rod_FR", "wheel_FL", "wheel_FR"),
    *("arm_RL", "arm_RR", "wheel_RL", "wheel_RR"),
)
WHEELS = [BODIES.index(f"wheel_{corner}") for corner in ("FL", "FR", "RL", "RR")]
# what a wheel turns on: the front carriers and the rear arms
HOLDERS = [BODIES.index(name) for name in ("carrier_FL", "carrier_FR", "arm_RL", "arm_RR")]
AXLES = ("front", "front", "rear", "rear")  # of the wheels and springs in the order FL to RR


def _flat(table: Mapping, before: str = "") -> dict[str, float | list]:
    found = {}
    for key, value in table.items():
        name = f"{before}{key}"
        found |= _flat(value, f"{name}.") if isinstance(value, dict) else {name: value}
    return found


PARAMETERS = _flat(tomllib.loads(Path(__file__).with_suffix(".toml").read_text()))
NO_DAMPERS = {"front.spring.damping": 0.0, "rear.spring.damping": 0.0}


# Places of the mirror image's coordinates, and those that it reverses.
PARTNERS = [*range(6), *range(13, 20), *range(6, 13), 21, 20, 23, 22, 25, 24]
REVERSED = [1, 3, 5, *(k for first in (6, 13) for k in (first, *range(first + 2, first + 7)))]


def mirror(vectors: np.ndarray) -> np.ndarray:
    """States, or coordinates, of the mirror image; along the last axis."""
    halves = vectors.reshape(*vectors.shape[:-1], -1, 26)[..., PARTNERS]
    halves[..., REVERSED] *= -1
    return halves.reshape(vectors.shape)


def both_sides(point: np.ndarray) -> np.ndarray:
    """A left point and its mirror image (2, 3)."""
    return np.array([point, point * [1, -1, 1]])


def front_points(p: Numbers = PARAMETERS) -> dict[str, np.ndarray]:
    """Front points and centres of gravity at design, C-coordinates (2, 3) in m."""
    shift = np.subtract(p["frames.S_origin_in_V"], p["frames.C_origin_in_V"])
    given = {k.removeprefix("front.points."): p[k] for k in p if k.startswith("front.points.")}
    given |= {f"{body}_cg": p[f"front.{body}.cg"] for body in ("upper_arm", "lower_arm", "upright")}
    return {name: both_sides(np.add(point, shift)) for name, point in given.items()}


def rear_points(p: Numbers = PARAMETERS) -> dict[str, np.ndarray]:
    """Rear points at design, C-coordinates (2, 3) in m."""
    shift = np.subtract(p["frames.R_origin_in_V"], p["frames.C_origin_in_V"])
    given = {
        "wheel_centre": [0.0, 0.0, 0.0],
        "pivot": p["rear.pivot"],
        "arm_cg": p["rear.arm.cg"],
        "spring_chassis": p["rear.spring.chassis_point"],
        "spring_arm": p["rear.spring.arm_point"],
    }
    return {name: both_sides(np.add(point, shift)) for name, point in given.items()}


def arm_axis(arm: str, points: Mapping[str, np.ndarray]) -> np.ndarray:
    """Unit axes (2, 3) of the front "upper" or "lower" arms, rear to front pivot."""
    axis = points[f"{arm}_pivot_front"] - points[f"{arm}_pivot_rear"]
    return axis / np.linalg.norm(axis, axis=1, keepdims=True)


def tie_rod_length(points: Mapping[str, np.ndarray]) -> float:
    """Length of a tie rod in m, from the front points."""
    return np.linalg.norm(points["tie_rod_outer"][0] - points["rack_end"][0])


def arm_tensor(arm: str, p: Numbers = PARAMETERS) -> np.ndarray:
    """Inertia (3, 3) of the left front arm about its centre of gravity, C axes, in kg m^2."""
    points = front_points(p)
    first = arm_axis(arm, points)[0]
    third = np.cross(first, points[f"{arm}_ball"][0] - points[f"{arm}_pivot_rear"][0])
    third /= np.linalg.norm(third)
    axes = np.array([first, np.cross(third, first), third]).T
    return axes @ np.diag(p[f"front.{arm}_arm.inertia_arm_frame"]) @ axes.T


def masses_and_tensors(p: Numbers = PARAMETERS) -> tuple[np.ndarray, np.ndarray]:
    """Masses (15,) in kg and body-fixed inertia tensors (15, 3, 3) in kg m^2, order of BODIES.

    Axes are the body's own, which are the chassis' at design, but the tie rods': along them is y.
    """

    def slender(part: str, axial: str) -> np.ndarray:
        across = p[f"{part}.inertia_transverse"]
        return np.diag([across, p[f"{part}.{axial}"], across])

    left = [
        (p["front.upper_arm.mass"], arm_tensor("upper", p)),
        (p["front.lower_arm.mass"], arm_tensor("lower", p)),
        (p["front.upright.mass"], np.diag(p["front.upright.inertia_diag"])),
        (p["front.tie_rod.mass"], slender("front.tie_rod", "inertia_axial")),
        (p["front.wheel.mass"], slender("front.wheel", "inertia_spin")),
        (p["rear.arm.mass"], np.array(p["rear.arm.inertia"])),
        (p["rear.wheel.mass"], slender("rear.wheel", "inertia_spin")),
    ]
    mirror = np.diag([1.0, -1.0, 1.0])
    masses, tensors = [p["chassis.mass"]], [np.diag(p["chassis.inertia_diag"])]
    for mass, tensor in left:
        masses += [mass, mass]
        tensors += [tensor, mirror @ tensor @ mirror]
    return np.array(masses), np.array(tensors)


def design(p: Numbers = PARAMETERS) -> np.ndarray:
    """Coordinates (26,) of the joints at design, with the chassis at the world's origin."""
    points = front_points(p)
    d = (points["tie_rod_outer"][0] - points["rack_end"][0]) / tie_rod_length(points)
    angles = np.array([np.arctan2(-d[0], d[1]), np.arcsin(d[2])])
    q = np.zeros(26)
    q[11:13], q[18:20] = angles, -angles
    return q


def lane_change(
    t: float, amplitude: float = 1.0, frequency: float = 1.0, p: Numbers = PARAMETERS
) -> tuple[float, float, float]:
    """Position in m, velocity and acceleration of the rack at time t in s."""
    rate = frequency / p["steering.period"]
    tau = (t - p["steering.start"]) * rate
    if not 0 <= tau <= 1:
        return 0.0, 0.0, 0.0
    a, w = amplitude * p["steering.amplitude"], 2 * np.pi
    return (
        a * (np.sin(w * tau) - np.sin(2 * w * tau) / 2),
        a * w * rate * (np.cos(w * tau) - np.cos(2 * w * tau)),
        a * (w * rate) ** 2 * (2 * np.sin(2 * w * tau) - np.sin(w * tau)),
    )


def brush(
    friction: float, fz: float, kappa: float, t: float, p: Numbers
) -> tuple[float, float, float]:
    """As `fiala`, but one force along the bristles' deflection at combined slip."""
    slip = min(1.0, np.hypot(kappa, t))
    grip = friction * (p["tyre.mu_max"] - (p["tyre.mu_max"] - p["tyre.mu_min"]) * slip) * fz
    x, y = p["tyre.c_long"] * kappa, p["tyre.c_alpha"] * t
    if fz == 0 or (x, y) == (0, 0):
        return 0.0, 0.0, 0.0
    h = max(0.0, 1 - np.hypot(x, y) / (3 * grip))
    force, lever = grip * (1 - h**3), p["tyre.width"] * (1 - h) * h**3
    cosine, sine = x / np.hypot(x, y), y / np.hypot(x, y)
    return force * cosine, -force * sine, grip * lever * sine


def fiala(fz: float, kappa: float, t: float, p: Numbers) -> tuple[float, float, float]:
    """Longitudinal and lateral force in N, aligning moment in N m, by load and slips."""
    if fz == 0:
        return 0.0, 0.0, 0.0
    slip = min(1.0, np.sqrt(kappa**2 + t**2))
    grip = (p["tyre.mu_max"] - (p["tyre.mu_max"] - p["tyre.mu_min"]) * slip) * fz
    stiff = p["tyre.c_long"]
    if abs(kappa) <= grip / (2 * stiff):
        fx = stiff * kappa
    else:
        fx = np.sign(kappa) * (grip - grip**2 / (4 * abs(kappa) * stiff))
    pull = p["tyre.c_alpha"] * abs(t)
    if pull > 3 * grip:
        return fx, -np.sign(t) * grip, 0.0
    h = 1 - pull / (3 * grip)
    fy = -np.sign(t) * grip * (1 - h**3)
    return fx, fy, np.sign(t) * grip * p["tyre.width"] * (1 - h) * h**3
