"""What one simulation has given, as text: errors by output, counts, seconds."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from vehiclemor.report.labels import TRAINED, trained_runs
from vehiclemor.report.printing import table, wrapped

if TYPE_CHECKING:
    import xarray as xr

ERRORS = ("rms_error", "floor_rms_error", "max_error", "signal_range")


def simulation_text(dataset: xr.Dataset, shown: Sequence[str], counts: Iterable[str]) -> str:
    """Status, a table of the errors of some outputs, solver counts and seconds of a simulation."""
    told = f" ({TRAINED})" if trained_runs(dataset) else ""
    ended = f"{dataset['status'].item()} {dataset['message'].item()}"
    parts = [wrapped(f"{dataset.attrs['title']}{told}: {ended}")]
    parts.append(wrapped(str(dataset["remark"].item())))
    rows = []
    for output in shown:
        own = dataset.sel(output=output)
        errors = {name.replace("floor_rms_error", "floor"): own[name].item() for name in ERRORS}
        rows.append({"output": str(output), **errors, "unit": str(own["output_unit"].item())})
    parts.append(table(rows))
    if further := dataset.sizes["output"] - len(shown):
        parts.append(f"{further} more outputs: --all-outputs")
    parts.append(wrapped(", ".join(f"{n.replace('_', ' ')} {dataset[n].item()}" for n in counts)))
    seconds, clock = float(dataset["seconds"]), dataset["seconds"].attrs["clock"]
    parts.append(f"seconds in the compiled loop {seconds:.3e} ({clock})")
    return "\n".join(part for part in parts if part)
