"""Runs with their derivatives by parameters, as labelled datasets."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from vehiclemor.arguments import number, quoted
from vehiclemor.errors import InputError
from vehiclemor.maneuver import Maneuver
from vehiclemor.online.rom import ReducedOrderModel
from vehiclemor.registry import component
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Start

if TYPE_CHECKING:
    import xarray as xr

    from vehiclemor.simulation.sensitivities import Component


def sensitivities(
    model: str | Model | ReducedOrderModel,
    maneuver: str | Maneuver | None = None,
    *,
    parameters: str | Sequence[str],
    start: Start | None = None,
    tolerance: float | None = None,
) -> xr.Dataset:
    """A run with the derivatives of its states and outputs by parameters of the model.

    They are those of the equations themselves (forward sensitivities), integrated beside the run
    by the same compiled loop, which keeps the errors of both below the tolerance.  Where a run
    has a kink, as where a wheel lifts off, they are those on one side.

    Parameters
    ----------
    model
        Registered name, a model made by `model()`, or one made by `reduce()`.
    maneuver
        A maneuver, a signal or a registered name; the model's own by default.
    parameters
        Names of parameters; of a point all three components, or one such as `joint.z`.
    start
        Initial condition by name, which moves with the parameters; or a state (n,), which does
        not; the model's first by default.
    tolerance
        Of the integration, 1e-10 by default: of states, and of derivatives times the size of the
        parameter; of a mechanism the largest last step of an iteration.

    Returns
    -------
    xarray.Dataset
        Histories as of `simulate`, and `d_output`, `d_coordinate`, `d_speed` (time, parameter,
        output, ...), each in the unit of the quantity over that of the parameter.

    Raises
    ------
    InputError
        If a name is unknown, or the model is a reduced one.
    ConvergenceError
        If the run fails.
    """
    from vehiclemor.simulation.build import kept_build
    from vehiclemor.simulation.sensitivities import sensitivities as sensitivities_of
    from vehiclemor.simulation.trajectory_dataset import trajectory_dataset

    if not isinstance(model, str | Model | ReducedOrderModel):
        raise InputError(f"model is {quoted(model)}, neither a model nor its name")
    ready = kept_build(model) if isinstance(model, str) else model
    full = ready.model if isinstance(ready, ReducedOrderModel) else ready
    chosen = full.definition.maneuver if maneuver is None else maneuver
    if isinstance(chosen, str):
        chosen = component("maneuver", chosen)
    if isinstance(parameters, list) and any(parameters.count(name) > 1 for name in parameters):
        raise InputError("parameters has the same name twice")
    how = parameters, start, None if tolerance is None else number("tolerance", tolerance)
    if isinstance(ready, ReducedOrderModel) and ready.method != "full_order":
        raise InputError(f"{ready.method}: its runs have no derivatives by parameters")
    found = sensitivities_of(full, chosen, *how)
    n = len(full.coordinates)
    further: dict[str, tuple[Any, ...]] = {}
    for name, values in (
        ("output", found.outputs),
        ("coordinate", found.states[:, :, :n]),
        ("speed", found.states[:, :, n:]),
    ):
        if values.shape[2]:
            about = {"long_name": f"derivatives of each {name} by each parameter"}
            about["units"] = f"{name}_unit / parameter_unit"
            further[f"d_{name}"] = ("time", "parameter", name), values, about
    dataset = trajectory_dataset(full, found.trajectory, further)
    return dataset.assign_coords(_labels(found.components))


def _labels(components: Sequence[Component]) -> dict[str, xr.DataArray]:
    """Coordinates of the dimension `parameter`."""
    import xarray as xr

    labels = {
        "parameter": ([own.label for own in components], "name of the parameter"),
        "parameter_unit": ([own.unit for own in components], "SI unit of the parameter"),
        "parameter_value": ([own.value for own in components], "its value, in the unit"),
    }
    return {
        key: xr.DataArray(values, dims="parameter", attrs={"long_name": text})
        for key, (values, text) in labels.items()
    }
