"""What one simulation has given, as text: errors by output, counts, seconds."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from vehiclemor.report.labels import TRAINED, trained_runs
from vehiclemor.report.printing import Line, power, table_text, terms, wrapped

if TYPE_CHECKING:
    import xarray as xr

COLUMNS = {
    "rms_error": "RMS error",
    "floor_rms_error": "floor",
    "max_error": "largest",
    "signal_range": "range",
}
LEGEND = {
    "errors": "against the full-order solution; largest: the largest absolute error; range: of the "
    "full-order output",
    "floor": "RMS error of the best approximation of the coordinates in the subspaces of the "
    "reduced model; an output can undercut it",
    "-": "exactly zero, or there is none",
}


def simulation_text(dataset: xr.Dataset, shown: Sequence[str], counts: Iterable[str]) -> str:
    """Status, a table of the errors of some outputs, solver counts and seconds of a simulation."""
    told = f" ({TRAINED})" if trained_runs(dataset) else ""
    ended = f"{dataset['status'].item()} {dataset['message'].item()}"
    title = f"{dataset.attrs['title']}{told}: {ended}"
    parts = [wrapped(title), wrapped(str(dataset["remark"].item()))]
    lines = []
    for output in shown:
        row = dataset.sel(output=output)
        numbers = [power(float(row[name])) for name in COLUMNS]
        lines.append(Line([str(output), *numbers, str(row["output_unit"].item())]))
    parts.append(table_text(["output", *COLUMNS.values(), "unit"], lines, (0, len(COLUMNS) + 1)))
    parts.append(terms(LEGEND))
    if further := dataset.sizes["output"] - len(shown):
        parts.append(f"{further} more outputs: --all-outputs")
    parts.append(wrapped(", ".join(f"{n.replace('_', ' ')} {dataset[n].item()}" for n in counts)))
    seconds, clock = float(dataset["seconds"]), dataset["seconds"].attrs["clock"]
    parts.append(f"seconds in the compiled loop {seconds:.3e} ({clock})")
    return "\n".join(part for part in parts if part)
