"""Named quantities of models: coordinates, speeds, inputs and outputs, without any symbols."""

import math
from dataclasses import dataclass
from typing import Any

from vehiclemor.parameters import Declared
from vehiclemor.resources import data_folder
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


def declared(model: str) -> dict[str, Any]:
    """Quantities and parameters of a model of this package, from `data/models`."""
    content = toml_content(data_folder() / "models" / f"{model}.toml")
    parameters = {name: Declared(**entry) for name, entry in content.pop("parameters").items()}
    tables = {kind: tuple(Quantity(*row) for row in rows) for kind, rows in content.items()}
    return tables | {"parameters": parameters}
