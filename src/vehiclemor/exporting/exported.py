"""Which system a model, or what a method has made of it, is exported as."""

from typing import Any

from vehiclemor.errors import InputError
from vehiclemor.exporting.equations_of_motion import full_system, reduced_system
from vehiclemor.exporting.mechanism import mechanism_system
from vehiclemor.exporting.path_map import map_system
from vehiclemor.exporting.system import ExportedSystem
from vehiclemor.reduction.methods.full_order import FullOrder
from vehiclemor.reduction.methods.guarded import FallbackModel
from vehiclemor.reduction.methods.path_map import PathMapModel
from vehiclemor.reduction.reduced_system import ReducedSystem
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.simulation.dynamic import DynamicModel


def exported_system(what: Any, name: str) -> ExportedSystem:
    """The system of a model, or of what the fit of a method has given.

    Parameters
    ----------
    name
        What it is called.

    Raises
    ------
    InputError
        If it is no system of straight-line equations.
    """
    match what:
        case DynamicModel():
            return full_system(what, name)
        case AlgebraicModel():
            return mechanism_system(what, name)
        case FullOrder():
            return exported_system(what.model, name)
        case FallbackModel():
            return exported_system(what.fast, name)
        case PathMapModel():
            return map_system(what, name)
        case ReducedVehicle():
            return reduced_system(what, name, what.lift.kernel(0))
        case ReducedSystem() if what.spaces.formulation == "full":
            if what.states == what.model.definition.states:
                return reduced_system(what, name, None)
    raise InputError(f"{name} can't be exported: its equations are no straight-line program")
