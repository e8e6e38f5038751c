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
    """Name, SI unit and meaning of one coordinate, input or output."""

    name: str
    unit: str
    long_name: str


# Front left, front right, rear left, rear right.
WHEELS = ("FL", "FR", "RL", "RR")

# Outputs that are zero where a wheel has left the road.
TIRE_LOADS = tuple(f"Fz_{wheel}" for wheel in WHEELS)
# Bounds beyond which the models mean nothing: of the longitudinal speed, and of the attitude.
FORWARD = (0.5, math.inf)
UPRIGHT = {"roll": (-1.2, 1.2), "pitch": (-1.2, 1.2)}
# How the start `dropped` differs from straight running.
DROP = ("drop_height", "drop_pitch")
# Coefficients of the Fiala tire.
FIALA = (
    *("longitudinal_slip_stiffness", "cornering_stiffness", "largest_friction"),
    *("smallest_friction", "tire_width"),
)
# Share by which a published moment of inertia may break the triangle inequality.
ROUNDED = 0.01


def declared(model: str) -> dict[str, Any]:
    """Quantities and parameters of a model of this package, from `data/models`."""
    content = toml_content(data_folder() / "models" / f"{model}.toml")
    tables: dict[str, Any] = {}
    parameters = content.pop("parameters")
    for kind, rows in content.items():
        tables[kind] = tuple(Quantity(*row) for row in rows)
    tables["parameters"] = {name: Declared(**entry) for name, entry in parameters.items()}
    return tables


def equations_of(package: str) -> Callable[[], Any]:
    """What derives by the module `equations` of a package; SymPy is imported when it is called."""
    return partial(_derived, f"vehiclemor.multibody.{package}.equations")


def _derived(module: str) -> Any:
    return import_module(module).derive()


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
