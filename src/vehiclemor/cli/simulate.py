"""`vehiclemor simulate`: one run of a model with a method, and its errors."""

from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from vehiclemor import api
from vehiclemor.cli.exit_status import FAILED
from vehiclemor.errors import InputError


def simulate(
    model: str,
    *,
    method: str = "full_order",
    settings: Annotated[tuple[str, ...], Parameter(name="--set", negative="")] = (),
    maneuver: str | None = None,
    frequency: float = 1.0,
    amplitude: float = 1.0,
    start: str | None = None,
    preset: str = "recommended",
    training: str = "matched",
    parameters: Path | None = None,
    out: Path | None = None,
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
        matched, or nominal (trained on the unperturbed input).
    parameters
        Parameter file; the model's own public data by default.
    out
        netCDF file for the result.
    """
    from vehiclemor.reduction.validation import parsed

    chosen: dict[str, Any] = {}
    for setting in settings:
        key, separator, value = setting.partition("=")
        if not separator or not key:
            raise InputError(f"--set {setting!r} is not key=value")
        if key in chosen:
            raise InputError(f"--set {key} is given twice")
        chosen[key] = parsed(value)
    if out is not None:
        _check_writable(out)
    ready = api.model(model, parameter_file=parameters)
    reserved = {"frequency", "amplitude", "maneuver", "start", "preset", "training", "training_set"}
    for key in reserved & set(chosen):
        raise InputError(f"--set {key}: not a setting of a method; use --{key}")
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
    if out is not None:
        from vehiclemor.study.store import write_dataset

        write_dataset(dataset, out)
    from vehiclemor.report.simulation import simulation_text

    print(simulation_text(dataset, ready.counts))
    if out is not None:
        print(f"written: {out}")
    return FAILED if dataset["status"].item() in ("diverged", "error") else 0


def _check_writable(out: Path) -> None:
    from vehiclemor.study.store import read_dataset

    if out.is_dir():
        raise InputError(f"--out {out}: is a folder, not a file")
    if not out.parent.is_dir():
        raise InputError(f"--out {out}: the folder {out.parent} does not exist")
    if out.exists():
        read_dataset(out, "source", "vehiclemor")
