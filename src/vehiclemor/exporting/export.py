"""Export of full and reduced models to other tools."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from vehiclemor.arguments import file_path, flag, number, quoted, within
from vehiclemor.exceptions import InputError
from vehiclemor.files import begins_with, replaceable, write_whole
from vehiclemor.inputs.columns import listed
from vehiclemor.registry import choice

if TYPE_CHECKING:
    from vehiclemor.exporting.systems import CSettings, ExportedSystem
    from vehiclemor.reduction.reduced_model import ReducedOrderModel
    from vehiclemor.simulation.model import Model

# What a file, or a folder, is written for; the others are objects alone.
FileTarget = Literal["c", "fmu", "casadi"]
Target = Literal[FileTarget, "jax", "rollouts"]
TARGETS: tuple[str, ...] = Target.__args__
Integrator = Literal["rk4", "ros2"]
Precision = Literal["double", "single"]
# How the name of what is written ends; C is a folder.
ENDINGS = {"c": "", "fmu": ".fmu", "casadi": ".casadi"}
# Step in s of the integrator in C: stable for modes of up to 2780 1/s.
STEP = 1e-3
# Shortest and longest: below, rounding is all; above, no model of a vehicle is stable.
STEPS = 1e-7, 1.0
# What an export may replace: one of its kind.
IS_EXPORT: dict[str, Callable[[Path], bool]] = {
    "c": lambda path: (path / OURS).is_file(),
    "fmu": begins_with(b"modelDescription.xml", at=30),
    "casadi": begins_with(b"jhpnnagiieaha"),
}
# Targets that are always written to a file, and those that bring an integrator along.
FILES = ("c", "fmu")
STEPPED = (*FILES, "rollouts")
# A folder with this file is one of ours.
OURS = "vehiclemor_model.h"


def export(
    model: str | Model | ReducedOrderModel,
    to: Target,
    out: str | Path | None = None,
    *,
    overwrite: bool = False,
    step: float = STEP,
    integrator: Integrator = "rk4",
    precision: Precision = "double",
    inputs: str | Sequence[str] = (),
    outputs: str | Sequence[str] | None = None,
) -> Any:
    """A full or reduced model for another tool.

    Parameters
    ----------
    model
        Registered name, a model of `model()`, or a reduced one of `reduce()`, `load()` or `rom()`.
    to
        `c`: a folder with C99 sources.  `fmu`: a functional mock-up unit by FMI 2.0 for model
        exchange and co-simulation, with sources, and a binary for this platform where there is a C
        compiler.  `casadi`: a `Function` (x, u, p) -> (dx, y), where p of a full model is its
        `parameter_values`.  `jax`: a function (x, u, p) -> (dx, y).
        `rollouts`: a function (states, inputs, period) -> outputs of many runs at once, `Rollouts`.
    out
        File or folder to write.  Without it C and FMU go under the model's name into the working
        folder; of the others the object is returned.  With it CasADi writes its file for
        `Function.load`; for JAX there is no file.
    overwrite
        Whether an export that is there is replaced.
    step
        Of the integrator that C, FMU and rollouts bring along, in s.
    integrator
        `rk4`: explicit Runge-Kutta of order 4.  `ros2`: linearly implicit of order 2 with one
        Jacobian, that of the model's first start at this step: stable at longer steps where the
        car isn't slower than there.
    precision
        Of the numbers in C and FMU: `double`, or `single` for processors that have no other.
    inputs
        Optional inputs of a full model that the export has behind those of every run, such as
        `brake_torque_FL`.
    outputs
        Outputs that the export computes, all by default.

    Returns
    -------
    pathlib.Path, or casadi.Function, callable, Rollouts
        What was written, or the object.

    Raises
    ------
    VehiclemorError
        If an argument is wrong, the method can't be exported, something is there already, a package
        is missing, or the C compiler fails.  Then nothing is written.
    """
    settings = _checked_settings(to, step, integrator, precision)
    if out is not None and to not in ENDINGS:
        raise InputError(f"out: an export to {to} is an object, no file")
    if isinstance(model, str):
        from vehiclemor.simulation.build import build

        model = build(model)
    system = system_of(model, listed(inputs))
    if outputs is not None:
        system = system.with_outputs(listed(outputs, "outputs"))
    path: Any = None
    if out is not None or to in FILES:
        path = destination(system.name, to, out, overwrite)
    if len(system.table) and to == "casadi":
        raise InputError(f"{system.name} reads a table, which is no expression: not for {to}")
    return _exported(system, to, path, settings)


def _checked_settings(to: str, step: Any, integrator: str, precision: str) -> CSettings:
    """How it is written; `InputError` if a choice is wrong, or none for the target."""
    from vehiclemor.exporting.systems import CSettings

    choice("target", to, TARGETS)
    choice("integrator", integrator, Integrator.__args__)
    choice("precision", precision, Precision.__args__)
    if to not in STEPPED and integrator != "rk4":
        raise InputError(f"integrator is a choice for {', '.join(STEPPED)}, not for {to}")
    if to not in FILES and precision != "double":
        raise InputError(f"precision is a choice for {', '.join(FILES)}, not for {to}")
    return CSettings(within("step", number("step", step), STEPS, " s"), integrator, precision)


def _exported(system: ExportedSystem, to: str, path: Any, settings: CSettings) -> Any:
    """What is written to a path, or the object."""
    if to == "c":
        from vehiclemor.exporting.c import c_files, write_folder

        texts = c_files(system, settings)
        return write_whole(path, lambda temporary: write_folder(texts, temporary))
    if to == "fmu":
        from vehiclemor.exporting.fmu import fmu_files, write_archive

        files = fmu_files(system, settings)
        return write_whole(path, lambda temporary: write_archive(files, temporary))
    if to == "rollouts":
        from vehiclemor.exporting.rollouts import Rollouts

        return Rollouts(system, settings.step, settings.integrator)
    from vehiclemor.exporting.libraries import OBJECTS

    exported = OBJECTS[to](system)
    if path is None:
        return exported
    return write_whole(path, lambda temporary: exported.save(str(temporary)))


def destination(name: str, to: str, out: str | Path | None, overwrite: bool) -> Path:
    """Where an export goes, by default under the model's name into the working folder.

    `InputError` if what is there must not be replaced, or nothing can be written there.
    """
    path = file_path("out", Path(f"{name}{ENDINGS[to]}") if out is None else out)
    if not path.absolute().parent.is_dir():
        raise InputError(f"{path}: the folder {path.parent} does not exist")
    if not flag("overwrite", overwrite) and os.path.lexists(path):
        raise InputError(f"{path} exists; overwrite=True (--overwrite) replaces it")
    return replaceable(path, f"export to {to}", IS_EXPORT[to])


def name_of(model: str, method: str | None) -> str:
    """What an export is called: a word of C, after the model and the method."""
    word = re.sub(r"\W", "_", f"{model}_{method}" if method else model, flags=re.ASCII)
    return f"_{word}" if word[:1].isdigit() else word


def system_of(model: Model | ReducedOrderModel, inputs: Sequence[str] = ()) -> ExportedSystem:
    """The system that a model is exported as; `InputError` if it can't have one of the inputs."""
    from vehiclemor.exporting.systems import exported_system
    from vehiclemor.reduction.reduced_model import ReducedOrderModel
    from vehiclemor.simulation.model import Model

    if isinstance(model, ReducedOrderModel):
        # It has the inputs of its training.
        for name in inputs:
            choice("input", name, model.inputs)
        return exported_system(model.reduced, name_of(model.model.name, model.method))
    if not isinstance(model, Model):
        raise InputError(f"model: {quoted(model)} is neither a name nor a full or reduced model")
    return exported_system(model.driving(inputs), name_of(model.name, None))
