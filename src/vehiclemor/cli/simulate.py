"""`vehiclemor simulate`: one run of a model with a method, and its errors."""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from vehiclemor import api
from vehiclemor.cli.exit_status import FAILED
from vehiclemor.cli.key_values import key_values
from vehiclemor.cli.output_file import picture_file, result_file
from vehiclemor.errors import InputError

if TYPE_CHECKING:
    import xarray as xr


def simulate(
    model: str,
    *,
    method: str = "full_order",
    settings: Annotated[
        tuple[str, ...], Parameter(name="--set", negative="", show_default=False)
    ] = (),
    maneuver: str | None = None,
    frequency: float = 1.0,
    amplitude: float = 1.0,
    start: str | None = None,
    preset: str = "recommended",
    training: Annotated[tuple[str, ...], Parameter(negative="", show_default=False)] = ("matched",),
    parameter: Annotated[tuple[str, ...], Parameter(negative="", show_default=False)] = (),
    parameters: Path | None = None,
    out: Path | None = None,
    plot: Annotated[list[Path] | None, Parameter(consume_multiple=True, negative="")] = None,
    all_outputs: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Simulate a model with a method; errors are against the full-order solution.

    Parameters
    ----------
    model
        Registered name.
    method
        Registered name.
    settings
        key=value: a setting of the method; may be given several times.
    maneuver
        Registered name; the model's own by default.
    frequency
        Factor on the input's frequency.
    amplitude
        Factor on the input's amplitude.
    start
        Initial condition; the model's first by default.
    preset
        Preset of the method's settings.
    training
        matched (the very run that is simulated; the default), nominal (the model's own maneuver),
        the name of a maneuver, or protocol (the training of the model's protocol); may be given
        several times.
    parameter
        name=value: a parameter of the model in SI units, a point as x,y,z or one component as
        name.z=value; may be given several times.  `vehiclemor show MODEL` has names, units and
        bounds.
    parameters
        Parameter file; the model's own public data by default.
    out
        netCDF file for the result.
    plot
        Draw the result into this file, or into MODEL-METHOD.png here.
    all_outputs
        Print errors of every output, not only of those that tables show.
    """
    chosen = _settings(settings)
    picture = None if plot is None else picture_file("--plot", plot, f"{model}-{method}")
    if out is not None:
        out = result_file("--out", out)
    ready = api.model(model, key_values("--parameter", parameter), parameters)
    dataset = api.simulate(
        ready,
        method,
        maneuver=maneuver,
        start=start,
        frequency=frequency,
        amplitude=amplitude,
        preset=preset,
        training=training,
        **chosen,
    )
    from vehiclemor.report.printing import simulation_text
    from vehiclemor.report.shown import tabled_outputs

    shown = ready.outputs if all_outputs else tabled_outputs(ready.definition)
    print(simulation_text(dataset, shown, ready.counts))
    _keep(dataset, out, picture)
    return FAILED if dataset["status"].item() in ("diverged", "error") else 0


def _settings(given: Sequence[str]) -> dict[str, Any]:
    settings = key_values("--set", given)
    for key in inspect.signature(api.simulate).parameters.keys() & settings.keys():
        raise InputError(f"--set {key}: not a setting of a method, but an argument of simulate")
    return settings


def _keep(dataset: xr.Dataset, out: Path | None, picture: Path | None) -> None:
    if out is not None:
        from vehiclemor.study.netcdf_file import write_dataset

        write_dataset(dataset, out)
        print(f"written: {out}")
    if picture is not None:
        api.plot(dataset, path=picture)
        print(f"written: {picture}")
    if out is None and picture is None:
        print("nothing is kept: --out FILE.nc keeps the result, --plot draws it")
