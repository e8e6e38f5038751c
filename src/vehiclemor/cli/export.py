"""`vehiclemor export`: a full or reduced model for another tool."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

import vehiclemor as vm
from vehiclemor.cli.key_values import key_values
from vehiclemor.errors import InputError
from vehiclemor.exporting.export import STEP, Target, destination, name_of


def export(
    model: str,
    *,
    to: Target,
    method: str | None = None,
    settings: Annotated[
        tuple[str, ...], Parameter(name="--set", negative="", show_default=False)
    ] = (),
    preset: str = "recommended",
    training: str | None = None,
    parameter: Annotated[tuple[str, ...], Parameter(negative="", show_default=False)] = (),
    parameters: Path | None = None,
    shipped: Annotated[bool, Parameter(negative="")] = False,
    out: Path | None = None,
    overwrite: Annotated[bool, Parameter(negative="")] = False,
    fmi: Literal[2, 3] = 3,
    step: float = STEP,
) -> int:
    """Export a model, or a reduced one, for another tool.

    Parameters
    ----------
    model
        Registered name, or file of a reduced model.
    to
        c: a folder with C99 sources; fmu: a functional mock-up unit; casadi: a function that CasADi
        loads; jax, sympy: a Python module.
    method
        Reduce the model by this method first; the full model by default.
    settings
        key=value: a setting of the method; may be given several times.
    preset
        Preset of the method's settings.
    training
        nominal or protocol: what the method is trained on; its own by default.
    parameter
        name=value: a parameter of the model in SI units; may be given several times.
    parameters
        Parameter file; the model's own public data by default.
    shipped
        The reduced model that ships with the package for this model.
    out
        Folder or file; under the model's name here by default.
    overwrite
        Replace an export that is there.
    fmi
        Version of the standard.
    step
        Step size in s of the integrator in C and FMU.
    """
    given = key_values("--set", settings)
    kept = Path(model).suffix == ".nc"
    if (kept or shipped) and (method or given or parameter or parameters):
        raise InputError("a reduced model that is kept has its method, settings and parameters")
    if given and method is None:
        raise InputError("--set is for a method: --method NAME")
    if kept or shipped:
        chosen = vm.load(model) if kept else vm.rom(model)
        out = destination(name_of(chosen.model.name, chosen.method), to, out, overwrite)
    else:
        chosen = vm.model(model, key_values("--parameter", parameter), parameters)
        # Before anything is fitted.
        out = destination(name_of(model, method), to, out, overwrite)
        if method is not None:
            chosen = vm.reduce(chosen, method, training=training, preset=preset, **given)
    written = vm.export(chosen, to, out, overwrite=overwrite, fmi=fmi, step=step)
    print(f"written: {written}")
    return 0
