"""Size studies as rows: what a reduction gains on each mesh, and against which full model."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.study.plans.size import FULL, GROUPS

if TYPE_CHECKING:
    import xarray as xr

Row = dict[str, Any]
KIND = "size"
# Kinds of meshes in words, with the unit of what is refined.
KINDS = {"elements_per_bay": ("beams", "a bay"), "shell_size": ("shells", "m")}
# Decades are fitted over meshes of at least so many coordinates: smaller ones are all overhead.
GROWING = 300


def size_rows(dataset: xr.Dataset) -> Iterator[Row]:
    """A row for each reduced model on each mesh: its gains, errors, rivals and offline cost.

    `rival_*` is the cheapest full model, on any mesh, whose error in that group of outputs is no
    larger; the reduced model is so many times faster (`gain_*`).
    """
    seconds, n = dataset["seconds_median"], dataset["coordinates_of_mesh"].values
    full = seconds.sel(label=FULL).values
    for place in range(dataset.sizes["mesh"]):
        for label in dataset["label"].values.tolist()[1:]:
            own = dataset.isel(mesh=place).sel(label=label)
            time = float(own["seconds_median"])
            if not np.isfinite(time):
                continue
            saved = full[place] - time
            row: Row = {
                "kind": KIND,
                "study": dataset.attrs["study"],
                "mesh": mesh_text(dataset, place),
                "mesh_kind": str(dataset["kind"].values[place]),
                "coordinates": int(n[place]),
                "label": "chosen by its protocol" if _is_vehicle(dataset, place) else label,
                "order": float(own["effective_rank"]),
                "full_seconds": float(full[place]),
                "seconds": time,
                "gain_mesh": float(full[place] / time),
                "offline_seconds": float(own["offline_seconds"]),
                "growth_full": growth(dataset, str(dataset["kind"].values[place]), FULL),
                "growth": growth(dataset, str(dataset["kind"].values[place]), label),
                "break_even": float(own["offline_seconds"] / saved) if saved > 0.0 else np.nan,
            }
            for group in GROUPS:
                row |= _against(dataset, group, float(own["relative_error"].sel(group=group)), time)
            yield row


def _is_vehicle(dataset: xr.Dataset, place: int) -> bool:
    return str(dataset["kind"].values[place]) == "vehicle"


def _against(dataset: xr.Dataset, group: str, error: float, seconds: float) -> Row:
    """The cheapest full model whose error in a group of outputs is no larger."""
    full = dataset.sel(label=FULL)
    errors = full["relative_error"].sel(group=group).values
    times = np.where(errors <= error, full["seconds_median"].values, np.inf)
    found, place = np.isfinite(times).any(), int(times.argmin())
    return {
        f"error_{group}": error,
        f"rival_{group}": mesh_text(dataset, place) if found else "",
        f"gain_{group}": float(times[place] / seconds) if found else np.nan,
    }


def mesh_text(dataset: xr.Dataset, place: int) -> str:
    """A mesh in words: `shells, 0.25 m`; of a vehicle its name."""
    name, kind = str(dataset["mesh"].values[place]), str(dataset["kind"].values[place])
    if kind == "vehicle":
        return name.replace("_", " ")
    word, unit = KINDS.get(kind, (kind, ""))
    return f"{word}, {name.split()[1].rstrip(',')} {unit}".rstrip()


def growth(dataset: xr.Dataset, kind: str, label: str) -> float:
    """Exponent p of time ~ n^p over the meshes of a kind; NaN where fewer than two are timed."""
    n = dataset["coordinates_of_mesh"].values
    seconds = dataset["seconds_median"].sel(label=label).values
    chosen = (dataset["kind"].values == kind) & np.isfinite(seconds) & (n >= GROWING)
    if chosen.sum() < 2:
        return np.nan
    return float(np.polyfit(np.log(n[chosen]), np.log(seconds[chosen]), 1)[0])


def growth_text(rows: Sequence[Row]) -> str:
    """Growth of the times with the number of coordinates, by kind of mesh, in one sentence."""
    found = {
        row["mesh_kind"]: row for row in reversed(rows) if row["growth_full"] == row["growth_full"]
    }
    parts = [
        f"{KINDS.get(kind, (kind,))[0]}: full n^{row['growth_full']:.2f}, "
        f"{row['label']} n^{row['growth']:.2f}"
        for kind, row in sorted(found.items())
    ]
    return f"Times grow with the number n of coordinates ({'; '.join(parts)})." if parts else ""


EXPLAINED = (
    "Errors: worst RMS error of the group against the finest mesh, over the output's range. "
    "Cheapest full: the full model, on any mesh, that is at least as accurate."
)
