"""Table of the numbers of handling tests, full and reduced models side by side."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.exceptions import InputError
from vehiclemor.handling.metrics import RACK, TESTS, metrics, standard_of, test_of
from vehiclemor.inputs.maneuver import registered
from vehiclemor.registry import names

if TYPE_CHECKING:
    import xarray as xr

    from vehiclemor.reduction.reduced_model import ReducedOrderModel
    from vehiclemor.simulation.model import Model

# Hz: frequencies of a response that are printed.
PRINTED = (0.5, 1.0)


def maneuvers_of(full: Model, reduced: Iterable[ReducedOrderModel]) -> list[str]:
    """Registered maneuvers with numbers, whose inputs all models have, in the order of the tests.

    The full model has its optional inputs too.  `InputError` if there are none.
    """
    definition = full.definition
    every = (*definition.inputs, *definition.optional_inputs)
    shared = {quantity.name for quantity in every}.intersection(*(r.inputs for r in reduced))
    known = {*names("maneuver")}
    wanted = [name for test in TESTS for name in (test, RACK + test) if name in known]
    fitting = [name for name in wanted if shared.issuperset(registered(name).inputs)]
    if not fitting:
        raise InputError(f"{full.name} is no vehicle of the handling tests: {', '.join(TESTS)}")
    return fitting


def handling_rows(
    models: Mapping[str, ReducedOrderModel], maneuvers: Iterable[str], amplitude: float
) -> list[dict[str, Any]]:
    """A row for each number, with a column for each model by its name.

    The first model is the full one: all runs start from its state, and by default all maneuvers are
    taken whose inputs all models have.
    """
    first, *reduced = models.values()
    full = first.model
    chosen = list(maneuvers) or maneuvers_of(full, reduced)
    standards = {name: standard_of(test_of(name)) for name in chosen}
    rows: list[dict[str, Any]] = []
    for name, standard in standards.items():
        maneuver = registered(name).perturbed(amplitude=amplitude)
        runs = {key: model.simulate(maneuver, full.start()) for key, model in models.items()}
        remarks = [f"{key}: {run.message}" for key, run in runs.items() if run.message]
        numbers = {key: metrics(run) for key, run in runs.items() if run.finished}
        speed = [f"from {float(each['speed']):.4g} m/s" for each in numbers.values()][:1]
        test = "; ".join([f"{name} ({standard})", *speed, *remarks])
        values = {key: _values(each) for key, each in numbers.items()}
        units = {number: unit for each in values.values() for number, (unit, _) in each.items()}
        for number, unit in (units or {"no numbers": ""}).items():
            columns = {key: values[key][number][1] if key in values else np.nan for key in models}
            rows.append({"test": test, "number": number, "unit": unit} | columns)
    return rows


def _values(numbers: xr.Dataset) -> dict[str, tuple[str, float]]:
    """Name of a number -> unit and value, with its frequency if it has one."""
    values: dict[str, tuple[str, float]] = {}
    for key, number in numbers.drop_vars("speed").data_vars.items():
        name, unit = str(key).replace("_", " "), str(number.attrs["units"])
        if number.dims:
            for hertz in PRINTED:
                at = number.sel(frequency=hertz, method="nearest")
                values[f"{name} at {hertz:g} Hz"] = unit, float(at)
        else:
            values[name] = unit, float(number)
    return values
