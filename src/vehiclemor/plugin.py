"""All that a plug-in imports; until version 2 these names keep their meaning.

Each is imported when it is first used: a plug-in's method does not wait for SymPy.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vehiclemor.contracts import check_method as check_method
    from vehiclemor.contracts import check_model as check_model
    from vehiclemor.exceptions import InputError as InputError
    from vehiclemor.inputs.maneuver import Maneuver as Maneuver
    from vehiclemor.multibody.definition import ModelDefinition as ModelDefinition
    from vehiclemor.multibody.definition import Structure as Structure
    from vehiclemor.multibody.quantities import Quantity as Quantity
    from vehiclemor.parameters import Declared as Declared
    from vehiclemor.reduction.interface import Method as Method
    from vehiclemor.reduction.interface import OfflineCost as OfflineCost
    from vehiclemor.reduction.interface import offline_cost as offline_cost
    from vehiclemor.reduction.reduced_system import ReducedMechanism as ReducedMechanism
    from vehiclemor.reduction.reduced_system import ReducedSystem as ReducedSystem
    from vehiclemor.reduction.settings import AT_MOST_COORDINATES as AT_MOST_COORDINATES
    from vehiclemor.reduction.settings import Settings as Settings
    from vehiclemor.simulation.run_timer import clock as clock
    from vehiclemor.simulation.trajectory import Trust as Trust
    from vehiclemor.symbolic.program import assemble as assemble
    from vehiclemor.symbolic.tape import Tape as Tape

# Name -> module that defines it.
_DEFINED_IN = {
    "AT_MOST_COORDINATES": "vehiclemor.reduction.settings",
    "Declared": "vehiclemor.parameters",
    "InputError": "vehiclemor.exceptions",
    "Maneuver": "vehiclemor.inputs.maneuver",
    "Method": "vehiclemor.reduction.interface",
    "ModelDefinition": "vehiclemor.multibody.definition",
    "OfflineCost": "vehiclemor.reduction.interface",
    "Quantity": "vehiclemor.multibody.quantities",
    "ReducedMechanism": "vehiclemor.reduction.reduced_system",
    "ReducedSystem": "vehiclemor.reduction.reduced_system",
    "Settings": "vehiclemor.reduction.settings",
    "Structure": "vehiclemor.multibody.definition",
    "Tape": "vehiclemor.symbolic.tape",
    "Trust": "vehiclemor.simulation.trajectory",
    "assemble": "vehiclemor.symbolic.program",
    "check_method": "vehiclemor.contracts",
    "check_model": "vehiclemor.contracts",
    "clock": "vehiclemor.simulation.run_timer",
    "offline_cost": "vehiclemor.reduction.interface",
}


def __getattr__(name: str) -> Any:
    if name not in _DEFINED_IN:
        raise AttributeError(f"module 'vehiclemor.plugin' has no attribute {name!r}")
    return getattr(import_module(_DEFINED_IN[name]), name)


def __dir__() -> list[str]:
    return [*_DEFINED_IN]
