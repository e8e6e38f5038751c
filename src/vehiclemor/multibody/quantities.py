"""Quantities of models and what their parameters share, without any symbols."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from typing import Any

import numpy as np

from vehiclemor.exceptions import GeometryError
from vehiclemor.files import data_folder
from vehiclemor.parameters import Declared
from vehiclemor.toml_files import toml_content


@dataclass(frozen=True)
class Quantity:
    """Name, SI unit and meaning of one coordinate, input or output.

    Optional inputs have a default: their value in a run that neither drives nor sets them.
    """

    name: str
    unit: str
    long_name: str
    default: float | None = None


@dataclass(frozen=True)
class ErrorBound:
    """Largest allowed error of an output: its largest magnitude (`max`) or its RMS (`rms`)."""

    measure: str
    bound: float  # In the unit of the output.


@dataclass(frozen=True)
class InputChoice:
    """Optional inputs of a run in declared order; those in neither tuple are their defaults.

    Attributes
    ----------
    driven
        Inputs that change with time.
    constant
        Inputs whose values are parameters of the model.
    """

    driven: tuple[str, ...] = ()
    constant: tuple[str, ...] = ()


DEFAULTS = InputChoice()


def integral_of(name: str) -> str:
    """Name of the input whose time derivative has this name, such as s of s_dot; else empty."""
    base, dot, order = name.rpartition("_")
    if order == "ddot":
        return f"{base}_dot"
    return base if dot and order == "dot" else ""


# Front left, front right, rear left, rear right.
WHEELS = ("FL", "FR", "RL", "RR")

# Outputs that are zero where a wheel has left the road.
TIRE_LOADS = tuple(f"Fz_{wheel}" for wheel in WHEELS)


def error_bounds(yaw: float) -> dict[str, ErrorBound]:
    """Largest errors of a reduced vehicle, with that of its yaw angle in rad.

    They are those of the vehicles' studies with bounds, which say where each comes from.
    """
    return {
        "longitudinal_position": ErrorBound("max", 0.05),
        "lateral_position": ErrorBound("max", 0.05),
        "yaw": ErrorBound("rms", yaw),
        "pitch": ErrorBound("rms", 5.18e-4),
        "lateral_speed": ErrorBound("rms", 0.0198),
        "vertical_speed": ErrorBound("rms", 0.0143),
    }


# Optional inputs at each wheel: name, unit, meaning, default, range of validity.  Slopes are up to
# 0.1, which is 5 m/s at 50 m/s; torques beyond these ranges are in another unit.
BRAKE = "torque of the brake on the {} wheel, against its spin"
AT_WHEEL = (
    ("drive_torque_{}", "N m", "torque of the drive on the {} wheel", 0.0, (-2e4, 2e4)),
    ("brake_torque_{}", "N m", BRAKE, 0.0, (0, 2e4)),
    ("friction_{}", "1", "factor on the friction of the {} tire", 1.0, (0.05, 1.5)),
    ("road_{}", "m", "height of the road under the {} wheel", 0.0, (-0.5, 0.5)),
    ("road_{}_dot", "m/s", "rate of the height of the road under the {} wheel", 0.0, (-5.0, 5.0)),
)
# How the start `dropped` differs from straight running.
DROP = ("drop_height", "drop_pitch")
# Coefficients of the Fiala tire.
FIALA = (
    *("longitudinal_slip_stiffness", "cornering_stiffness", "largest_friction"),
    *("smallest_friction", "tire_width"),
)
# Share by which a published moment of inertia may break the triangle inequality.
ROUNDED = 0.01


# What drives, brakes and lifts a vehicle, and where these inputs mean anything.
_RANGES: dict[Quantity, tuple[float, float]] = {
    Quantity(name.format(wheel), unit, meaning.format(wheel), default): valid
    for name, unit, meaning, default, valid in AT_WHEEL
    for wheel in WHEELS
}
PUSH = "force on the sprung body's centre of mass along the chassis, drag is negative"
_RANGES[Quantity("body_force_x", "N", PUSH, 0.0)] = (-1e5, 1e5)
OPTIONAL_INPUTS = tuple(_RANGES)
# What the declarations of all vehicles share.
VEHICLE: dict[str, Any] = {
    "optional_inputs": OPTIONAL_INPUTS,
    "standstill": ("longitudinal_speed", "lateral_speed"),
    "loads": TIRE_LOADS,
    "slips": tuple(f"slip_ratio_{wheel}" for wheel in WHEELS),
}
# Where they mean anything: they drive forwards and stand upright.
VALIDITY = {"longitudinal_speed": (0.5, math.inf), "roll": (-1.2, 1.2), "pitch": (-1.2, 1.2)}
VALIDITY |= {quantity.name: valid for quantity, valid in _RANGES.items()}


def declared(model: str) -> dict[str, Any]:
    """Quantities and parameters of a model of this package, from `data/models`."""
    content = toml_content(data_folder() / "models" / f"{model}.toml")
    tables: dict[str, Any] = {}
    parameters = content.pop("parameters")
    for kind, rows in content.items():
        tables[kind] = tuple(Quantity(*row) for row in rows)
    tables["parameters"] = {name: Declared(**entry) for name, entry in parameters.items()}
    return tables


def equations_of(package: str, function: str = "derive") -> Callable[..., Any]:
    """A function of the module `equations` of a package; SymPy is imported when it is called."""
    return partial(_derived, f"vehiclemor.multibody.{package}.equations", function)


def _derived(module: str, function: str, *choice: Any) -> Any:
    return getattr(import_module(module), function)(*choice)


def check_moments(name: str, moments: np.ndarray) -> None:
    """Raise `GeometryError` if no body has these principal moments of inertia (3,) in kg m^2.

    The largest is at most the sum of the others, but for rounding: published moments of flat and
    thin bodies are rounded.
    """
    smallest, middle, largest = np.sort(moments)
    if smallest <= 0.0 or largest > (smallest + middle) * (1.0 + ROUNDED):
        raise GeometryError(
            f"{name}: no body has the principal moments of inertia {smallest:.4g}, "
            f"{middle:.4g}, {largest:.4g} kg m^2 (the largest is at most the sum of the others)"
        )
