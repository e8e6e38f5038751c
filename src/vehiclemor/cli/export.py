"""`vehiclemor export`: a full or reduced model for another tool."""

from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

import vehiclemor as vm
from vehiclemor.cli.key_values import key_values
from vehiclemor.errors import InputError
from vehiclemor.exporting.export import STEP, FileTarget, destination, name_of

# Method that stands for the model that ships.
SHIPPED = "shipped"


def export(
    model: str,
    *,
    to: FileTarget,
    method: str | None = None,
    settings: Annotated[
        tuple[str, ...], Parameter(name="--set", negative="", show_default=False)
    ] = (),
    parameter: Annotated[tuple[str, ...], Parameter(negative="", show_default=False)] = (),
    out: Path | None = None,
    overwrite: Annotated[bool, Parameter(negative="")] = False,
    step: float = STEP,
) -> int:
    """Export a model, or a reduced one, for another tool.

    Parameters
    ----------
    model
        Registered name, or file of a reduced model.
    to
        c: a folder with C99 sources; fmu: a functional mock-up unit by FMI 2.0; casadi: a function
        that CasADi loads.
    method
        Reduce the model by this method first; shipped: the reduced model that ships with the
        package.  The full model by default.
    settings
        key=value: a setting of the method, its preset or training (nominal, protocol); may be given
        several times.
    parameter
        name=value: a parameter of the model in SI units; may be given several times.
    out
        Folder or file; under the model's name here by default.
    overwrite
        Replace an export that is there.
    step
        Step size in s of the integrator in C and FMU.
    """
    given: dict[str, Any] = key_values("--set", settings)
    values = key_values("--parameter", parameter)
    file = Path(model).suffix == ".nc"
    kept = file or method == SHIPPED
    if (file and method) or (kept and (given or values)):
        raise InputError("a reduced model that is kept has its method, settings and parameters")
    if given and method is None:
        raise InputError("--set is for a method: --method NAME")
    if kept:
        chosen = vm.load(model) if file else vm.rom(model)
        out = destination(name_of(chosen.model.name, chosen.method), to, out, overwrite)
    else:
        chosen = vm.model(model, values)
        # Before anything is fitted.
        out = destination(name_of(model, method), to, out, overwrite)
        if method is not None:
            chosen = vm.reduce(chosen, method, **given)
    print(f"written: {vm.export(chosen, to, out, overwrite=overwrite, step=step)}")
    return 0
