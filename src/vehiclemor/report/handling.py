"""Table of the numbers of handling tests, full and reduced models side by side."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.exceptions import InputError
from vehiclemor.handling.metrics import RACK, TESTS, declared, metrics, test_of
from vehiclemor.inputs.maneuver import registered
from vehiclemor.registry import names

if TYPE_CHECKING:
    from vehiclemor.reduction.reduced_model import ReducedOrderModel
    from vehiclemor.simulation.trajectory import Trajectory

# Hz: frequencies of a response that are printed.
PRINTED = (0.5, 1.0)


def maneuvers_of(full: ReducedOrderModel, reduced: Iterable[ReducedOrderModel]) -> list[str]:
    """Registered maneuvers with numbers, whose inputs all models have, in the order of the tests.

    The full model has its optional inputs too.  `InputError` if there are none.
    """
    definition = full.model.definition
    every = (*definition.inputs, *definition.optional_inputs)
    shared = {quantity.name for quantity in every}.intersection(*(r.inputs for r in reduced))
    known = {*names("maneuver")}
    wanted = [name for test in TESTS for name in (test, RACK + test) if name in known]
    fitting = [name for name in wanted if shared.issuperset(registered(name).inputs)]
    if not fitting:
        raise InputError(f"{definition.name} is no vehicle of the tests: {', '.join(TESTS)}")
    return fitting


def handling_rows(
    models: Mapping[str, ReducedOrderModel], maneuvers: Iterable[str], amplitude: float
) -> list[dict[str, Any]]:
    """A row for each number, with a column for each model by its name.

    The first model is the full one: all runs start from its state, and by default all maneuvers are
    taken whose inputs all models have.
    """
    first, *reduced = models.values()
    start, speed = first.model.start(), first.parameters.get("initial_speed", np.nan)
    chosen = list(maneuvers) or maneuvers_of(first, reduced)
    standards = {name: declared().standards[test_of(name)] for name in chosen}
    rows: list[dict[str, Any]] = []
    for name, standard in standards.items():
        maneuver = registered(name).perturbed(amplitude=amplitude)
        runs = {key: model.simulate(maneuver, start) for key, model in models.items()}
        remarks = [f"{key}: {run.message}" for key, run in runs.items() if run.message]
        test = "; ".join([f"{name} ({standard}), {speed:.4g} m/s", *remarks])
        values = {key: _values(run) for key, run in runs.items() if run.finished}
        # Names and units, in the order of the first run that has come to its end.
        for number, unit in next(iter(values.values()), [("no numbers", "")]):
            columns = {key: values.get(key, {}).get((number, unit), np.nan) for key in models}
            rows.append({"test": test, "number": number, "unit": unit} | columns)
    return rows


def _values(run: Trajectory) -> dict[tuple[str, str], float]:
    """Name, with its frequency if there is one, and unit of a number -> value."""
    values: dict[tuple[str, str], float] = {}
    for key, number in metrics(run).drop_vars("speed").data_vars.items():
        name, unit = str(key).replace("_", " "), str(number.attrs["units"])
        if not number.dims:
            values[name, unit] = float(number)
            continue
        for hertz in PRINTED:
            at = number.sel(frequency=hertz, method="nearest")
            values[f"{name} at {hertz:g} Hz", unit] = float(at)
    return values
