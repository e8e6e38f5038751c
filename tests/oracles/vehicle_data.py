"""The 14-DOF vehicle's numbers, its tyre's formulas, its steering input and its single-track gain.

Written from the text of the vehicle's specification alone; `vehicle_lagrange` uses it.
"""

from collections.abc import Mapping

import numpy as np

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
